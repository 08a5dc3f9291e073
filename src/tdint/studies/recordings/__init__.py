"""Comparison of computed with recorded responses, and estimation of parameters."""
