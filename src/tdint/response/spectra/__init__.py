"""Elastic, rotated, inelastic and drift spectra of records."""
