"""From YAML to a model: every error of a file with its line and column."""
