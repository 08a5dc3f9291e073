"""What a person at a terminal sees: data, words, progress."""
