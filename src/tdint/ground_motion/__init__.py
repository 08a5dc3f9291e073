"""Ground-motion records: reading, processing, measures."""
