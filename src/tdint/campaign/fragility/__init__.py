"""Fragility functions: tables of observations, and lognormal distributions fitted to them."""
