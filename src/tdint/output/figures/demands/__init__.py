"""Figures of demands in a building: profiles over its height, spectra of its floors."""
