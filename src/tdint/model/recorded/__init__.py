"""What was recorded in a building: the file that says where, and how to set it beside a result."""
