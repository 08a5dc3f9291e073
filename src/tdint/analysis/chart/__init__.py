"""Time against accuracy of methods on a building, beside other programs."""
