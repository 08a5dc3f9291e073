"""Fragility functions, and damage of the buildings of campaigns."""
