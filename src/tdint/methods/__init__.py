"""Time-integration methods: one file per family, and the catalogue of all of them."""
