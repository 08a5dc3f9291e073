"""Validation against published and exact results."""
