"""Work-precision diagrams of methods for a building, compared with other programs."""
