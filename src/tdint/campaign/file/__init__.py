"""From a campaign file to what it asks for: every fault of the file with its line and column."""
