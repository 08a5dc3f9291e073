"""Imposed displacements: cyclic tests of a story, paths of drift, pushovers."""
