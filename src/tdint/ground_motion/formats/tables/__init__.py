"""What stands above the numbers of a text table, and what a user says of one."""
