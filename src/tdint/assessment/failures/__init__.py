"""Failures of methods on problems that are difficult to integrate."""
