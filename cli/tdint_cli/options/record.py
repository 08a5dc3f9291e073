"""Options under the heading Record: what a ground motion is, and what is done to it before it is
used."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import click

from tdint.written_numbers import first_few
from tdint_cli.options import grammar
from tdint_cli.options.grammar import FileName, Function, ListOf, Nonzero, Number, SampleUnitsType

if TYPE_CHECKING:
    from tdint.ground_motion.choice import Processing, RecordChoice, TextLayout
    from tdint.ground_motion.reading.sample_units import SampleUnits
    from tdint.ground_motion.record import Record

option = partial(grammar.option, heading=grammar.RECORD)
_rare = partial(option, rare=True)


@dataclass(frozen=True)
class RecordRequest:
    """How the records of a command line are read, and what is done to them."""

    units: SampleUnits | None
    component: str | None
    inventory: str | None
    layout: TextLayout
    processing: Processing

    @property
    def choice(self) -> RecordChoice:
        """The same for a suite of motions."""
        from tdint.ground_motion.choice import RecordChoice

        return RecordChoice(
            self.units, self.component, self.inventory, self.processing, self.layout
        )

    def read(self, file: str) -> list[Record]:
        """The components of a file.

        Raises
        ------
        RecordError
            The file cannot be read, or changed as asked for.
        """
        from tdint.ground_motion.reading.suites import read_chosen

        return read_chosen(file, self.choice)


@dataclass(frozen=True)
class RecordsRequest(RecordRequest):
    """What the command lines have in common that take records as their arguments."""

    records: tuple[str, ...]


def _units() -> list[str]:
    from tdint.units import GROUND_MOTION

    return [unit for units in GROUND_MOTION.values() for unit in units]


records = click.argument("records", metavar="RECORD...", nargs=-1, required=True, type=FileName())
records_if_any = click.argument("records", metavar="[RECORD]...", nargs=-1, type=FileName())
record = _rare(
    "--record",
    type=FileName(),
    help="Ground motion in place of the model's; nothing that the model says of its own applies "
    "to it.",
)
units = option(
    "--units",
    type=SampleUnitsType(_units),
    metavar="UNITS",
    help="Units of the samples, or by file AT2=g,*.mseed=m/s^2; of all: m/s^2, cm/s^2, gal, "
    "mm/s^2, g, in/s^2 or ft/s^2, with a factor the value of one count ('2.38e-6 m/s^2'), of a "
    "velocity or a displacement (cm/s, cm), which is then differentiated. By file: a format or the "
    "end of a path each, or a table (.csv) with the columns record and units; the first that fits "
    "counts.",
)
component = option(
    "--component",
    metavar="NAME",
    help="Component of the record: its channel code (HNE), full id, or the code's last letter (E).",
)
inventory = _rare(
    "--inventory",
    type=FileName(),
    help="StationXML file by which the instrument's response is removed, where neither the file "
    "nor --units says what the samples are.",
)
_factor = partial(
    option, "--scale", metavar="FACTOR", help="Factor on the ground acceleration, not zero."
)
scale = _factor(type=ListOf(Nonzero(), once=False))
one_scale = _factor(type=Nonzero(), needs="RECORD")

_LAYOUT = (
    _rare(
        "--step",
        type=Number(0.0, min_open=True),
        metavar="SECONDS",
        help="Sampling interval of a text table that does not tell it; a file that does must "
        "agree.",
    ),
    _rare(
        "--column",
        type=ListOf(click.STRING),
        metavar="N|NAME,...",
        help="Columns of a text table, by number, counted from 1, or name; by default those whose "
        "names are those of accelerations, else all but the time.",
    ),
    _rare(
        "--skip-lines",
        type=click.IntRange(0, 1_000_000),
        metavar="N",
        help="Pass over so many lines at the beginning of a text table.",
    ),
)

_PROCESSING = (
    _rare(
        "--trim",
        metavar="START:END",
        help="Keep this part of the record, seconds from its first sample; an end may be left out.",
    ),
    _rare(
        "--baseline",
        type=click.Choice(["constant", "linear"]),
        help="Remove the mean, or the least-squares line, of the acceleration.",
    ),
    _rare("--pad", metavar="SECONDS|BEFORE:AFTER", help="Add zeros before and after the record."),
    option(
        "--highpass",
        type=Number(0.0, min_open=True),
        metavar="HZ",
        help="Butterworth filter without shift of phase (forwards and backwards: half the "
        "amplitude at the corner).",
    ),
    _rare(
        "--lowpass",
        type=Number(0.0, min_open=True),
        metavar="HZ",
        help="The same from the other side.",
    ),
    _rare(
        "--filter-order",
        type=click.IntRange(1, 10),
        metavar="N",
        help="Order of the filters; 4 by default.",
    ),
    _rare(
        "--resample",
        type=Number(0.0, min_open=True),
        metavar="DT",
        help="Change the sampling interval, s: band-limited, with a filter against aliasing if it "
        "becomes longer.",
    ),
)


NAMES = frozenset(("units", "component", "inventory")) | {
    flag.removeprefix("--").replace("-", "_")
    for declared in (*_LAYOUT, *_PROCESSING)
    for flag in declared.names
}
"""The parameters by which a record is read and changed, but for its scale."""


def _read_and_changed(command: Function) -> Function:
    """The command gets what a text table does not tell together as `layout`, and what changes a
    record as `processing`.

    The steps are taken in the order of the options, whatever that of the command line.
    """

    @functools.wraps(command)
    def collected(**given: Any) -> Any:
        from tdint.ground_motion.choice import Processing, TextLayout, parse_pad, parse_trim

        layout, steps = (
            {field.name: given.pop(field.name) for field in dataclasses.fields(kind)}
            for kind in (TextLayout, Processing)
        )
        for name, parse in (("trim", parse_trim), ("pad", parse_pad)):
            if steps[name] is not None:
                steps[name] = parse(steps[name])
        layout["column"] = layout["column"] or ()
        return command(**given, layout=TextLayout(**layout), processing=Processing(**steps))

    return cast(Function, collected)


_READ = (units, component, *_LAYOUT, inventory)
_CHANGED = (*_PROCESSING, _read_and_changed)

of_records = grammar.together(records, *_READ, *_CHANGED)
"""All that command lines with records as arguments have in common, for a RecordsRequest."""

of_records_if_any = grammar.together(records_if_any, *_READ, *_CHANGED)
"""The same, where there need be none."""

of_motion = grammar.together(*_READ, scale, *_CHANGED)
"""The options of a single record but --record, in place of a model's or beside it, for a
BuildingRequest."""

of_record = grammar.together(record, of_motion)
"""The same with --record."""


def warnings_of_suite(records: Sequence[Record]) -> list[str]:
    """What was assumed of records and changes what their numbers mean: a line for each kind, with
    the first names."""
    # Texts of one kind begin with the same words, and differ in a number.
    kinds: dict[str, tuple[str, dict[str, None]]] = {}
    for record in records:
        for text in record.warnings:
            _, names = kinds.setdefault(" ".join(text.split()[:3]), (text, {}))
            names[f"{record.source} {record.component}".rstrip()] = None
    return [f"{first_few(list(names), 3)}: {text}" for text, names in kinds.values()]


def notes_of_components(
    records: Sequence[Record], notes_of: Callable[[Record], Sequence[str]]
) -> tuple[str, ...]:
    """Notes about the components of one file, with its name; what holds for all of them is said
    once."""
    notes: dict[str, None] = {}  # a set in the order of arrival
    for record in records:
        for note in notes_of(record):
            common = all(note in notes_of(other) for other in records)
            whose = record.source if common else f"{record.source}: {record.component or record.id}"
            notes[f"{whose}: {note}"] = None
    return tuple(notes)
