"""Chapter of the load cases of a campaign in its report."""

from __future__ import annotations

from functools import partial

from tdint.output import figures
from tdint.output.page import Chapter, Part, Picture
from tdint.output.tables.loads import LOAD_COLUMNS
from tdint.output.tables.table import Table, rows_of
from tdint.response.runs.load_case import LoadCase
from tdint.studies.campaign.plan import Plan
from tdint.units import OutputUnits

_MAX_PICTURES = 6
"""Maximum number of load cases with a figure."""


def load_case_chapter(plan: Plan, units: OutputUnits) -> Chapter | None:
    """Return the chapter of the load cases of a campaign, with the forces on the first building;
    None if the campaign has records instead."""
    load_cases = [motion.record for motion in plan.motions if isinstance(motion.record, LoadCase)]
    if not load_cases:
        return None
    building = plan.buildings[0].subject().model
    loaded = [load_case.on(building) for load_case in load_cases]
    rows = [
        row
        for model in loaded
        for force in model.excitation.tables
        for row in rows_of(LOAD_COLUMNS, force)
    ]
    parts: list[Part] = [
        f"Each load case is a file of forces on floors; the ground is at rest. Forces on "
        f"{building.name}, without the scale factors of the runs:",
        Table.of(LOAD_COLUMNS, rows).in_units(units),
    ]
    for load_case, model in list(zip(load_cases, loaded, strict=True))[:_MAX_PICTURES]:
        end = plan.settings.duration or building.analysis.duration or load_case.duration
        parts.append(
            Picture(
                partial(figures.loads.load_picture, model, end, units),
                f"{load_case.source}: forces on floors over time",
            )
        )
    return Chapter("Load cases", parts)
