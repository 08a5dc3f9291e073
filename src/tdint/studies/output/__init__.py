"""Reports and summaries of studies."""
