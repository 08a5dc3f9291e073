"""Pictures; matplotlib is imported here alone."""
