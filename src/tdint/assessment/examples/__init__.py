"""Examples of the paper of 2022."""
