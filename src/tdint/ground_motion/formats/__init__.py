"""Text formats of strong-motion networks, as ObsPy plugins: one module per format, two functions
each.

`is_<format>(file)` tells from the first bytes whether a file is of the format; it never raises and
leaves a file object where it was. `read_<format>(file, headonly=False)` returns an obspy Stream of
accelerations in the file's own units, which stand in `stats.tdint_units` as text for
`tdint.units.parse_units` (empty if the file does not tell them). It raises RecordError for whatever
cannot be read to the last sample. The entry points in pyproject.toml make the formats known to
`obspy.read`.
"""
