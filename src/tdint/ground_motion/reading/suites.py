"""Suites of ground motions: files and directories specified by the user, and their horizontal
components, individually or in pairs."""

from __future__ import annotations

import glob
import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from tdint.errors import RecordError, UsageError
from tdint.files import STDIN, is_file, is_folder, is_set, pattern_of, protect_input
from tdint.ground_motion.choice import RecordChoice
from tdint.ground_motion.duplicates import first_copies
from tdint.ground_motion.horizontals import (
    USUAL,
    Horizontals,
    PairNames,
    combine_single_components,
    component_in_name,
    files_of_motions,
    find_horizontals,
    is_vertical,
    motion_names,
    recordings,
)
from tdint.ground_motion.measures import baseline_notes_of_suite
from tdint.ground_motion.origin import matched_clause
from tdint.ground_motion.processing_steps import processed
from tdint.ground_motion.reading.contents import (
    other_content,
    record_formats,
    repeated_quantities,
)
from tdint.ground_motion.reading.other_files import repeated_motions, unused_text
from tdint.ground_motion.reading.read import channel_records
from tdint.ground_motion.reading.sample_units import file_units
from tdint.ground_motion.record import Record, component_names
from tdint.number_parsing import abbreviate, pluralize

_MAX_NAMES = 10  # maximum number of names in a message


class Sources(NamedTuple):
    """Record files to read.

    Attributes
    ----------
    files : tuple of str
        Files in order; `-` is standard input.
    notes : tuple of str
        Notes about files that were omitted.
    failures : tuple of RecordError
        Errors for directories and patterns without records.
    found : int
        Number of files, including the omitted files.
    are_named : bool
        True if the user has named each file, without directories and patterns.
    """

    files: tuple[str, ...]
    notes: tuple[str, ...]
    failures: tuple[RecordError, ...]
    found: int
    are_named: bool

    def count_notes(self, used: int) -> tuple[str, ...]:
        """Return a note on the number of files with ground motions that are used; no note
        about a single file, or if the user has named each file and all are used."""
        if self.found == 1 or (self.are_named and used == self.found):
            return ()
        return (f"{used} of {pluralize(self.found, 'file')} used",)


def records_of(arguments: Sequence[str], choice: RecordChoice) -> Sources:
    """Return the record files of the arguments; a directory is replaced by its records and a
    pattern (`*.AT2`) by the matching files, in order of name.

    Other content of a directory is omitted with a note: subdirectories, documents, tables of a
    search, response spectra, text without numbers. A file with numbers, or with a suffix of data,
    that cannot be read is kept, so that reading it reports the error. The velocity and the
    displacement of a motion are omitted if its acceleration is in another file.

    Returns
    -------
    Sources
        Files, notes about omitted files, and errors for directories without records.

    Raises
    ------
    UsageError
        Standard input is specified more than once, or an entry of the units by file matches no
        file.
    """
    if arguments.count(STDIN) > 1:
        raise UsageError("standard input (-) can be read only once")
    files: list[str] = []
    notes: list[str] = []
    failures: list[RecordError] = []
    found = 0
    for argument in arguments:
        named = [argument]
        if not is_folder(argument) and is_set(argument):
            named = sorted(glob.glob(pattern_of(argument)))  # noqa: PTH207  keeps the user's spelling
        if not named:
            failures.append(RecordError(f"{argument}: no file matches this pattern"))
        for name in named:
            if name == STDIN or not is_folder(name):
                files.append(name)
                found += 1
                continue
            try:
                records, unused = _records_in_directory(name, choice)
            except RecordError as error:
                failures.append(error)
                continue
            files += records
            found += len(records) + sum(not other.endswith("/") for other in unused)
            # The command must not replace these files, even if only another process reads them.
            for file in records:
                protect_input(file)
            if unused:
                notes.append(f"{name}: not used: {unused_text(unused)}")
    read = [file for file in files if file != STDIN]
    if repeated := repeated_motions(read) | repeated_quantities(read[1:] and read):
        notes.append(f"not used, because another file contains the motion: {unused_text(repeated)}")
    files = [file for file in files if file not in repeated]
    # Options of a description apply to its own files only.
    files_of_choice: dict[int, tuple[RecordChoice, list[str]]] = {}
    for file in files:
        own = choice.of(file)
        files_of_choice.setdefault(id(own), (own, []))[1].append(file)
    for own, own_files in files_of_choice.values() or [(choice, [])]:
        formats = partial(record_formats, layout=own.layout)
        file_units(own.units).require_matches(own_files, formats)
    are_named = not any(map(is_set, arguments))
    return Sources(tuple(files), tuple(notes), tuple(failures), found, are_named)


def _records_in_directory(directory: str, choice: RecordChoice) -> tuple[list[str], dict[str, str]]:
    """Return the paths of the records in a directory, and the names of its other visible content
    with the reason why they are not used. RecordError is raised if the directory cannot be read, or
    contains no record.
    """
    try:
        names = sorted(
            path.name for path in Path(directory).iterdir() if not path.name.startswith(".")
        )
    except OSError as error:
        raise RecordError(
            f"{directory}: the directory cannot be read: {error.strerror or error}"
        ) from error
    records: list[str] = []
    unused: dict[str, str] = {}
    for name in names:
        # `Path` would change the spelling of the user, for example remove a leading "./".
        file = os.path.join(directory, name)  # noqa: PTH118
        if is_folder(file):
            unused[f"{name}/"] = "directory"
        elif not is_file(file):  # A pipe is not read: it may never end.
            unused[name] = "no regular file"
        elif content := other_content(file, choice.of(file).layout):
            unused[name] = content
        else:
            records.append(file)
    if not records:
        listed = unused_text(unused) or "nothing"
        raise RecordError(f"{directory}: no record found in this directory; it contains {listed}")
    # A license file, and the JSON file of an exported record, are usual and need no note.
    stems = {Path(file).stem for file in records}
    usual = {f"{stem}.json" for stem in stems} | {"LICENSE"}
    return records, {name: why for name, why in unused.items() if name not in usual}


GroundMotion = Record | Horizontals
"""One component, or a pair of horizontal components."""


class Suite(NamedTuple):
    """Ground motions, in the order of their files.

    Attributes
    ----------
    failures : tuple of RecordError
        Errors of files that could not be used.
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
    """Read the components of a file and apply the processing steps that the user selected.

    Raises
    ------
    RecordError
        The file cannot be read, or a processing step cannot be applied.
    """
    choice = choice.of(file)
    records = channel_records(file, choice, single=False)
    return [processed(record, choice.processing) for record in records]


def read_suite(named: Sequence[str], choice: RecordChoice, pairs: PairNames | None = None) -> Suite:
    """Read a suite of ground motions from files and directories.

    Parameters
    ----------
    named : sequence of str
        Names of files and directories.
    pairs : PairNames | None
        File names of pairs; None (default) reads single horizontal components.

    Returns
    -------
    Suite
        Ground motions, errors of files that could not be read, and notes. Notes also report ground
        motions that are included more than one time, and motions with a doubtful start or baseline.

    Raises
    ------
    UsageError
        Standard input is specified more than once, an entry of the units by file matches no file,
        or no file matches the names of pairs.
    """
    sources = records_of(named, choice)
    suite = (
        read_pairs(sources.files, choice, pairs)
        if pairs
        else read_components(sources.files, choice)
    )
    origins = [record.origin for record in suite.records]
    matched = matched_clause(origins, len(origins))
    if warned := sum(bool(origin and origin.warnings) for origin in origins):
        matched += f"; {pluralize(warned, 'component')} with warnings of the match"
    notes = [*sources.notes, *suite.notes]
    if matched:
        notes.append(f"the ground motions are {matched}")
    # The user may specify a file and its directory, or a motion in two formats.
    originals = first_copies([[record] for record in suite.records], scaled=False)
    duplicates = [
        f"{suite.records[index].name} is {suite.records[original].name}"
        for index, original in enumerate(originals)
        if original != index
    ]
    if duplicates:
        notes.append(
            "the same ground motion is included more than once in all means: "
            f"{abbreviate(duplicates, _MAX_NAMES)}"
        )
    notes += baseline_notes_of_suite(suite.records)
    notes += sources.count_notes(len({record.inputs[0].file for record in suite.records}))
    return Suite(suite.motions, (*sources.failures, *suite.failures), tuple(notes))


def read_components(files: Sequence[str], choice: RecordChoice) -> Suite:
    """Read the horizontal components of files as separate ground motions.

    A vertical component is read only if the user selects it by name. A file that cannot be read is
    reported in the failures of the suite; the other files are still read.
    """
    records: list[Record] = []
    failures: list[RecordError] = []
    notes: list[str] = []
    vertical_files: list[str] = []
    for file in files:
        try:
            components = read_chosen(file, choice)
        except RecordError as error:
            failures.append(error)
            continue
        # A vertical component is omitted unless the user selects it.
        if choice.of(file).component is not None:
            records += components
            continue
        vertical = [record for record in components if is_vertical(record.component)]
        if len(vertical) == len(components):
            vertical_files.append(file)
        elif vertical:
            listed = ", ".join(component_names(vertical))
            notes.append(f"{file}: vertical component omitted: {listed}")
        records += [record for record in components if not is_vertical(record.component)]
    accompanying = _verticals_by_name(records)
    vertical_files += accompanying
    records = [record for record in records if record.source not in accompanying]
    # A file of a vertical component usually accompanies the files of the horizontal components.
    if records:
        notes += [f"{file}: not used: vertical component" for file in vertical_files]
    else:
        failures += [
            RecordError(
                f"{file}: no horizontal component found; select a component by name to use a "
                "vertical one"
            )
            for file in vertical_files
        ]
    return Suite(tuple(records), tuple(failures), tuple(notes))


def _verticals_by_name(records: Sequence[Record]) -> list[str]:
    """Return the files of records without a component that have the name of a vertical component,
    and differ only in the component from the name of another file (x_Z.csv, x_N.csv)."""
    sources = [record.source for record in records]
    verticals, motions_of_horizontals = {}, set()
    for record, motion in zip(records, motion_names(sources), strict=True):
        if not is_vertical(record.component or component_in_name(record.source)):
            motions_of_horizontals.add(motion)
        elif not record.component:
            verticals[record.source] = motion
    return [file for file, motion in verticals.items() if motion in motions_of_horizontals]


def read_pairs(files: Sequence[str], choice: RecordChoice, names: PairNames = USUAL) -> Suite:
    """Read pairs of horizontal components from files with both components, or from files with names
    that differ only in the component.

    Raises
    ------
    UsageError
        No file matches the names.
    """
    # The two components may be in separate files, which their names identify as a pair.
    groups, unmatched = files_of_motions(files, names)
    pairs: list[GroundMotion] = []
    failures: list[RecordError] = []
    notes = []
    if unmatched:
        listed = ", ".join(unmatched)
        notes.append(
            f"files omitted, because their names match neither {names.first} nor {names.second}: "
            f"{listed}"
        )
    for group in groups:
        try:
            records = [record for file in group for record in read_chosen(file, choice)]
        except RecordError as error:
            failures.append(error)
            continue
        for recording in recordings(records, names):
            try:
                pair: Horizontals = find_horizontals(recording)
            except RecordError as error:
                failures.append(error)
                continue
            notes += [f"{pair.source}: {note}" for note in pair.notes]
            pairs.append(pair)
    return Suite(tuple(pairs), tuple(combine_single_components(failures)), tuple(notes))


class SuiteMotion(NamedTuple):
    """Component of a ground motion in a suite.

    Attributes
    ----------
    name, component : str
        Names in tables.
    ground_motion : Record or Horizontals
        The component, or its pair, which has a common scale factor.
    direction : int
        1, or 2 for the second component of a pair.
    """

    record: Record
    name: str
    component: str
    ground_motion: GroundMotion
    direction: int = 1


def suite_motions(motions: Sequence[GroundMotion]) -> tuple[SuiteMotion, ...]:
    """Return the components of ground motions in order, with their names in tables.

    Components of one file with the same name are named by their full ids.
    """
    records = [record for motion in motions for record in components(motion)]
    names = iter(component_names(records))
    return tuple(
        SuiteMotion(record, record.source, next(names), motion, direction)
        for motion in motions
        for direction, record in enumerate(components(motion), start=1)
    )
