"""What every file of keys goes through: its text, nodes with line and column, values of declared
kinds."""
