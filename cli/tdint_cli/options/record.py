"""Options under the heading Record: how a record is read and processed before it is used."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import click

from tdint.errors import UsageError
from tdint.number_parsing import abbreviate
from tdint.tabular import on_use
from tdint_cli.options import grammar, option_types

if TYPE_CHECKING:
    from tdint.ground_motion.choice import RecordChoice
    from tdint.ground_motion.record import Record

_SETTINGS = ("units", "component", "inventory", "layout", "processing", "described")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RecordRequest:
    """Common part of the command lines with options of records.

    Attributes
    ----------
    choice : RecordChoice
        Options for reading and processing the records, and the options in their descriptions.
    """

    choice: RecordChoice

    @property
    def record_settings(self) -> dict[str, Any]:
        """The options of the records for JSON files, in the order of the help."""
        settings = asdict(self.choice)
        return {name: settings[name] for name in _SETTINGS}

    def read(self, file: str) -> list[Record]:
        """Return the components of a file.

        Raises
        ------
        RecordError
            The file cannot be read, or cannot be processed as requested.
        """
        from tdint.ground_motion.reading.suites import read_chosen

        return read_chosen(file, self.choice)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RecordsRequest(RecordRequest):
    """Common options of the commands that accept records as arguments."""

    records: tuple[str, ...]


def _units() -> list[str]:
    """Return the units of ground motions, for the completion of --units."""
    from tdint.units import GROUND_MOTION

    return [unit for units in GROUND_MOTION.values() for unit in units]


# A unit for all records, or units by file (`AT2=g,*.mseed=m/s^2` or the name of a table, which is
# read)
_sample_units = on_use("tdint.ground_motion.reading.sample_units").units_of_text


records = click.argument(
    "records", metavar="RECORD...", nargs=-1, required=True, type=option_types.FileName()
)
records_if_any = click.argument(
    "records", metavar="[RECORD]...", nargs=-1, type=option_types.FileName()
)
record = grammar.option("--record")
units = grammar.option("--units", type=option_types.Written("name", _sample_units, _units))
component = grammar.option("--component")
inventory = grammar.option("--inventory")
scale = grammar.option("--scale", type=option_types.ListOf(option_types.Nonzero(), once=False))
one_scale = grammar.option("--scale")

_LAYOUT = (
    grammar.option("--step"),
    grammar.option("--column"),
    grammar.option("--skip-lines", type=click.IntRange(0, 1_000_000)),
    grammar.option("--rows", is_flag=True),
    grammar.option("--one-sided", is_flag=True),
)

_PROCESSING = (
    grammar.option("--trim"),
    grammar.option("--baseline"),
    grammar.option("--pad"),
    grammar.option("--highpass"),
    grammar.option("--lowpass"),
    grammar.option("--filter-order", type=click.IntRange(1, 10)),
    grammar.option("--resample"),
    grammar.option("--time-scale"),
)


_DESCRIPTION_SUFFIXES = (".yaml", ".yml")


def _with_choice(values: dict[str, Any]) -> dict[str, Any]:
    """Replace the options of the records by the argument `choice`, and the descriptions of records
    (YAML) by their files.

    The processing steps follow the order of the options in the help, regardless of their order on
    the command line.
    """
    from tdint.ground_motion.choice import (
        Processing,
        RecordChoice,
        TextLayout,
        parse_pad,
        parse_trim,
    )

    # Some commands have no options of the layout and of the processing.
    layout, steps = (
        {field.name: values.pop(field.name, field.default) for field in fields(part)}
        for part in (TextLayout, Processing)
    )
    for name, parse in (("trim", parse_trim), ("pad", parse_pad)):
        if steps[name] is not None:
            steps[name] = parse(steps[name])
    layout["column"] = layout["column"] or ()
    choice = RecordChoice(
        values.pop("units"),
        values.pop("component"),
        values.pop("inventory"),
        Processing(**steps),
        TextLayout(**layout),
    )
    records = values.get("records") or filter(None, [values.get("record")])
    if any(name.lower().endswith(_DESCRIPTION_SUFFIXES) for name in records):
        values, choice = _with_described_files(values, choice)
    return {**values, "choice": choice}


def _with_described_files(
    values: dict[str, Any], of_command: RecordChoice
) -> tuple[dict[str, Any], RecordChoice]:
    """Return the values of a command line with the files of the descriptions among its records, and
    its options of records, `of_command`, with the options in the descriptions.

    UsageError is raised if an option contradicts a description, or if a description of several
    records is given to a command that accepts one record.
    """
    from tdint.model.config.record_files import read_description

    described: list[tuple[str, RecordChoice]] = []

    def files_of(name: str) -> tuple[str, ...]:
        """Return the files of a description; the name itself of a record or a model."""
        is_description = name.lower().endswith(_DESCRIPTION_SUFFIXES)
        description = read_description(name) if is_description else None
        if description is None:
            return (name,)
        choice = _combined(of_command, description.choice, name)
        described.extend((file, choice) for file in description.files)
        if description.pairs and _has_wish_of_pairs() and not values.get("pairs"):
            values["pairs"] = option_types.PairWish(None, description.pairs)
        return description.files

    values = dict(values)
    if values.get("records"):
        values["records"] = tuple(file for name in values["records"] for file in files_of(name))
    if values.get("record"):
        files = files_of(values["record"])
        if len(files) != 1:
            raise UsageError(
                f"{values['record']} describes {len(files)} records, but --record accepts one"
            )
        (values["record"],) = files
    return values, replace(of_command, described=tuple(described))


def _has_wish_of_pairs() -> bool:
    """Return True if the value of the option --pairs of the running command is a `PairWish`."""
    parameters = click.get_current_context().command.params
    return any(item.name == "pairs" and item.type.name == option_types.PAIRS for item in parameters)


def _combined(of_command: RecordChoice, choice: RecordChoice, source: str) -> RecordChoice:
    """Return the options of a description with the options of the command line that it does not
    specify. UsageError is raised if both specify different values."""
    from tdint.model.config.record_files import stated_settings

    stated = stated_settings(choice)
    for name, value in stated_settings(of_command).items():
        if name in stated and stated[name] != value:
            raise UsageError(
                f"--{name.replace('_', '-')} {value} contradicts `{name}: {stated[name]}` in "
                f"{source}; omit the option, or change the file"
            )
    return of_command.over(choice)


_READING = (units, component, *_LAYOUT, inventory)
_CHOICE = grammar.adapted(_with_choice)
_PROCESSED = (*_PROCESSING, _CHOICE)

record_options = grammar.together(records, *_READING, *_PROCESSED)
"""Common options of commands with records as arguments, for a RecordsRequest."""

_PLAIN = (units, component, inventory, _CHOICE)

plain_record_options = grammar.together(records, *_PLAIN)
"""The same options without layout and processing, which a description of records specifies."""

optional_plain_record_options = grammar.together(records_if_any, *_PLAIN)
"""The same options for commands with optional records."""

optional_record_options = grammar.together(records_if_any, *_READING, *_PROCESSED)
"""The same options for commands with optional records."""

motion_options = grammar.together(*_READING, scale, *_PROCESSED)
"""Options of a single record except --record, for a BuildingRequest. The record replaces the record
of the model, or the options change it."""

single_record_options = grammar.together(record, motion_options)
"""The same options with --record."""


def warnings_of_suite(records: Sequence[Record]) -> list[str]:
    """Return the warnings about assumptions on records, combined to one line for each type.

    A line contains the names of the first three records with the warning, and the text of the
    first.
    """
    # Warnings of a single type start with the same three words and differ in a value. Each type is
    # mapped to its first text and to the names of its records (keys, as an ordered set).
    types: dict[str, tuple[str, dict[str, None]]] = {}
    for record in records:
        for text in record.warnings:
            _, names = types.setdefault(" ".join(text.split()[:3]), (text, {}))
            names[record.name] = None
    return [f"{abbreviate(list(names), 3)}: {text}" for text, names in types.values()]


def notes_of_components(
    records: Sequence[Record], notes_of: Callable[[Record], Sequence[str]]
) -> tuple[str, ...]:
    """Return the notes about the components of one file, each with the name of the file.

    A note that applies to all components is included only one time, without a component.
    """
    from tdint.ground_motion.record import component_names

    notes: dict[str, None] = {}  # an ordered set
    for record, component in zip(records, component_names(records), strict=True):
        for note in notes_of(record):
            is_common = all(note in notes_of(other) for other in records)
            name = record.source
            if not is_common:
                name += f": {component or record.id}"
            notes[f"{name}: {note}"] = None
    return tuple(notes)
