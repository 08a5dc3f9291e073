"""Commands of many motions and many runs: scaling, incremental dynamic analysis, fragility, campaigns."""
