"""Output of results: tables as CSV, summaries as JSON, figures and reports."""
