"""Incremental dynamic analysis: curves, capacities, tables, figures, report."""
