"""From YAML to a model: every fault of a file with its line and column."""
