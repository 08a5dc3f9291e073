"""Many runs: buildings under suites of records at many levels, kept in a store that survives whatever ends them."""
