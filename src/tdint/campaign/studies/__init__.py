"""Studies of many motions: measures of intensity, scaling, incremental dynamic analysis, fragility."""
