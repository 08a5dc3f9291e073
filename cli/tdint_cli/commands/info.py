"""`tdint info`: properties and intensity measures of ground-motion records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import chain, cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdint.errors import TdintError, UsageError
from tdint.files import check_outputs, is_folder, write_files
from tdint.output import figures, tables
from tdint.units import SI
from tdint_cli import options
from tdint_cli.options.output import Outputs, beside
from tdint_cli.options.record import RecordsRequest, notes_of_components
from tdint_cli.processes import Task, outcomes
from tdint_cli.terminal import Failures, note, warn

if TYPE_CHECKING:
    from tdint.ground_motion.record import Record
    from tdint.output.tables.spectra import RecordInfo
    from tdint.output.tables.table import Cell, Table


@options.request
class Request(RecordsRequest):
    """The command line of `tdint info`."""

    export: str | None
    outputs: Outputs

    @property
    def settings(self) -> dict[str, Any]:
        """Options that determine how the records are read, for the JSON file."""
        return {name: value for name, value in self.record_settings.items() if name != "described"}


_MSEED, _CSV, _YAML = ".mseed", ".csv", ".yaml"
_EXPORT = options.option("--export")


@options.command
@options.record.record_options
@options.output.to_files(picture=True, more=[_EXPORT])
@options.of(Request)
def command(request: Request) -> None:
    """Summarize ground-motion records: sampling, peaks, Arias intensity, duration.

    RECORD is a file, a directory (all records in it), or - (standard input). All components are
    listed unless --component selects one. CSV, one row per component: samples, units and their
    source, peak acceleration, velocity and displacement (integrated from rest, without baseline
    correction), Arias intensity and significant durations, cumulative absolute velocity, Housner's
    spectrum intensity (5 % damping, 0.1 to 2.5 s), zeros at both ends, and notes about assumptions
    and suspect values. The measures are exact for a ground motion that is linear between its
    samples. The figure shows the first components. If a record cannot be read, the other records
    are still processed.
    """
    from tdint.ground_motion.reading.suites import records_of
    from tdint.output.summary import record_summary, table_summary

    sources = records_of(request.records, request.choice)
    outputs = request.outputs
    exports = _exports(request, sources.files)
    check_outputs([*outputs.files, *chain(*exports)], overwrite=outputs.overwrite)
    notes = dict.fromkeys(sources.notes)  # An ordered set: the keys keep the order of insertion.
    warnings: dict[str, None] = {}
    failures: list[TdintError] = list(sources.failures)
    rows: list[tuple[Cell, ...]] = []
    summaries: list[dict[str, Any]] = []
    infos: list[RecordInfo] = []
    motions: dict[tuple[Path, ...], list[Record]] = {}
    used = 0
    tasks = [Task(file) for file in sources.files]
    work = partial(_work, request)
    with outcomes(
        work, tasks, jobs=1, label="records", to_terminal=outputs.table is None
    ) as results:
        # Files for all records are repeated.
        for outcome, files in zip(results, cycle(exports)):
            if isinstance(outcome, TdintError):
                failures.append(outcome)
                continue
            used += 1
            infos_of_file, table = outcome
            records = [info.record for info in infos_of_file]
            notes |= dict.fromkeys(notes_of_components(records, lambda record: record.processing))
            warnings |= dict.fromkeys(notes_of_components(records, lambda record: record.warnings))
            rows += table.rows
            summaries += map(record_summary, records)
            # The samples are kept only for the figure and the export.
            if outputs.picture:
                infos += infos_of_file
            if files:
                motions.setdefault(files, []).extend(records)
    if used:
        notes |= dict.fromkeys(_export(request, motions))
        table = tables.spectra.info_table([])._replace(rows=rows)
        outputs.deliver(
            table,
            lambda: figures.static_curves.info_picture(infos, outputs.shown_units),
            lambda: table_summary("info", request.settings, summaries, table.meanings),
        )
    warn(*warnings)
    # The figure shows only the first components, because its size is limited.
    if outputs.picture and (left_out := len(infos) - figures.static_curves.MOST_RECORDS) > 0:
        note(
            f"the figure shows only the first {figures.static_curves.MOST_RECORDS} components; "
            f"{left_out} are omitted"
        )
    note(*notes, *sources.count_notes(used))
    if failures:
        raise Failures(failures)


def _exports(request: Request, records: Sequence[str]) -> list[tuple[Path, ...]]:
    """Return the file of --export for all `records` and its JSON file, which a description does not
    have; in a directory, the two files for each record; without --export, no file. UsageError is
    raised if the file name has none of the three suffixes.
    """
    if request.export is None:
        return [()]
    file = Path(request.export)
    if request.export.endswith("/") or is_folder(file):
        from tdint_cli.commands.spectrum import tables_of

        motions = tables_of(records, file, _MSEED, f"--export NAME{_MSEED} for one file")
        return [(motion, motion.with_suffix(".json")) for motion in motions]
    if file.suffix.lower() == _YAML:
        return [(file,)]
    if file.suffix.lower() not in (_MSEED, _CSV):
        raise UsageError(
            f"--export {request.export[:60]}: unknown file type; use the suffix {_MSEED}, {_CSV} "
            f"or {_YAML}, or a directory: {request.export[:60]}/"
        )
    return [(file, beside(file, ".json"))]


def _export(
    request: Request, motions: Mapping[tuple[Path, ...], Sequence[Record]]
) -> tuple[str, ...]:
    """Write the processed ground motions, or the description of the records, to the files of
    --export, and return notes. `motions` are the records by their files.

    UsageError is raised if several components are requested for a CSV file, or records with
    different sampling intervals for a MiniSEED file.
    """
    contents: dict[Path, bytes] = {}
    notes: list[str] = []
    for (file, *json_file), records in motions.items():
        if json_file:
            added, more_notes = _exported(request, records, file, *json_file)
            contents |= added
            notes += more_notes
            continue
        from tdint.model.config.record_files import description_text

        choices = {id(choice): choice for choice in map(request.choice.of, request.records)}
        if len(choices) > 1:
            raise UsageError(
                f"--export {file}: the records are read with different options; write a "
                "description for each of them"
            )
        (choice,) = choices.values()
        contents[file] = description_text(request.records, choice, file.parent).encode()
    write_files(contents, overwrite=request.outputs.overwrite)
    return tuple(notes)


def _exported(
    request: Request, motions: Sequence[Record], file: Path, json_file: Path
) -> tuple[dict[Path, bytes], tuple[str, ...]]:
    """Return the contents of a file with the processed ground motions of some records and of its
    JSON file, and notes about it."""
    from tdint.ground_motion.measures import channels_of
    from tdint.ground_motion.origin import WRITTEN, written_motion
    from tdint.ground_motion.record import to_mseed
    from tdint.output.summary import in_units, json_bytes, record_summary, table_summary

    # A MiniSEED file contains all components, each as acceleration, velocity and displacement.
    summaries = list(map(record_summary, motions))
    units, notes, ids = SI, tuple[str, ...](), list[str]()
    table = tables.spectra.ground_table(motions[0])
    if file.suffix.lower() == _MSEED:
        if len({record.dt for record in motions}) > 1:
            raise UsageError(
                f"--export {file}: the records have different sampling intervals and cannot be "
                f"written to one file; write one file for each record (--export {file.stem}/), or "
                "add --resample"
            )
        channels = channels_of(motions)
        content, notes = to_mseed(channels)
        # The first channel of each component is its acceleration.
        channels_per_motion = len(channels) // len(motions)
        for summary, channel in zip(summaries, channels[::channels_per_motion], strict=True):
            summary["exported_as"] = channel.id
            ids.append(channel.id)
    elif len(motions) > 1:
        raise UsageError(
            f"--export {file}: a CSV file can contain one component, got {len(motions)}; select "
            f"one with --component, or use {file.stem}{_MSEED} for all components"
        )
    else:
        units = request.outputs.shown_units
        content = table.in_units(units).csv()
        ids.append("")
    # The descriptions of the columns are already in the output units.
    columns = {"columns": table.in_units(units).meanings}
    summary = in_units(table_summary("info", request.settings, summaries, {}), units) | columns
    # A command that reads the file states how the motion was made.
    summary[WRITTEN] = [
        written_motion(file.name, content, id, motion.written_origin)
        for id, motion in zip(ids, motions, strict=True)
    ]
    return {file: content, json_file: json_bytes(summary)}, notes


def _work(request: Request, task: Task) -> tuple[list[RecordInfo], Table]:
    """Read a record; return the properties of its components, and their table."""
    infos = list(map(tables.spectra.record_info, request.read(task.source)))
    return infos, tables.spectra.info_table(infos)
