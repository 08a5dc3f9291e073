"""Reading of files with keys: their text, nodes with line and column, and values of declared
types."""
