"""What is computed: runs, spectra, assessments of methods, time against accuracy."""
