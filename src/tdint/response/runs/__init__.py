"""Time integration of a building: time steps, peaks, failures, error estimates."""
