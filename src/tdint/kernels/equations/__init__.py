"""Equations of motion over a step and their solution."""
