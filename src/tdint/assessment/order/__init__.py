"""Observed order of convergence of methods."""
