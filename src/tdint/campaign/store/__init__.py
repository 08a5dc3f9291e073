"""What a campaign has done so far, in one SQLite file: whatever ends the process, nothing is lost and nothing twice."""
