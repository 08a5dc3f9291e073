"""Commands on time-integration methods."""
