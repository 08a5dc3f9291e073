"""Buildings and their loads, as model files describe them."""
