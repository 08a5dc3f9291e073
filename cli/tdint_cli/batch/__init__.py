"""The same work on many records: which they are, and the processes that share it."""
