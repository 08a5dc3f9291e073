"""Text formats of strong-motion networks, as ObsPy plugins: one module per format, with two
functions.

`is_<format>(file)` returns True if the first bytes of a file identify the format. It never raises
an exception and keeps the position of a file object. `read_<format>(file, headonly=False)` returns
an obspy Stream of accelerations in the units of the file. `stats.tdint_units` contains these units
as text for `tdint.units.parse_units`; the text is empty if the file does not state its units. The
function raises RecordError if it cannot read all samples. The entry points in pyproject.toml
register the formats with `obspy.read`.
"""
