"""`tdint inventory`: shear buildings by rules from a table of buildings."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tdint.errors import ModelError, UsageError
from tdint.files import check_outputs
from tdint.units import LENGTH
from tdint_cli import options
from tdint_cli.options.option_types import FileName
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import say, warn

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tdint.studies.regions.inventory import InventoryBuilding

RULES = ("mdof-lu", "capacity")

_FILE_NAME = re.compile(r"[\w][\w .+-]{0,120}")


_MODELS = options.output.option(
    "--models",
    type=FileName(folder=True, written=True),
    metavar="DIR",
    help="Also write a model file ID.yaml for each building to this directory, for `tdint run`.",
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
        help="Unit of lengths in the file; areas are in the square of this unit. It has no "
        "default; files of SimCenter use ft.",
    )
    rules: str = options.option(
        type=click.Choice(RULES),
        default=RULES[0],
        help="Rules that generate the buildings; mdof-lu by default.",
    )
    classes: str | None = options.option(
        type=FileName(),
        needs="--rules capacity",
        help="Capacity curves of the building classes, for --rules capacity: CSV with the "
        "columns class, sd_m and sa_g, two to four rows per class, and optionally soft_story "
        "and degradation (true or false).",
    )
    mapping: str | None = options.option(
        type=FileName(),
        metavar="FILE.csv",
        help="Read BUILDINGS as an exposure model of OpenQuake (NRML, or CSV files that it "
        "names). FILE.csv has one row per taxonomy: the column taxonomy, and the columns that "
        "the rules require, such as class and NumberOfStories.",
    )
    damping: str = options.option(
        type=click.Choice(["full", "mass-only"]),
        default="full",
        help="Damping: full (default), or mass-only, which omits the part proportional to "
        "stiffness. mass-only reproduces programs that lose this part.",
    )


@options.command(
    "inventory",
    "tdint inventory buildings.csv --units ft -o stories.csv",
    "tdint inventory buildings.csv --units ft --models models",
    exits={3: "a row cannot be used; the other rows are processed"},
)
@options.output.to_files(more=[_MODELS])
@options.of(Request)
def command(request: Request) -> None:
    """Generate shear buildings from a table of buildings (an inventory).

    BUILDINGS.csv (- is standard input) has a row per building; the output, a CSV table, has one
    row per story. Required columns are id, NumberOfStories, YearBuilt, StructureType (W1 W2 S1-S5
    C1-C3 PC1 PC2 RM1 RM2 URM MH) and PlanArea (of one floor). Optional columns are height (of the
    building), seismicZone (Z4 by default), DampingRatio and DesignLevel. Other columns are ignored.
    The rules mdof-lu were published by Lu et al. (2014, 2020) for the building types of Hazus; the
    stories are trilinear with pinching.

    With --rules capacity, the required columns are id, class and NumberOfStories; optional columns
    are height, mass_kg (of all floors; 1000 by default) and DampingRatio. The stories are derived
    from the capacity curve of the class as in GEM's vulnerability toolkit (oq-vmtk). The building
    has the period of this curve.

    With --mapping FILE.csv, BUILDINGS is an exposure model of OpenQuake. Ids, coordinates, numbers
    of buildings and structural costs are read from its assets.

    If rows cannot be used, their errors are listed (the first ten), the other rows are processed,
    and the exit code is 3.
    """
    from tdint.model.building_rules import CAPACITY
    from tdint.model.capacity import read_classes
    from tdint.output.tables import buildings as columns
    from tdint.output.tables.table import Table
    from tdint.studies.regions.inventory import derive_all, read_inventory, unusual_rows

    rules = request.rules
    if (rules == CAPACITY) != (request.classes is not None):
        raise UsageError(
            f"--rules {CAPACITY} and --classes FILE (the capacity curves of the building "
            "classes) must be used together"
        )
    classes = read_classes(request.classes) if request.classes else None
    rows, errors = read_inventory(
        request.buildings,
        LENGTH[request.units],
        mass_only=request.damping == "mass-only",
        classes=classes,
        mapping=request.mapping,
    )
    derived = derive_all(rows, rules)
    warn(*unusual_rows(rows, rules))
    files = _model_files(derived, rules, request.models) if request.models else {}
    # Check all output files before the first of them is written.
    if files:
        check_outputs([*files, *request.outputs.files], overwrite=request.outputs.overwrite)
    request.outputs.deliver(
        Table.of_results(columns.INVENTORY if classes is None else columns.CLASS_COLUMNS, derived),
        more=files,
    )
    # One row of the table can have several errors, but it is one building.
    say(
        f"{len(derived)} of {len(derived) + len({error.line for error in errors})} buildings "
        f"generated by the rules {rules}."
    )
    if errors:
        raise ModelError(errors)


def _model_files(
    derived: Sequence[InventoryBuilding], rules: str, folder: str
) -> dict[Path, bytes]:
    """Return the paths and the contents (YAML) of the model files, ID.yaml for each building.
    UsageError is raised if an id cannot be used as a file name.
    """
    from tdint.studies.regions.inventory import model_text

    files: dict[Path, bytes] = {}
    for building in derived:
        name = building.row.id
        if not _FILE_NAME.fullmatch(name):
            raise UsageError(
                f"the id {name!r} cannot be used as a file name; with --models, ids must consist "
                "of letters, digits, spaces and the characters _ . + -, and begin with a letter, a "
                "digit or _"
            )
        files[Path(folder) / f"{name}.yaml"] = model_text(name, building.building, rules).encode()
    return files
