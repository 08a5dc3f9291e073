"""Suites of ground motions: files and directories specified by the user, and their horizontal
components, individually or in pairs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from pathlib import Path

from tdint.errors import RecordError, UsageError
from tdint.files import STDIN, is_file, is_folder, protect_input
from tdint.ground_motion.choice import RecordChoice, TextLayout
from tdint.ground_motion.horizontals import (
    USUAL,
    Horizontals,
    PairNames,
    files_of_motions,
    find_horizontals,
    is_vertical,
    told_once,
    with_component,
)
from tdint.ground_motion.processing_steps import processed
from tdint.ground_motion.reading.contents import is_record, record_formats
from tdint.ground_motion.reading.read import read_records
from tdint.ground_motion.reading.sample_units import file_units
from tdint.ground_motion.record import Record, component_names
from tdint.number_parsing import abbreviate

_MOST_NAMES = 10  # maximum number of names in a message


@dataclass(frozen=True)
class Sources:
    """Record files to read.

    Attributes
    ----------
    files : tuple of str
        Files in order; `-` is standard input.
    notes : tuple of str
        Notes about files in directories that were omitted.
    failures : tuple of RecordError
        Errors for directories without records.
    """

    files: tuple[str, ...]
    notes: tuple[str, ...]
    failures: tuple[RecordError, ...]


def records_of(arguments: Sequence[str], choice: RecordChoice) -> Sources:
    """Return the record files of the arguments; a directory is replaced by its records in order of
    name.

    Other content of a directory (hidden files, subdirectories, files of unknown format) is omitted.
    A file that cannot be read is kept, so that reading it reports the error. With a layout, more
    text tables are recognized as records.

    Parameters
    ----------
    arguments : sequence of str
        Names of files and directories; `-` is standard input.
    choice : RecordChoice
        Units and layout.

    Raises
    ------
    UsageError
        Standard input is specified more than once, or an entry of the units by file matches no
        file.
    """
    layout = choice.layout
    if arguments.count(STDIN) > 1:
        raise UsageError("standard input (-) can be read only once")
    files: list[str] = []
    notes: list[str] = []
    failures: list[RecordError] = []
    for argument in arguments:
        if argument == STDIN or not is_folder(argument):
            files.append(argument)
            continue
        try:
            inside, others = _contents(argument, layout)
        except RecordError as error:
            failures.append(error)
            continue
        files += inside
        for file in inside:
            protect_input(file)  # other processes may read it
        others = [
            name for name in others if name != "LICENSE"
        ]  # the license of the records is not reported
        if others:
            notes.append(f"{argument}: skipped (not records): {abbreviate(others, _MOST_NAMES)}")
    file_units(choice.units).refuse_unfit(files, partial(record_formats, layout=layout))
    return Sources(tuple(files), tuple(notes), tuple(failures))


def _contents(folder: str, layout: TextLayout) -> tuple[list[str], list[str]]:
    """Return the paths of the records in a directory and the names of its other visible content.

    Raises
    ------
    RecordError
        The directory cannot be read, or contains no record.
    """
    try:
        names = sorted(
            path.name for path in Path(folder).iterdir() if not path.name.startswith(".")
        )
    except OSError as error:
        raise RecordError(
            f"{folder}: the directory cannot be read: {error.strerror or error}"
        ) from error
    records, others = [], []
    for name in names:
        file = os.path.join(folder, name)  # noqa: PTH118  Path would shorten what the user wrote
        if is_folder(file):
            others.append(f"{name}/")
        elif is_file(file) and is_record(file, layout):  # A pipe is not read: it may never end.
            records.append(file)
        else:
            others.append(name)
    if not records:
        listed = abbreviate(others, _MOST_NAMES) or "nothing"
        raise RecordError(f"{folder}: no record found in this directory; it contains {listed}")
    return records, others


GroundMotion = Record | Horizontals
"""One component, or a pair of horizontal components."""


@dataclass(frozen=True)
class Suite:
    """Ground motions, in the order of their files.

    Attributes
    ----------
    motions : tuple of Record or of Horizontals
        Single components, or pairs.
    failures : tuple of RecordError
        Errors of files that could not be used.
    notes : tuple of str
        Notes about omitted files and assumptions.
    """

    motions: tuple[GroundMotion, ...]
    failures: tuple[RecordError, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def records(self) -> list[Record]:
        """All components in order."""
        return [record for motion in self.motions for record in components(motion)]


def components(motion: GroundMotion) -> tuple[Record, ...]:
    """Return the one or two components of a ground motion."""
    return (motion,) if isinstance(motion, Record) else (motion.first, motion.second)


def read_chosen(file: str, choice: RecordChoice) -> list[Record]:
    """Read the components of a file and apply the requested processing.

    Raises
    ------
    RecordError
        The file cannot be read, or a processing step cannot be applied.
    """
    return [processed(record, choice.processing) for record in read_records(file, **choice.reading)]


def read_suite(named: Sequence[str], choice: RecordChoice, pairs: PairNames | None = None) -> Suite:
    """Read a suite of ground motions from files and directories.

    Parameters
    ----------
    named : sequence of str
        Names of files and directories.
    choice : RecordChoice
        Reading options and processing.
    pairs : PairNames or None
        File names of pairs; None reads single horizontal components.

    Raises
    ------
    UsageError
        Raised by `records_of` and `read_pairs`.
    """
    sources = records_of(named, choice)
    suite = (
        read_pairs(sources.files, choice, pairs)
        if pairs
        else read_components(sources.files, choice)
    )
    again = _counted_twice(suite.records)
    return Suite(
        suite.motions, (*sources.failures, *suite.failures), (*sources.notes, *suite.notes, *again)
    )


def _counted_twice(records: Sequence[Record]) -> list[str]:
    """Return a warning if records have the same samples, for example a file and its directory, or a
    copy with another name."""
    first: dict[tuple[float, bytes], Record] = {}
    again = []
    for record in records:
        # Digests avoid a comparison of all pairs in a large suite.
        samples = record.dt, sha256(record.acceleration.tobytes()).digest()
        if (before := first.setdefault(samples, record)) is not record:
            again.append(f"{record.name} is {before.name}")
    if not again:
        return []
    return [
        "the same ground motion is included more than once in all means: "
        f"{abbreviate(again, _MOST_NAMES)}"
    ]


def read_components(files: Sequence[str], choice: RecordChoice) -> Suite:
    """Read the horizontal components of files individually; a component selected by name may also
    be vertical.

    A file that cannot be read is reported in the failures; the other files are still read.
    """
    records: list[GroundMotion] = []
    failures: list[RecordError] = []
    notes: list[str] = []
    for file in files:
        try:
            components = read_chosen(file, choice)
        except RecordError as error:
            failures.append(error)
            continue
        # A vertical component is omitted unless the user selects it.
        omitted = [
            component
            for component in components
            if choice.component is None and is_vertical(component.component)
        ]
        if omitted and len(omitted) == len(components):
            failures.append(
                RecordError(
                    f"{file}: no horizontal component found; select a component by name to use a "
                    "vertical one"
                )
            )
            continue
        if omitted:
            notes.append(
                f"{file}: vertical component omitted: "
                f"{', '.join(component.component for component in omitted)}"
            )
        records += [
            component
            for component in components
            if not any(component is other for other in omitted)
        ]
    return Suite(tuple(records), tuple(failures), tuple(notes))


def read_pairs(files: Sequence[str], choice: RecordChoice, names: PairNames = USUAL) -> Suite:
    """Read pairs of horizontal components from files with both components, or from files with names
    that differ only in the component.

    Parameters
    ----------
    files : sequence of str
        File names.
    choice : RecordChoice
        Reading options and processing.
    names : PairNames
        File names of pairs. Default: the usual names.

    Raises
    ------
    UsageError
        No file matches the names.
    """
    # Files are grouped by their names before they are read.
    groups, others = files_of_motions(files, names)
    pairs: list[GroundMotion] = []
    failures: list[RecordError] = []
    notes = (
        [f"omitted, named neither {names.first} nor {names.second}: {', '.join(others)}"]
        if others
        else []
    )
    for group in groups:
        # With the usual names, the files of a pair may differ in a direction in degrees.
        in_degrees = names == USUAL and len(group) == 2
        try:
            components = [
                with_component(record, in_degrees=in_degrees)
                for file in group
                for record in read_chosen(file, choice)
            ]
            pair: Horizontals = find_horizontals(components)
        except RecordError as error:
            failures.append(error)
            continue
        notes += [f"{pair.source}: {note}" for note in pair.notes]
        pairs.append(pair)
    return Suite(tuple(pairs), tuple(told_once(failures)), tuple(notes))


@dataclass(frozen=True)
class SuiteMotion:
    """Component of a ground motion in a suite.

    Attributes
    ----------
    record : Record
        Ground motion.
    name, component : str
        Names in tables.
    whole : Record or Horizontals
        The component, or its pair, which has a common scale factor.
    direction : int
        1, or 2 for the second component of a pair.
    """

    record: Record
    name: str
    component: str
    whole: GroundMotion
    direction: int = 1


def suite_motions(whole: Sequence[GroundMotion]) -> tuple[SuiteMotion, ...]:
    """Return the components of ground motions in order; components of one file with the same name
    are distinguished by their full ids."""
    motions = [(part, records) for part in whole for records in [components(part)]]
    names = iter(component_names([record for _, records in motions for record in records]))
    return tuple(
        SuiteMotion(record, record.source, next(names), motion, direction)
        for motion, records in motions
        for direction, record in enumerate(records, start=1)
    )
