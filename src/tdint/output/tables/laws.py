"""Table of the hysteretic laws of stories with the keys of their parameters."""

from __future__ import annotations

from collections.abc import Sequence

from tdint.kernels.laws.law import LawParameter
from tdint.model.config.stories import bounds_of
from tdint.model.story_laws import LAWS
from tdint.output.tables.columns import declared
from tdint.output.tables.table import Table
from tdint.units import compound_unit


def law_table() -> Table:
    """Return the table of the laws of tdint and of plug-ins, with a row for each key."""
    return Table.of(
        declared("laws.law"),
        [
            (law.name, *cells, law.formula)
            for law in LAWS.values()
            for cells in map(_cells, law.parameters or (None,))
        ],
    )


def _cells(parameter: LawParameter | None) -> Sequence[str]:
    """Return key, unit, allowed values and default of a parameter; empty for a law without keys."""
    if parameter is None:
        return ("",) * 4
    unit = compound_unit("N", "m", parameter.force, parameter.length)
    values = " | ".join(parameter.choices) or str(bounds_of(parameter))
    if parameter.points:
        unit, values = "m and N", f"{parameter.point_count_text} [drift, force]"
    elif parameter.many:
        unit, values = "N/m, N/m^2, ...", "a list of numbers"
    default = parameter.default if parameter.without is None else "optional"
    text = default if isinstance(default, str) else "" if default is None else f"{default:g}"
    return parameter.path, unit, values, text
