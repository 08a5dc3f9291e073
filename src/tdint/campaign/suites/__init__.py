"""Suites of ground motions: what is read of them, measures of their intensity, factors that scale them."""
