"""Forces of stories: states of the laws, ends of their branches, and paths within a step."""
