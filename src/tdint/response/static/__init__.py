"""Static analyses: pushover, cyclic tests, target displacement."""
