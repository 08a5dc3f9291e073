"""Commands that assess methods."""
