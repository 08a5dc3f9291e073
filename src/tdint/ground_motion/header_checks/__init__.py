"""What a file says of itself, compared with what was read from it.

Counts, lengths, steps, peaks and checksums stand in most files twice: once as a statement of the header, once in the
samples. A reader that trusts one of the two drops samples without a word or takes memory for samples. Here both are
compared, for every format: `statement` has the comparison, one module a family of formats has their statements, and
`check` has the table of all.
"""
