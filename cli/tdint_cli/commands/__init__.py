"""The commands, one module each, in the groups of the help."""
