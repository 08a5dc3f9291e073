"""Tables of matched ground motions."""

from __future__ import annotations

from collections.abc import Sequence

from tdint.output.tables.spectra import MATCHED, SPECTRUM, record_table
from tdint.output.tables.table import Table
from tdint.studies.motions.matching import Match


def match_table(matches: Sequence[Match]) -> Table:
    """Return the table of spectral matches: misfits and intensity measures of the matched ground
    motions.

    It has a row per component and damping ratio. There is a column with the damping ratio if the
    ground motions were matched at several ratios.
    """
    # A match has a result for each damping ratio, which has one result per component.
    results = [
        component
        for matched in matches
        for at_damping in matched.by_damping
        for component in at_damping.parts
    ]
    has_several_dampings = any(matched.further for matched in matches)
    damping_column = SPECTRUM[:1] if has_several_dampings else ()
    return record_table((*damping_column, *MATCHED), results)
