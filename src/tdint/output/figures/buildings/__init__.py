"""Pictures of buildings: runs, recordings beside results, pushovers, loops of a story."""
