"""Incremental dynamic analysis: levels, runs, what is kept of them, capacities, fractiles."""
