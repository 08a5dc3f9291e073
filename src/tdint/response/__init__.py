"""Response: time integration, spectra, and static analyses of a building."""
