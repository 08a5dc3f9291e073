"""Assessment of time-integration methods."""
