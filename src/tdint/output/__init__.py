"""What is written: tables as CSV, summaries as JSON, figures."""
