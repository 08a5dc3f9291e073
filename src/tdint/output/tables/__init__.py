"""CSV tables: columns and their order."""
