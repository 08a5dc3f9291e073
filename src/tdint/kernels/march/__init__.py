"""The loop over time, one step in it, and what its steps share."""
