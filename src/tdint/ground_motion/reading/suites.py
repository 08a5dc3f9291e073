"""Suites of ground motions: the horizontal components of many files, one by one or in pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tdint.errors import RecordError
from tdint.ground_motion.horizontals import Horizontals, find_horizontals, is_vertical
from tdint.ground_motion.pairing import USUAL, PairNames, files_of_motions, told_once, with_component
from tdint.ground_motion.processing import RecordChoice
from tdint.ground_motion.reading.read import read_records
from tdint.ground_motion.record import Record, component_names

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
    return [choice.processing.apply(record) for record in read_records(file, **choice.reading)]


def read_components(files: Sequence[str], choice: RecordChoice | None = None) -> Suite:
    """The horizontal components of files, each for itself; one that is named may be any.

    A file that cannot be read does not keep the others from being taken.
    """
    choice = choice or RecordChoice()
    records: list[GroundMotion] = []
    failures: list[RecordError] = []
    notes: list[str] = []
    for file in files:
        try:
            found = read_chosen(file, choice)
        except RecordError as error:
            failures.append(error)
            continue
        left = [one for one in found if choice.component is None and is_vertical(one.component)]
        if left and len(left) == len(found):
            failures.append(RecordError(f"{file}: has no horizontal component; name one to take it all the same"))
            continue
        if left:
            notes.append(f"{file}: vertical, left out: {', '.join(one.component for one in left)}")
        records += [one for one in found if not any(one is other for other in left)]
    return Suite(tuple(records), tuple(failures), tuple(notes))


def read_pairs(files: Sequence[str], choice: RecordChoice | None = None, names: PairNames = USUAL) -> Suite:
    """Pairs of horizontal components: of one file, or of files that are named alike but for the component.

    Raises
    ------
    UsageError
        No file has one of the names given.
    """
    choice = choice or RecordChoice()
    groups, others = files_of_motions(files, names)
    pairs: list[GroundMotion] = []
    failures: list[RecordError] = []
    notes = [f"left out, named neither {names.first} nor {names.second}: {', '.join(others)}"] if others else []
    for group in groups:
        try:
            found = [with_component(record) for file in group for record in read_chosen(file, choice)]
            pair: Horizontals = find_horizontals(found)
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
    direction: int


def suite_motions(whole: Sequence[GroundMotion]) -> tuple[SuiteMotion, ...]:
    """The components of motions, in order; those of the same name in one file are told apart by their full ids."""
    found = [(one, records) for one in whole for records in [components(one)]]
    names = iter(component_names([record for _, records in found for record in records]))
    return tuple(
        SuiteMotion(record, record.source, next(names), one, direction)
        for one, records in found
        for direction, record in enumerate(records, start=1)
    )
