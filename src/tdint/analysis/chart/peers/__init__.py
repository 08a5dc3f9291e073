"""Other programs on the problems of a chart, each measured as our own methods are."""
