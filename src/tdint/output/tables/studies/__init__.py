"""Tables of studies: factors, incremental dynamic analyses, fragility functions."""
