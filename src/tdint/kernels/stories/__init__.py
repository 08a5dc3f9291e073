"""The forces of stories: where a law is, how its branch ends, what it does along a path."""
