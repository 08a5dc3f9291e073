"""The tdint command line."""
