"""A building's result beside what was recorded in it, and the building that fits a recording."""
