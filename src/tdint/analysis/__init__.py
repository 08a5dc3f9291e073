"""Analyses: time integration, spectra, assessment of methods, and work-precision diagrams."""
