"""Questions about the rows of an inventory: numbers of stories, heights, periods and drifts that
are unusual for the building type."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial

from tdint.errors import ModelFault
from tdint.model.building_rules import RULES
from tdint.model.capacity import CapacityFacts
from tdint.model.mdof_lu import USUAL_STORIES, BuildingFacts, DerivedBuilding
from tdint.model.plausibility import HEIGHT, ULTIMATE_DRIFT, YIELD_DRIFT, period_range
from tdint.studies.regions.inventory import INDIVIDUAL_COLUMNS, InventoryRow, InventoryRows

_MAX_LISTED = 10
"""Maximum number of rows that are listed, because a wrong unit makes every row unusual."""

Question = tuple[str, str]
"""Name of a column, and what is unusual about its cell."""


def unusual_rows(rows: InventoryRows, rules: str) -> list[str]:
    """Return warnings about the unusual rows of an inventory, with file, line and column.

    The first ten rows are listed, and the remaining rows are counted. Random factors on stiffness
    and damping, and the changes of a sweep, are not considered.

    Parameters
    ----------
    rules : str
        Name of the rules that derive the buildings.
    """
    table = rows.table
    # Rows with equal cells in the columns that define a building are derived one time.
    names = [name for name in table.column_indices if name not in INDIVIDUAL_COLUMNS]
    # The rules derive period and drifts independently of the height, so that one building is
    # derived for all heights.
    properties = cache(partial(_properties, rules))
    questions: dict[tuple[str, ...], Sequence[Question]] = {}
    unusual: list[ModelFault] = []
    cells_of_rows = zip(*(rows.texts(name) for name in names), strict=True)
    for number, cells in enumerate(cells_of_rows):
        if cells not in questions:
            questions[cells] = _questions(rows.make(number * len(rows.changes)), properties)
        unusual += [
            table.fault(int(rows.indices[number]), table.column_indices[name], name, text)
            for name, text in questions[cells]
        ]
    warnings = list(map(str, unusual[:_MAX_LISTED]))
    if len(unusual) > _MAX_LISTED:
        omitted = len(unusual) - _MAX_LISTED
        warnings.append(
            f"{table.table.source}: {omitted} more unusual values, {len(unusual)} in total"
        )
    return warnings


def _questions(row: InventoryRow, properties: Callable[..., _Properties]) -> Sequence[Question]:
    """Return the questions about a row. An unusual number of stories or an unusual height is the
    cause of other unusual values, which are then not reported."""
    facts = row.facts
    if isinstance(facts, BuildingFacts) and facts.structure in USUAL_STORIES:
        low, high = USUAL_STORIES[facts.structure]
        if not low <= facts.stories <= high:
            usual = f"{low} to {high} stories" if high > low else "one story"
            return [
                (
                    "NumberOfStories",
                    f"{facts.stories} stories are unusual for {facts.structure}, which has "
                    f"{usual}; check the number of stories and the type",
                )
            ]
    period, height, yield_drift, ultimate_drift = properties(replace(facts, height=None))
    if facts.height is not None:
        height = facts.height / facts.stories
    if not HEIGHT.contains(height):
        return [("height", HEIGHT.warning(HEIGHT.text(height)))]
    usual_period = period_range(facts.stories, facts.stories * height)
    checked = (
        ("NumberOfStories", usual_period, period),
        ("NumberOfStories", YIELD_DRIFT, yield_drift / height),
        ("NumberOfStories", ULTIMATE_DRIFT, ultimate_drift / height),
    )
    return [
        (name, usual_range.warning(usual_range.text(value)))
        for name, usual_range, value in checked
        if not usual_range.contains(value)
    ]


_Properties = tuple[float, float, float, float]
"""Period, s, and story height of the rules, largest yield drift and largest ultimate drift, m."""


def _properties(rules: str, facts: BuildingFacts | CapacityFacts) -> _Properties:
    """Return the properties of the building that the rules derive from facts without a height."""
    derived = RULES[rules](facts, None)
    drifts = (
        (derived.yield_drift, derived.ultimate_drift)
        if isinstance(derived, DerivedBuilding)
        else (derived.drifts[:, 0], derived.drifts[:, -1])
    )
    yield_drift, ultimate_drift = (float(drift.max()) for drift in drifts)
    return derived.period, float(derived.height[0]), yield_drift, ultimate_drift
