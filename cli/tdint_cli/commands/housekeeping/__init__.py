"""Commands on tdint itself."""
