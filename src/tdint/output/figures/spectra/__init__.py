"""Pictures of spectra: over the period, tripartite, acceleration over displacement; drift spectra."""
