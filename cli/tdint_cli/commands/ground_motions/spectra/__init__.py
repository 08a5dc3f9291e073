"""What `spectrum` and `drift-spectrum` make of records: a table over the period."""
