"""Load cases of a campaign: the key `forces` with one file of forces on floors per load case."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tdint.errors import ModelError, RecordError, TdintError
from tdint.ground_motion.reading.suites import SuiteMotion
from tdint.model.definition import Model
from tdint.model.keys.fields import (
    ANY,
    ROOF,
    Choice,
    Either,
    EntriesOf,
    Integer,
    Key,
    Keys,
    NamedEntries,
    TextLine,
    Value,
)
from tdint.model.story import MAX_STORIES
from tdint.number_parsing import pluralize
from tdint.response.runs.load_case import LoadCase
from tdint.studies.campaign.assigned_motions import CampaignMotions
from tdint.studies.regions.inventory import InventoryRows
from tdint.units import FORCE

LOAD_CASES = Keys(
    (
        Key(
            "files",
            EntriesOf(TextLine(), least=1),
            "CSV files with times and forces, one load case per file, relative to this file",
            needed=True,
        ),
        Key(
            "floors",
            NamedEntries(TextLine(), description="a mapping of floors to columns"),
            "column of each floor, with an optional factor: {roof: top_kN, 1: 0.6 top_kN}",
        ),
        Key(
            "floor",
            Either((Integer(1, MAX_STORIES), Choice((ROOF,)))),
            "floor, from 1 at the bottom, or roof, instead of floors",
        ),
        Key("column", TextLine(), "column of this floor; default: the only column of forces"),
        Key("start", ANY, "added to the times, s; default: 0"),
        Key("scale", ANY, "factor on the forces; default: 1"),
    )
)
"""Keys of `forces` of a campaign; their names are those of `excitation.forces` of a model."""


@dataclass(frozen=True)
class LoadFiles:
    """Load cases in files.

    Attributes
    ----------
    files : tuple of str
        CSV files, one per load case.
    columns : tuple of (int, str)
        Floor and column of each force. The floor 0 is the roof of each building; an empty column is
        the only column of forces.
    scale, start : float
        Factor on the values, and time that is added to the times (s).
    """

    files: tuple[str, ...]
    columns: tuple[tuple[int, str], ...]
    scale: float = 1.0
    start: float = 0.0


def read_requested_load_cases(value: Value) -> LoadFiles | None:
    """Return the load cases that the campaign file requests; None if a required value is missing or
    invalid. Errors are recorded in the document."""
    section = value.section()
    if section is None:
        return None
    section.need("files", "give a list of CSV files, one load case each")
    paths = section.files("files", "a list of CSV files", "is empty; give at least one file")
    # Imported here, because only campaigns of load cases read tables of forces.
    from tdint.model.config.load_tables import read_requests

    # The number of stories is not known, and the roof is floor 0.
    requests = read_requests(section, section.value, None, scale=1.0, start=0.0)
    columns = tuple((item.floor, item.column) for item in requests)
    scale, start = section.number("scale", default=1.0), section.number("start", default=0.0)
    return LoadFiles(paths, columns, scale, start)


def read_load_cases(
    requested: LoadFiles, models: Sequence[Model], rows: InventoryRows | None, source: str
) -> CampaignMotions:
    """Read the files of load cases.

    Returns
    -------
    CampaignMotions
        One motion per file, and the errors of files that cannot be used.

    Raises
    ------
    ModelError
        A building does not have a floor that is loaded.
    RecordError
        No file can be used; the message has one line per reason.
    """
    # Imported here, because only campaigns of load cases read tables of forces.
    from tdint.model.config.load_tables import read_load_file

    highest = max(floor for floor, _ in requested.columns)
    heights = [(model.name, len(model.stories)) for model in models]
    if rows is not None:
        lowest = int(rows.stories.argmin())
        heights.append((rows[lowest].id, int(rows.stories[lowest])))
    for name, count in heights:
        if highest > count:
            raise ModelError(
                f"{source}: forces: floor {highest} does not exist in {name}, which has "
                f"{pluralize(count, 'floor')}; remove the floor, or use {ROOF} for the highest "
                "floor of each building"
            )
    # Columns without a unit have the unit of force of all models; a text is the reason why the
    # columns require a unit.
    unit: float | str = "the buildings of an inventory have no unit of force"
    if models:
        first, *others = sorted({model.force_unit for model in models})
        unit = FORCE[first]
        if others:
            unit = f"the models have different units of force: {', '.join([first, *others])}"
    motions, failures = list[SuiteMotion](), list[TdintError]()
    for file in requested.files:
        try:
            loads = read_load_file(file, requested.columns, requested.scale, requested.start, unit)
        except ModelError as error:
            failures.append(RecordError(str(error)))
            continue
        load_case = LoadCase.of(loads)
        motions.append(SuiteMotion(load_case, file, "", load_case))
    if not motions:
        raise RecordError("\n".join(map(str, failures)))
    return CampaignMotions(tuple(motions), tuple(failures))
