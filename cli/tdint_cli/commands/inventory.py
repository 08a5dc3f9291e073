"""`tdint inventory`: shear buildings by rules from a table of buildings."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tdint.errors import ModelError, UsageError
from tdint.files import check_outputs, write_files
from tdint.units import LENGTH
from tdint_cli import options
from tdint_cli.options.grammar import FileName
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import say

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tdint.model.inventory import InventoryBuilding

RULES = ("mdof-lu", "capacity")
_SHOWN = 10
"""Faults of a table that are shown; of more their number."""

_FILE_NAME = re.compile(r"[\w][\w .+-]{0,120}")


_MODELS = options.output.option(
    "--models",
    type=FileName(folder=True, written=True),
    metavar="DIR",
    help="Also write a model file ID.yaml of each building, as `tdint run` takes it, into this "
    "folder.",
)


@options.request
class Request:
    """The command line of `tdint inventory`."""

    models: str | None
    outputs: Outputs
    buildings: str = options.argument("BUILDINGS.csv", type=FileName())
    units: str = options.option(
        type=click.Choice(["ft", "m"]),
        required=True,
        help="Unit of the file's lengths; plan areas are in its square. It must be said: ft in "
        "SimCenter's files.",
    )
    rules: str = options.option(
        type=click.Choice(RULES),
        default=RULES[0],
        help="Rules of the buildings; mdof-lu by default.",
    )
    classes: str | None = options.option(
        type=FileName(),
        needs="--rules capacity",
        help="Classes of the rules capacity: CSV with the columns class, sd_m and sa_g, two to "
        "four rows for each, and, if they are wanted, soft_story and degradation (true or false).",
    )
    mapping: str | None = options.option(
        type=FileName(),
        metavar="FILE.csv",
        help="Read an exposure model of OpenQuake (NRML, or CSV files that it names); FILE.csv has "
        "a row per taxonomy with the column taxonomy and the columns that the rules need, such as "
        "class and NumberOfStories.",
    )
    damping: str = options.option(
        type=click.Choice(["full", "mass-only"]),
        default="full",
        help="full by default; mass-only leaves out the stiffness-proportional part, as programs "
        "do that lose it.",
    )


@options.command(
    "inventory",
    "tdint inventory buildings.csv --units ft -o stories.csv",
    "tdint inventory buildings.csv --units ft --models models",
    exits={3: "a row cannot be used; the others are done"},
)
@options.output.to_files(more=[_MODELS])
@options.of(Request)
def command(request: Request) -> None:
    """Generate shear buildings from a table of buildings (an inventory).

    BUILDINGS.csv has a row per building, and the table has a row per story. The columns are id,
    NumberOfStories, YearBuilt, StructureType (W1 W2 S1-S5 C1-C3 PC1 PC2 RM1 RM2 URM MH) and
    PlanArea (of one floor); optional are height (of the whole building), seismicZone (Z4 by
    default), DampingRatio and DesignLevel; other columns are not read; - is standard input. The
    rules mdof-lu are those of Lu et al. (2014, 2020) with the building types of Hazus: trilinear
    stories that pinch. CSV, one row per story.

    With --rules capacity a building has the columns id, class and NumberOfStories, optional height,
    mass_kg (of all floors; 1000 by default) and DampingRatio: its stories follow from the capacity
    curve of its class as in GEM's vulnerability toolkit (oq-vmtk), with the period of the curve.

    With --mapping FILE.csv, BUILDINGS is an exposure model of OpenQuake: id, place, number and
    structural cost are those of its assets.

    Rows that cannot be used are told together, the others are done, and the exit code is 3.
    """
    from tdint.model.capacity import read_classes
    from tdint.model.inventory import CAPACITY, derive_all, read_inventory
    from tdint.output.tables import buildings as columns
    from tdint.output.tables.table import Table

    rules = request.rules
    if (rules == CAPACITY) != (request.classes is not None):
        raise UsageError(
            f"the rules {CAPACITY} need --classes FILE, the capacity curves of the classes"
        )
    classes = read_classes(request.classes) if request.classes else None
    rows, faults = read_inventory(
        request.buildings,
        LENGTH[request.units],
        mass_only=request.damping == "mass-only",
        classes=classes,
        mapping=request.mapping,
    )
    derived = derive_all(rows, rules)
    files = _model_files(derived, rules, request.models) if request.models else {}
    # Model files are checked with the table's, before either is written.
    if files:
        check_outputs([*files, *request.outputs.files], overwrite=request.outputs.overwrite)
        write_files(files, overwrite=request.outputs.overwrite)
    request.outputs.deliver(
        Table.of_results(columns.INVENTORY if classes is None else columns.OF_CLASSES, derived)
    )
    say(
        f"{len(derived)} of {len(derived) + len({fault.line for fault in faults})} buildings by "
        f"the rules {rules}."
    )
    # A column that is wrong throughout has as many faults as rows.
    if len(faults) > _SHOWN:
        more = f"{request.buildings}: and {len(faults) - _SHOWN} more faults, {len(faults)} in all"
        raise ModelError("\n".join([*map(str, faults[:_SHOWN]), more]))
    if faults:
        raise ModelError(faults)


def _model_files(
    derived: Sequence[InventoryBuilding], rules: str, folder: str
) -> dict[Path, bytes]:
    """The model files.

    Raises
    ------
    UsageError
        An id that is no file name.
    """
    from tdint.model.inventory import model_text

    files: dict[Path, bytes] = {}
    for building in derived:
        name = building.row.id
        if not _FILE_NAME.fullmatch(name):
            raise UsageError(
                f"the id {name!r} does not make a file name; --models needs ids of letters, "
                "digits, -, _ and ."
            )
        files[Path(folder) / f"{name}.yaml"] = model_text(name, building.building, rules).encode()
    return files
