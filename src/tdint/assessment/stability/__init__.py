"""Stability, accuracy and overshoot of methods."""
