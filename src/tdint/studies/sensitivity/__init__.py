"""Sensitivity of peak responses to building parameters."""
