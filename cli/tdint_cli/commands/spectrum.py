"""`tdint spectrum`: a table over the period or the frequency for each record, or the table of a
target spectrum.

Types of tables: elastic, inelastic, rotated and Fourier spectra, oscillator histories, and
comparisons with a published spectrum.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from io import BytesIO
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import click

from tdint.errors import OutputError, RecordError, TdintError, UsageError
from tdint.files import STDIN, check_outputs, write_files
from tdint.grids import Grid
from tdint.number_parsing import parse_positive
from tdint.output import figures, tables
from tdint.output.presentation import PRESENTATIONS
from tdint.response.defaults import MOST_DUCTILE, PERIODS, STEPS_PER_PERIOD
from tdint_cli import options
from tdint_cli.drawing import reading_width, table_bytes
from tdint_cli.options import option_types
from tdint_cli.options.grammar import refuse_idle
from tdint_cli.options.option_types import BESIDE
from tdint_cli.options.output import SUFFIX, Outputs, beside, picture_file
from tdint_cli.options.record import RecordsRequest, notes_of_components
from tdint_cli.processes import Task, outcomes
from tdint_cli.terminal import Failures, emit, note, warn

if TYPE_CHECKING:
    from tdint.arrays import Array
    from tdint.ground_motion.horizontals import PairNames
    from tdint.ground_motion.record import Record
    from tdint.output.figures.style import Figure
    from tdint.output.tables.table import Table
    from tdint.response.spectra.elastic import Spectrum, SpectrumSettings
    from tdint.response.spectra.inelastic import InelasticSpectrum
    from tdint.response.spectra.rotated import RotatedSpectrum
    from tdint.response.spectra.target import PublishedSpectrum, SpectrumDifference, TargetSpectrum
    from tdint.units import OutputUnits


# ---- This part contains the command lines of `spectrum` and `drift-spectrum`, and the interface of
# a type of table over the period.

AXES = options.option("--axes")

_NOT_SETTINGS = (
    "choice",
    "records",
    "output",
    "plot",
    "axes",
    "jobs",
    "overwrite",
    "output_units",
    "history",
)


@dataclass(frozen=True)
class Results:
    """The results that a command computes from a record with one or several components.

    Attributes
    ----------
    notes : sequence of str
        Notes in addition to the notes of the components.
    """

    lines: Sequence[Any]
    records: Sequence[Record]
    notes: Sequence[str] = ()


class TableType(Protocol):
    """A type of table over the period."""

    def check(self, request: Any) -> None:
        """Raise UsageError for options that cannot be used together, before any computation."""

    def gather(self, request: Any, files: Sequence[str]) -> list[tuple[str, ...]]:
        """Group the files by record; by default each file is a separate record."""
        return [(file,) for file in files]

    def compute(self, request: Any, records: Sequence[Record]) -> Results:
        """Compute the results of the components of one record."""

    def table(self, request: Any, lines: Sequence[Any]) -> Table:
        """Return the table of results; by default the columns that their class declares, with a row
        for each period, sample or frequency.
        """
        return tables.spectra.result_table(lines)

    def picture(self, request: Any, lines: Sequence[Any]) -> Figure:
        """Return the figure of results; by default the figure of their class."""
        draw = PRESENTATIONS[type(lines[0]).__name__].picture
        assert draw, "the class of a table without a figure must not declare --plot"
        return draw(lines, request.shown_units)

    def remark(self, request: Any, interval: float) -> str:
        """Return the note that is printed at the end; empty for no note.

        Parameters
        ----------
        interval : float
            Maximum sampling interval of all records, s.
        """
        return ""


@dataclass(frozen=True, eq=False)
class TablesRequest(RecordsRequest):
    """Common part of the command lines that write a table over the period for each record.

    `DEFAULT_PERIODS` is used if no periods are requested.
    """

    DEFAULT_PERIODS: ClassVar[str] = PERIODS

    damping: tuple[float, ...]
    periods: tuple[float | Grid, ...] | None
    output: str | None
    plot: str | None
    jobs: int
    overwrite: bool
    output_units: OutputUnits | None

    @property
    def shown_units(self) -> OutputUnits:
        """The units of tables, figures and JSON files."""
        from tdint.units import SI

        return self.output_units or SI

    @property
    def is_folder(self) -> bool:
        """True if -o names a directory."""
        return self.output is not None and options.output.is_folder_name(self.output)

    def settings(self) -> dict[str, Any]:
        """Return all settings that affect the results, for the JSON file; records are not
        included."""
        settings = {
            name: value for name, value in asdict(self).items() if name not in _NOT_SETTINGS
        }
        return (
            self.record_settings
            | settings
            | {"periods": options.spectra.periods_as_given(self.periods, self.DEFAULT_PERIODS)}
        )

    def chosen_periods(self) -> Array:
        """Return the requested or the default periods of the spectra, s, as an array."""
        return options.spectra.chosen_periods(self.periods, self.DEFAULT_PERIODS)


def _bandwidth(text: str) -> float:
    """Parse the bandwidth of a smoothing window; return 0 for 'none'.

    `text` is the bandwidth, a positive number or 'none'.
    """
    return (
        0.0
        if text.strip().lower() == "none"
        else parse_positive("the bandwidth of --smoothing", text)
    )


_FOURIER_SETTINGS = ("units", "component", "inventory", "layout", "processing", "scale")
"""Settings of elastic spectra that Fourier spectra also use."""


@options.request
class SpectrumRequest(TablesRequest):
    """The command line of `tdint spectrum`."""

    damping: tuple[float, ...] = options.spectra.damping
    periods: tuple[float | Grid, ...] | None = options.spectra.periods
    method: str | None = options.analysis.method
    maxima: str | None = options.option()
    interpolation: str | None = options.option()
    rotd: tuple[int, ...] | None = options.option(type=option_types.ListOf(click.IntRange(0, 100)))
    pairs: PairNames | None = options.option()
    ductility: tuple[float, ...] | None = options.option(
        type=option_types.ListOf(option_types.Number(1.0, MOST_DUCTILE))
    )
    strength: tuple[float, ...] | None = options.option(
        type=option_types.ListOf(option_types.Ratio(0.0, min_open=True))
    )
    reduction: tuple[float, ...] | None = options.option()
    hardening: float | None = options.option()
    target: str | None = options.spectra.target(
        "Draw this spectrum with the spectra of the records (--plot) or, without RECORD, write it "
        "as a table"
    )
    against: str | None = options.option()
    against_column: str | None = options.option()
    fourier: bool = options.option()
    smoothing: float | None = options.option(type=option_types.Written("bandwidth", _bandwidth))
    axes: str | None
    scale: float | None

    def read(self, file: str) -> list[Record]:
        """Read the components of a file and multiply them by the factor of --scale."""
        components = super().read(file)
        if self.scale is None:
            return components
        return [record.scaled(self.scale) for record in components]

    def settings(self) -> dict[str, Any]:
        """Return the settings of all tables, with the defaults that were used."""
        if self.fourier:
            settings = super().settings()
            smoothing = "none" if self.bandwidth is None else self.bandwidth
            return {name: settings[name] for name in _FOURIER_SETTINGS if name in settings} | {
                "fourier": True,
                "smoothing": smoothing,
            }
        elastic = self.elastic_settings
        # A setting that this table does not use is stored as null, not as its default.
        hardening = None
        if self.ductility or self.strength or self.reduction:
            hardening = self.hardening or 0.0
        return super().settings() | {
            "method": self.method or "exact",
            "hardening": hardening,
            "maxima": elastic.maxima.name,
            "interpolation": elastic.interpolation.name,
            "against_sha256": self.read_published_spectrum(self.damping[0]).input.sha256
            if self.against
            else None,
        }

    @property
    def bandwidth(self) -> float | None:
        """Bandwidth of the smoothing of Fourier spectra; None for no smoothing."""
        from tdint.response.spectra.fourier import BANDWIDTH

        return BANDWIDTH if self.smoothing is None else (self.smoothing or None)

    def read_published_spectrum(self, damping: float) -> PublishedSpectrum:
        """Read the published spectrum for a damping ratio from the file of --against.

        Raises
        ------
        RecordError
            The file cannot be read, or does not contain a valid spectrum for the damping ratio.
        UsageError
            The file contains several columns of values, and --against-column is missing.
        """
        from tdint.response.spectra.target import read_published

        assert self.against is not None
        return read_published(self.against, damping, self.against_column)

    @property
    def target_spectrum(self) -> TargetSpectrum | None:
        """The target spectrum; None if it is not requested."""
        if self.target is None:
            return None
        from tdint.response.spectra.target import read_target

        return read_target(self.target)

    @property
    def elastic_settings(self) -> SpectrumSettings:
        """Settings of the computation of elastic spectra."""
        from tdint.response.spectra.elastic import choose_settings

        return choose_settings(self.method, self.maxima, self.interpolation)

    @property
    def specified_settings(self) -> dict[str, Any]:
        """Values of --maxima and --interpolation that are specified; each has a column of the
        table."""
        return {
            name: value
            for name in ("maxima", "interpolation")
            if (value := getattr(self, name)) is not None
        }


# ---- Spectrum kinds


class _OscillatorSpectra(TableType):
    """Spectra over the requested periods, with a note on these periods."""

    def check(self, request: SpectrumRequest) -> None:
        _ = request.elastic_settings  # raises UsageError if these options exclude each other
        if request.target_spectrum and not request.plot:
            raise UsageError(
                "--target with records requires --plot, because the target spectrum is then only "
                "drawn in the figure; add --plot, or omit the records to write the target spectrum "
                "as a table"
            )
        if request.target_spectrum and request.axes not in (None, "periods"):
            raise UsageError(
                f"--target cannot be used with --axes {request.axes}, because a target spectrum is "
                "drawn over the period; omit --axes"
            )

    def remark(self, request: SpectrumRequest, interval: float) -> str:
        """Return a note on periods that are short for the sampling interval, or too coarse.

        `interval` is the maximum sampling interval of all records, s.
        """
        periods = request.chosen_periods()
        remarks: list[str] = []
        # At short periods the results depend on the ground motion between the samples.
        limit = STEPS_PER_PERIOD * interval
        if any((periods > 0.0) & (periods < limit * (1.0 - 1e-9))):
            settings = request.elastic_settings
            remarks.append(
                f"below a period of {limit:.6g} s ({STEPS_PER_PERIOD} sampling intervals) values "
                "depend on the ground motion between the samples: taken as "
                f"{settings.interpolation.description}, maxima {settings.maxima.description}"
            )
        # The default grid is coarse if its spacing exceeds half the width of a resonance, which is
        # the damping ratio.
        if request.periods is None:
            spacing, damping = float(periods[1] / periods[0]) - 1.0, min(request.damping)
            if spacing > damping * (1.0 + 1e-9):
                remarks.append(
                    f"the spacing of the periods is {100.0 * spacing:.2g} %: with "
                    f"{100.0 * damping:.3g} % damping the spectrum may be higher between them; "
                    "give more periods with --period"
                )
        return "; ".join(remarks)


class Elastic(_OscillatorSpectra):
    """Elastic spectra of single components."""

    def compute(self, request: SpectrumRequest, records: Sequence[Record]) -> Results:
        """Compute the spectrum of each component for each damping ratio."""
        from tdint.response.spectra.elastic import spectrum

        periods = request.chosen_periods()
        lines = [
            spectrum(record, periods, damping, method=request.method, **request.specified_settings)
            for record in records
            for damping in request.damping
        ]
        return Results(lines, records)

    def table(self, request: SpectrumRequest, lines: Sequence[Spectrum]) -> Table:
        """Return a table with a row for each spectrum and period."""
        return tables.spectra.result_table(lines, tuple(request.specified_settings))

    def picture(self, request: SpectrumRequest, lines: Sequence[Spectrum]) -> Figure:
        """Return a figure with a line for each spectrum."""
        axes = request.axes or "periods"
        return figures.spectrum_curves.spectrum_picture(
            lines, axes, request.shown_units, request.target_spectrum
        )


class Inelastic(_OscillatorSpectra):
    """Inelastic spectra of oscillators with bilinear hysteresis, for constant ductility, strength
    or reduction of the strength."""

    def check(self, request: SpectrumRequest) -> None:
        kinds = ("ductility", "strength", "reduction")
        requested = [f"--{name}" for name in kinds if getattr(request, name)]
        if len(requested) > 1:
            raise UsageError(f"{' and '.join(requested)} cannot be used together; use one of them")

    def compute(self, request: SpectrumRequest, records: Sequence[Record]) -> Results:
        """Compute the spectrum of each component for each damping ratio and each ductility,
        strength or reduction.
        """
        from tdint.response.spectra.inelastic import constant_ductility, constant_strength

        periods = request.chosen_periods()
        hardening = request.hardening or 0.0
        spectra: Callable[..., list[InelasticSpectrum]] = constant_strength
        if request.ductility:
            values, spectra = request.ductility, constant_ductility
        elif request.strength:
            values = request.strength
        else:
            values = tuple(1.0 / factor for factor in request.reduction or ())
            spectra = partial(constant_strength, relative_to="elastic")
        lines: list[InelasticSpectrum] = []
        for record in records:
            for damping in request.damping:
                lines += spectra(record, periods, values, damping, hardening=hardening)
        return Results(lines, records)


class Fourier(TableType):
    """Fourier amplitude spectra of single components."""

    def compute(self, request: SpectrumRequest, records: Sequence[Record]) -> Results:
        """Compute the spectrum of each component."""
        from tdint.response.spectra.fourier import fourier_spectrum

        return Results([fourier_spectrum(record, request.bandwidth) for record in records], records)


class Rotated(_OscillatorSpectra):
    """Spectra of two horizontal components over all directions."""

    def gather(self, request: SpectrumRequest, files: Sequence[str]) -> list[tuple[str, ...]]:
        """Group the files by ground motion: files with equal names except for the component.

        The order is the order of the first file of each ground motion. If only two files are given
        and each has a single horizontal component, they are one ground motion, regardless of their
        names.
        """
        from tdint.ground_motion.horizontals import USUAL, files_of_motions

        result, others = files_of_motions(files, request.pairs or USUAL)
        if others:
            note(f"skipped, because the names do not match --pairs: {', '.join(others)}")
        if (
            len(files) == len(result) == 2
            and STDIN not in files
            and all(_is_single(request, file) for file in files)
        ):
            return [tuple(files)]
        return result

    def compute(self, request: SpectrumRequest, records: Sequence[Record]) -> Results:
        """Compute the spectra of the two horizontal components of each ground motion for each
        damping ratio.

        Parameters
        ----------
        records : sequence of Record
            Components of the ground motions of a file or of a group of files.
        """
        from tdint.ground_motion.horizontals import USUAL, find_horizontals, recordings
        from tdint.response.spectra.rotated import rotated_spectrum

        pairs = [*map(find_horizontals, recordings(records, request.pairs or USUAL))]
        periods = request.chosen_periods()
        lines = [
            rotated_spectrum(
                pair, periods, damping, request.rotd or (), **request.specified_settings
            )
            for pair in pairs
            for damping in request.damping
        ]
        return Results(
            lines,
            [record for pair in pairs for record in (pair.first, pair.second)],
            [f"{pair.source}: {note}" for pair in pairs for note in pair.notes],
        )

    def table(self, request: SpectrumRequest, lines: Sequence[RotatedSpectrum]) -> Table:
        """Return a table with a row for each damping ratio and period."""
        return tables.spectra.rotated_table(lines, tuple(request.specified_settings))

    def picture(self, request: SpectrumRequest, lines: Sequence[RotatedSpectrum]) -> Figure:
        """Return a figure with a line for each percentile."""
        return figures.spectrum_curves.rotated_picture(
            lines, request.shown_units, request.target_spectrum
        )


class Against(TableType):
    """Elastic spectra compared with a published spectrum."""

    def check(self, request: SpectrumRequest) -> None:
        """Check the options and the file of the published spectrum before any computation.

        Raises
        ------
        UsageError
            Options cannot be used together, or the file has several columns of values and the
            option for the column is missing.
        RecordError
            The file does not contain a valid spectrum for one of the damping ratios.
        """
        # `compute` computes the spectra of the records by `Elastic`, so check its options.
        Elastic().check(request)
        # Read the published spectrum only to report errors; `compute` reads it again.
        for ratio in request.damping:
            request.read_published_spectrum(ratio)

    def compute(self, request: SpectrumRequest, records: Sequence[Record]) -> Results:
        """Compute the spectra of each component for each damping ratio, with the published
        values.
        """
        from tdint.response.spectra.target import differences

        lines: list[SpectrumDifference] = []
        for ratio in request.damping:
            # A published spectrum is for a single damping ratio: compare spectra of equal damping.
            published = request.read_published_spectrum(ratio)
            ratio_request = replace(request, damping=(ratio,))
            if request.periods is None:
                periods = tuple(published.periods.tolist())
                ratio_request = replace(ratio_request, periods=periods)
            lines += differences(Elastic().compute(ratio_request, records).lines, published)
        notes = []
        for line in lines:
            if line.largest is None:
                notes.append(f"{line.record.name}: the published spectrum is zero")
                continue
            difference, period = line.largest
            notes.append(
                f"{line.record.name}, damping {line.damping:g}: maximum difference of "
                f"{line.published.quantity} to {line.published.source} {100.0 * difference:+.3g} % "
                f"at {period:.4g} s"
            )
        return Results(lines, records, notes)

    def table(self, request: SpectrumRequest, lines: Sequence[SpectrumDifference]) -> Table:
        """Return a table with a row for each spectrum and period."""
        return tables.spectra.difference_table(lines)

    def picture(self, request: SpectrumRequest, lines: Sequence[SpectrumDifference]) -> Figure:
        """Return a figure of both spectra and their difference."""
        return figures.spectrum_curves.difference_picture(lines, request.shown_units)


def _is_single(request: SpectrumRequest, file: str) -> bool:
    """Return True if a file has exactly one horizontal component."""
    from tdint.ground_motion.horizontals import is_vertical
    from tdint.ground_motion.reading.read import channel_records

    try:
        choice = replace(request.choice.of(file), component=None)
        records = channel_records(file, choice, single=False)
    except RecordError:
        return False  # The error is reported when the file is processed.
    return sum(not is_vertical(record.component) for record in records) == 1


# ---- A table over the period for each record: computation, outputs and messages


@dataclass(frozen=True, eq=False)
class RecordTable:
    """The table, the messages and the figure of a single record.

    Attributes
    ----------
    text : bytes
        Header and rows of all components and damping ratios: CSV, or formatted for a terminal.
    meanings : dict
        Descriptions of the columns, for the JSON file.
    interval : float
        Maximum sampling interval of the components, s.
    results : tuple
        Result objects; kept only for a figure of several records.
    picture : bytes | None
        The figure of the record, if each record has a separate figure.
    """

    text: bytes
    meanings: dict[str, dict[str, str]]
    records: tuple[dict[str, Any], ...]
    notes: tuple[str, ...]
    interval: float
    warnings: tuple[str, ...]
    results: tuple[Any, ...] = ()
    picture: bytes | None = None


def make_tables(request: TablesRequest, table_type: TableType) -> None:
    """Compute and write a table over the period for each record, and print notes and warnings.

    The tables are written to separate files in a directory, or joined in a file or on standard
    output. A record that fails does not prevent the processing of the remaining records.

    Raises
    ------
    UsageError, OutputError
        Options cannot be used together, or an output cannot be written; raised before any
        computation.
    Failures
        Some records failed; raised after the remaining records are written.
    """
    from tdint.ground_motion.reading.suites import records_of

    table_type.check(request)
    if request.is_folder and request.plot not in (None, BESIDE):
        raise UsageError(
            "--plot=FILE is one figure of all records and cannot be used with -o DIR; use -o FILE, "
            "or --plot without a file for one figure per record"
        )
    sources = records_of(request.records, request.choice)
    # All outputs are checked before the computation, so that no result is lost.
    from tdint.ground_motion.horizontals import pair_name

    files_of_records = table_type.gather(request, sources.files)
    output = Path(request.output) if request.output else None
    # In a directory each record has a table. Otherwise all records share the table `output` (None
    # for standard output).
    tables: list[Path | None] = [output]
    if output and request.is_folder:
        names = [pair_name(files[0], files[-1]) for files in files_of_records]
        tables = [*tables_of(names, output)]
    output_files = [file for table in tables for file in _outputs(request, table).files]
    check_outputs(output_files, overwrite=request.overwrite)
    tasks = [
        Task(files[0], table, files[1:]) for files, table in zip(files_of_records, cycle(tables))
    ]
    # Dictionaries without values are used as sets that keep the order of insertion.
    notes, warnings = dict.fromkeys(sources.notes), dict[str, None]()
    failures, longest_interval, used = list[TdintError](sources.failures), 0.0, 0
    products: list[RecordTable] = []
    to_terminal = request.output is None
    width = reading_width() if to_terminal else None
    work = partial(_work, request, table_type, width)
    with outcomes(
        work, tasks, jobs=request.jobs, label="spectra", to_terminal=to_terminal
    ) as results:
        for task, outcome in zip(tasks, results, strict=True):
            if isinstance(outcome, TdintError):
                failures.append(outcome)
                continue
            used += 1 + len(task.others)
            notes |= dict.fromkeys(outcome.notes)
            warnings |= dict.fromkeys(outcome.warnings)
            longest_interval = max(longest_interval, outcome.interval)
            if request.is_folder:
                _write(request, table_type, task.table, [outcome])
                continue
            if to_terminal:
                # Text for a terminal has a header for each record, CSV a single header.
                emit(_without_header(outcome.text) if products and not width else outcome.text)
                outcome = replace(outcome, text=b"")
            products.append(outcome)
    if products:
        _write(request, table_type, output, products)
    last_note = table_type.remark(request, longest_interval)
    warn(*warnings)
    note(*filter(None, (*notes, last_note)), *sources.count_notes(used))
    if failures:
        from tdint.ground_motion.horizontals import combine_single_components

        raise Failures(combine_single_components(failures))


def _outputs(request: TablesRequest, table: Path | None) -> Outputs:
    """Return the paths of a table, its figure and its JSON file. `table` is `None` without -o."""
    picture = picture_file(request.plot, table)
    return Outputs(table, picture, beside(table, ".json") if table else None, request.overwrite)


def _work(
    request: TablesRequest, table_type: TableType, width: int | None, task: Task
) -> RecordTable:
    """Read a record and compute its table, and its figure if each record has a separate figure.

    This function may run in a worker process.

    `width` is the width of the terminal in characters; None for CSV.
    """
    from tdint.output.summary import record_summary

    records = [record for file in (task.source, *task.others) for record in request.read(file)]
    results = table_type.compute(request, records)
    lines = tuple(results.lines)
    table = table_type.table(request, lines).in_units(request.shown_units)
    return RecordTable(
        text=table_bytes(table, width),
        meanings=table.meanings,
        records=tuple(map(record_summary, results.records)),
        notes=(*notes_of_components(results.records, lambda record: record.notes), *results.notes),
        interval=max(record.dt for record in results.records),
        warnings=notes_of_components(results.records, lambda record: record.warnings),
        results=() if request.is_folder or not request.plot else lines,
        picture=_picture(request, table_type, lines, SUFFIX)
        if request.is_folder and request.plot
        else None,
    )


def _picture(
    request: TablesRequest, table_type: TableType, results: Sequence[Any], suffix: str
) -> bytes:
    """Return the figure of some results as bytes, in the format of a file name suffix."""
    stream = BytesIO()
    figures.style.picture(suffix, lambda: table_type.picture(request, results))(stream)
    return stream.getvalue()


def _write(
    request: TablesRequest,
    table_type: TableType,
    table: Path | None,
    products: Sequence[RecordTable],
) -> None:
    """Write a table with the rows of several records, its JSON file and its figure.

    `table` is the file of the table; None to write only the figure.
    """
    from tdint.output.summary import table_summary

    outputs = _outputs(request, table)
    contents: dict[Path, bytes] = {}
    if outputs.table and outputs.summary:
        records = [record for product in products for record in product.records]
        summary = table_summary(
            str(click.get_current_context().info_name),
            request.settings(),
            records,
            products[0].meanings,
        )
        rows = [_without_header(product.text) for product in products[1:]]
        contents[outputs.table] = b"".join([products[0].text, *rows])
        # The descriptions of the columns are already in the requested units, and are not converted
        # again.
        converted = {"columns": summary["columns"]}
        contents[outputs.summary] = options.output.summary_bytes(
            summary, request.shown_units, converted=converted
        )
    if outputs.picture:
        results = [result for product in products for result in product.results]
        # A product contains a figure only with -o DIR. It is then the only product of its table.
        # Otherwise one figure shows the results of all records.
        contents[outputs.picture] = products[0].picture or _picture(
            request, table_type, results, outputs.picture.suffix
        )
    write_files(contents, overwrite=request.overwrite)


def _without_header(csv: bytes) -> bytes:
    """Return CSV text without its first line."""
    return csv.partition(b"\n")[2]


def tables_of(
    files: Sequence[str],
    folder: Path,
    suffix: str = ".csv",
    one_file: str = "-o FILE for one table",
) -> list[Path]:
    """Return the output file in a directory for each record; `one_file` is the remedy in the error.

    The name of the file is the name of the record without its suffix, or with its suffix if
    several records have the same stem.

    Raises
    ------
    OutputError
        Two records would be written to the same file.
    """
    stems = ["stdin" if file == STDIN else Path(file).stem for file in files]
    count = Counter(stems)
    record_of_table: dict[Path, str] = {}
    for file, stem in zip(files, stems, strict=True):
        name = stem if count[stem] == 1 or file == STDIN else Path(file).name
        table = folder / f"{name}{suffix}"
        if table in record_of_table:
            raise OutputError(
                f"{table}: both {record_of_table[table]} and {file} would be written to this file; "
                f"use {one_file} of all records, or separate calls with separate directories"
            )
        record_of_table[table] = file
    return list(record_of_table)


# ---- Spectrum


@options.command
@options.record.optional_record_options
@options.record.one_scale
@options.spectra.tables_of_records(AXES)
@options.of(SpectrumRequest)
def command(request: SpectrumRequest) -> None:
    """Compute elastic, inelastic or Fourier spectra of ground-motion records.

    RECORD is a file, a directory (all records in it), or - for standard input. All components are
    used unless --component selects one. CSV: relative displacement, pseudo-velocity,
    pseudo-acceleration, relative velocity and absolute acceleration: maxima also between the
    samples and in the free vibration after the last sample. The values are exact for a ground
    motion that is linear between its samples and at rest after them; with --method they are
    integrated with the sampling interval as time step. If a record fails, the remaining records are
    processed.

    --ductility, --strength and --reduction write a different table, for oscillators with bilinear
    hysteresis: yield force divided by weight, ductility, residual displacement, maximum and yield
    displacement, yield force divided by mass, and maximum elastic force divided by yield force.

    --rotd writes a different table, for two horizontal components: percentiles of the
    pseudo-acceleration over 180 directions, the geometric mean of both components, and the
    direction of the maximum, in degrees from the first named component towards the second. The
    components are in one file, in two files with matching names (K-NET, PEER, channel codes), or
    in the only two files given.

    --fourier writes a different table: the amplitude of the Fourier transform of the acceleration
    (sampling interval times the sum), smoothed over the frequency (Konno and Ohmachi 1998) unless
    --smoothing is none.

    --target without RECORD writes a table of the design spectrum: displacement, pseudo-velocity,
    pseudo-acceleration.

    --against writes a different table: one column of a published spectrum, and the computed values
    at its periods.
    """
    if not request.records:
        _write_target(request)
        return
    # Use the first type of table that is requested; the options of the other types are refused.
    table_type: TableType = Elastic()
    mode = "elastic"
    choices: tuple[tuple[Any, str, type[TableType]], ...] = (
        (request.fourier, "fourier", Fourier),
        (request.against, "against", Against),
        (request.ductility or request.strength or request.reduction, "inelastic", Inelastic),
        (request.rotd, "rotated", Rotated),
    )
    for option_value, name, requested_type in choices:
        if option_value:
            mode, table_type = name, requested_type()
            break
    refuse_idle(mode)
    make_tables(request, table_type)


def _write_target(request: SpectrumRequest) -> None:
    """Write the table of a target spectrum, and its figure if requested. UsageError is raised if
    neither RECORD nor --target is given, or an option requires records.
    """
    target = request.target_spectrum
    if target is None:
        raise UsageError(
            "Missing argument 'RECORD...'. Add record files, or --target SPECTRUM to write the "
            "table of a target spectrum."
        )
    refuse_idle("target")
    if request.is_folder:
        raise UsageError(
            f"-o {request.output}: must be a file, because --target without RECORD writes one table"
        )
    outputs = Outputs.checked(
        request.output, request.plot, request.overwrite, units=request.output_units
    )
    # Use the requested periods, otherwise the periods of the target. A formula also has a value at
    # the period 0.
    if request.periods is not None:
        periods = request.chosen_periods()
        if min(periods) <= 0.0 and target.curve is None:
            raise UsageError(
                "--period 0: the periods of a target given as a table must be positive; remove 0"
            )
        target = replace(target, periods=periods, psa=target.at(periods))
    elif target.curve:
        import numpy as np

        target = replace(
            target,
            periods=np.append(0.0, target.periods),
            psa=np.append(target.at([0.0]), target.psa),
        )
    # A logarithmic axis cannot show the period 0.
    drawn = replace(
        target, periods=target.periods[target.periods > 0.0], psa=target.psa[target.periods > 0.0]
    )
    from tdint.output.summary import table_summary
    from tdint.output.tables.spectra import TARGET
    from tdint.output.tables.table import Table

    table = Table.of_results(TARGET, [target])
    settings = {"target": target.source, "damping": target.damping}
    outputs.deliver(
        table,
        lambda: figures.spectrum_curves.target_picture(drawn, request.shown_units),
        lambda: table_summary("spectrum", settings, [], table.meanings),
    )
