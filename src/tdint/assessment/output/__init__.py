"""Summaries of charts."""
