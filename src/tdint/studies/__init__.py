"""Studies of many runs: campaigns, IDA, fragility, and ground motions for them."""
