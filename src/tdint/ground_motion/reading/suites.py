"""Suites of ground motions: the files that someone named, folders taken apart, and the horizontal
components in them, one by one or in pairs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from pathlib import Path

from tdint.errors import RecordError, UsageError
from tdint.files import STDIN, is_file, is_folder, keep_input
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
from tdint.ground_motion.reading.contents import formats_of, is_record
from tdint.ground_motion.reading.read import read_records
from tdint.ground_motion.reading.sample_units import file_units
from tdint.ground_motion.record import Record, component_names
from tdint.written_numbers import first_few

_MOST_NAMES = 10  # that a message names


@dataclass(frozen=True)
class Sources:
    """Records to be read.

    Attributes
    ----------
    files : tuple of str
        The files to read, in order; `-` is standard input.
    notes : tuple of str
        What was left out of folders, a sentence each.
    failures : tuple of RecordError
        Folders without records.
    """

    files: tuple[str, ...]
    notes: tuple[str, ...]
    failures: tuple[RecordError, ...]


def records_of(arguments: Sequence[str], choice: RecordChoice) -> Sources:
    """Files as they are given; of a folder the records in it, by name.

    What a folder holds besides (hidden files, folders, files of unknown format) is left out. A file
    that cannot be read stays, so that its failure is told. With a layout, text tables are records
    that would not be recognized without.

    Raises
    ------
    UsageError
        Standard input is given more than once; units by file of which an entry fits none of them.
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
            keep_input(file)  # which other processes may read
        others = [
            name for name in others if name != "LICENSE"
        ]  # of the records, which goes with them
        if others:
            notes.append(f"{argument}: not taken for records: {first_few(others, _MOST_NAMES)}")
    file_units(choice.units).refuse_unfit(files, partial(formats_of, layout=layout))
    return Sources(tuple(files), tuple(notes), tuple(failures))


def _contents(folder: str, layout: TextLayout) -> tuple[list[str], list[str]]:
    """The records in a folder with its name before theirs, and the names of all else that is not
    hidden.

    Raises
    ------
    RecordError
        The folder cannot be read, or has no record in it.
    """
    try:
        names = sorted(
            path.name for path in Path(folder).iterdir() if not path.name.startswith(".")
        )
    except OSError as error:
        raise RecordError(
            f"{folder}: the folder cannot be read: {error.strerror or error}"
        ) from error
    records, others = [], []
    for name in names:
        file = os.path.join(folder, name)  # noqa: PTH118  Path would shorten what the user wrote
        if is_folder(file):
            others.append(f"{name}/")
        elif is_file(file) and is_record(file, layout):  # A pipe would never end.
            records.append(file)
        else:
            others.append(name)
    if not records:
        listed = first_few(others, _MOST_NAMES) or "nothing"
        raise RecordError(f"{folder}: there is no record in this folder; it holds {listed}")
    return records, others


GroundMotion = Record | Horizontals
"""One component, or a pair of horizontal ones."""


@dataclass(frozen=True)
class Suite:
    """Ground motions, in the order of their files.

    Attributes
    ----------
    motions : tuple of Record or of Horizontals
        Single components, or pairs.
    failures : tuple of RecordError
        What could not be read or taken.
    notes : tuple of str
        What was left out or assumed, a sentence each.
    """

    motions: tuple[GroundMotion, ...]
    failures: tuple[RecordError, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def records(self) -> list[Record]:
        """All components, in order."""
        return [record for motion in self.motions for record in components(motion)]


def components(motion: GroundMotion) -> tuple[Record, ...]:
    """The components of a motion, one or two."""
    return (motion,) if isinstance(motion, Record) else (motion.first, motion.second)


def read_chosen(file: str, choice: RecordChoice) -> list[Record]:
    """The components of a file, changed as asked for.

    Raises
    ------
    RecordError
        The file cannot be read, or changed so.
    """
    return [processed(record, choice.processing) for record in read_records(file, **choice.reading)]


def read_suite(named: Sequence[str], choice: RecordChoice, pairs: PairNames | None = None) -> Suite:
    """The records that someone named, files and folders: their horizontal components, or pairs of
    them by their names.

    Raises
    ------
    UsageError
        As of `records_of` and `read_pairs`.
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
    """A sentence if records have the same samples: a file beside its folder, a copy under another
    name."""
    first: dict[tuple[float, bytes], Record] = {}
    again = []
    for record in records:
        # By a digest: the samples of a large suite need not be compared in pairs.
        samples = record.dt, sha256(record.acceleration.tobytes()).digest()
        if (before := first.setdefault(samples, record)) is not record:
            again.append(f"{record.name} is {before.name}")
    if not again:
        return []
    return [f"the same motion counts more than once in every mean: {first_few(again, _MOST_NAMES)}"]


def read_components(files: Sequence[str], choice: RecordChoice) -> Suite:
    """The horizontal components of files, each for itself; one that is named may be any.

    A file that cannot be read does not keep the others from being taken.
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
        # A vertical one is left out, unless the user names it.
        left = [
            component
            for component in components
            if choice.component is None and is_vertical(component.component)
        ]
        if left and len(left) == len(components):
            failures.append(
                RecordError(
                    f"{file}: has no horizontal component; name one to take it all the same"
                )
            )
            continue
        if left:
            notes.append(
                f"{file}: vertical, left out: "
                f"{', '.join(component.component for component in left)}"
            )
        records += [
            component for component in components if not any(component is other for other in left)
        ]
    return Suite(tuple(records), tuple(failures), tuple(notes))


def read_pairs(files: Sequence[str], choice: RecordChoice, names: PairNames = USUAL) -> Suite:
    """Pairs of horizontal components: of one file, or of files that are named alike but for the
    component.

    Raises
    ------
    UsageError
        No file has one of the names given.
    """
    # Files go together by their names alone, before any of them is read.
    groups, others = files_of_motions(files, names)
    pairs: list[GroundMotion] = []
    failures: list[RecordError] = []
    notes = (
        [f"left out, named neither {names.first} nor {names.second}: {', '.join(others)}"]
        if others
        else []
    )
    for group in groups:
        # Two files that go together by the usual names may differ in a direction in degrees.
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
    """A component of a ground motion.

    Attributes
    ----------
    record : Record
        The motion.
    name, component : str
        What tables call it.
    whole : Record or Horizontals
        The component itself, or the pair that it belongs to and shares its factors with.
    direction : int
        1, or 2 for the second component of a pair.
    """

    record: Record
    name: str
    component: str
    whole: GroundMotion
    direction: int = 1


def suite_motions(whole: Sequence[GroundMotion]) -> tuple[SuiteMotion, ...]:
    """The components of motions, in order; those of the same name in one file are told apart by
    their full ids."""
    motions = [(part, records) for part in whole for records in [components(part)]]
    names = iter(component_names([record for _, records in motions for record in records]))
    return tuple(
        SuiteMotion(record, record.source, next(names), motion, direction)
        for motion, records in motions
        for direction, record in enumerate(records, start=1)
    )
