"""JSON: what was asked for, what came of it, and from which files and versions."""
