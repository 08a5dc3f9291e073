"""Store of the results of campaigns and studies in an SQLite file."""
