"""From files to records: what a file holds, which units it has, what of it is taken."""
