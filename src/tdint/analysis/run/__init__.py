"""A building under its load in time: steps, peaks, how the run ends, how far off it is."""
