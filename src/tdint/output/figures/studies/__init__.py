"""Pictures of studies: suites of spectra, curves of incremental dynamic analyses, fragility functions."""
