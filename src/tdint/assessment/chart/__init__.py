"""Work-precision diagrams and performance profiles."""
