"""What `tdint spectrum` makes of each record: elastic, inelastic and rotated spectra, or one beside
a published one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import click

from tdint.analysis.defaults import MOST_DUCTILE, PERIODS, STEPS_PER_PERIOD
from tdint.errors import RecordError, UsageError
from tdint.files import STDIN
from tdint.output import figures, tables
from tdint.written_numbers import Grid, parse_positive
from tdint_cli import options
from tdint_cli.options import grammar
from tdint_cli.options.grammar import BESIDE, FileName, ListOf, Mode, Number, Ratio, pair_names
from tdint_cli.options.record import NAMES, RecordsRequest
from tdint_cli.terminal import note

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tdint.analysis.spectra.elastic import Spectrum, SpectrumSettings
    from tdint.analysis.spectra.fourier import FourierSpectrum
    from tdint.analysis.spectra.inelastic import InelasticSpectrum
    from tdint.analysis.spectra.rotated import RotatedSpectrum
    from tdint.analysis.spectra.target import PublishedSpectrum, SpectrumDifference, TargetSpectrum
    from tdint.ground_motion.horizontals import PairNames
    from tdint.ground_motion.record import Record
    from tdint.output.figures.style import Figure
    from tdint.output.tables.table import Table
    from tdint.units import OutputUnits


# ---- The command lines of `spectrum` and `drift-spectrum`, and what a kind of table over the
# period must do with them

AXES = options.output.option(
    "--axes",
    needs="--plot",
    type=click.Choice(["periods", "tripartite", "adrs"]),
    rare=True,
    help="Axes of the picture of elastic spectra: PSA and SD over the period (periods, the "
    "default), PSV over it with scales of the other two (tripartite), or PSA over SD (adrs).",
)

_NOT_SETTINGS = (
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
    """What a command makes of one record.

    Attributes
    ----------
    lines : sequence
        Its results, one per line of a picture.
    records : sequence of Record
        The components that they are of.
    notes : sequence of str
        What there is to say beside the notes of the components.
    """

    lines: Sequence[Any]
    records: Sequence[Record]
    notes: Sequence[str] = ()


class Kind(Protocol):
    """A kind of table over the period."""

    mode: Mode = Mode("")

    def check(self, request: Any) -> None:
        """Refuse, before any work, a request that makes no sense (UsageError)."""

    def gather(self, request: Any, files: Sequence[str]) -> list[tuple[str, ...]]:
        """From the request and all files the files of each record; here each is a record by
        itself."""
        return [(file,) for file in files]

    def compute(self, request: Any, records: Sequence[Record]) -> Results:
        """The results of the components of one record."""

    def table(self, request: Any, lines: Sequence[Any]) -> Table:
        """The table of results; by default what their class declares, a row for each period, sample
        or frequency."""
        return tables.spectra.result_table(lines)

    def picture(self, request: Any, lines: Sequence[Any]) -> Figure:
        """The figure of results."""
        raise AssertionError("a kind without a picture takes no --plot")

    def remark(self, request: Any, interval: float) -> str:
        """What is to be said at the end for the longest sampling interval of all records (s); empty
        for nothing."""
        return ""


@dataclass(frozen=True)
class TablesRequest(RecordsRequest):
    """What the command lines have in common that make a table over the period of each record, at
    `DEFAULT_PERIODS` where none are asked for."""

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
        """The units of all that is written."""
        from tdint.units import SI

        return self.output_units or SI

    @property
    def is_folder(self) -> bool:
        """Whether -o names a folder."""
        return self.output is not None and options.output.is_folder_name(self.output)

    def settings(self) -> dict[str, Any]:
        """All that the numbers depend on beside the records, for the JSON file."""
        settings = {
            name: value for name, value in asdict(self).items() if name not in _NOT_SETTINGS
        }
        return settings | {
            "periods": options.spectra.periods_as_given(self.periods, self.DEFAULT_PERIODS)
        }

    def chosen_periods(self) -> NDArray[np.float64]:
        """The periods, s."""
        return options.spectra.chosen_periods(self.periods, self.DEFAULT_PERIODS)


def _bandwidth(text: str) -> float:
    """A bandwidth of a smoothing; 0 for none."""
    return (
        0.0
        if text.strip().lower() == "none"
        else parse_positive("the bandwidth of --smoothing", text)
    )


_OF_RECORDS = ("units", "component", "inventory", "layout", "processing", "scale")
"""Settings that Fourier spectra have, too."""


@options.request
class SpectrumRequest(TablesRequest):
    """The command line of `tdint spectrum`."""

    damping: tuple[float, ...] = options.spectra.damping()
    periods: tuple[float | Grid, ...] | None = options.spectra.periods(
        PERIODS, " 0 gives the peak ground acceleration."
    )
    method: str | None = options.analysis.method
    maxima: str | None = options.spectra.option(
        type=click.Choice(["exact", "peer", "samples"]),
        rare=True,
        help="Where the largest values are looked for: between the samples, too (exact, the "
        "default), at ten or more steps per period (peer, as PEER's own spectra), or at the "
        "record's samples (samples, as those of USGS). Not with --method, whose steps have their "
        "own. Adds a column.",
    )
    interpolation: str | None = options.spectra.option(
        type=click.Choice(["linear", "band-limited"]),
        rare=True,
        help="The ground motion between its samples: straight lines (linear, the default), or the "
        "motion without frequencies above half the sampling rate (band-limited). Adds a column.",
    )
    rotd: tuple[int, ...] | None = options.spectra.option(
        type=ListOf(click.IntRange(0, 100)),
        metavar="P,...",
        help="Spectra of two horizontal components instead: these percentiles of the "
        "pseudo-acceleration over all directions, such as 0,50,100 (RotD00, RotD50, RotD100).",
    )
    pairs: PairNames | None = options.spectra.option(
        needs="--rotd",
        type=pair_names,
        rare=True,
        help="How the two files of a motion are named, {} for what they share: "
        "'{}_N.AT2,{}_E.AT2'.",
    )
    ductility: tuple[float, ...] | None = options.spectra.option(
        type=ListOf(Number(1.0, MOST_DUCTILE)),
        metavar="MU,...",
        help="Inelastic spectra instead: the yield strength for each of these ratios of largest "
        "to yield displacement (the largest strength if there are several).",
    )
    strength: tuple[float, ...] | None = options.spectra.option(
        rare=True,
        type=ListOf(Ratio(0.0, min_open=True)),
        help="Inelastic spectra instead: the response for each of these ratios of yield force to "
        "weight.",
    )
    hardening: float | None = options.spectra.option(
        needs="--ductility or --strength",
        type=Ratio(0.0, 1.0, max_open=True),
        rare=True,
        help="With --ductility or --strength: stiffness after yielding over the initial one; 0 by "
        "default (elastoplastic).",
    )
    oscillator: tuple[float, ...] | None = options.spectra.option(
        needs="--history",
        type=ListOf(Number(0.0, min_open=True)),
        metavar="SECONDS,...",
        rare=True,
        help="With --history: the motion of elastic oscillators of these periods instead.",
    )
    history: str | None = options.spectra.option(
        needs="--oscillator",
        metavar="",
        rare=True,
        help="With --oscillator: a row for each sample.",
    )
    target: str | None = options.studies.target(
        "Draw this spectrum over those of the records (--plot) or, without RECORD, write it as a "
        "table",
        grammar.SPECTRUM,
    )
    against: str | None = options.spectra.option(
        type=FileName(),
        rare=True,
        help="Difference to a published spectrum instead: CSV with names in its first line that "
        "say quantity and units (period_s, psa_g; T (s), SD (cm)); at its periods, unless others "
        "are given.",
    )
    against_column: str | None = options.spectra.option(
        needs="--against",
        metavar="NAME",
        rare=True,
        help="Which column of the published spectrum, if it has several.",
    )
    against_interpolation: str | None = options.spectra.option(
        needs="--against",
        type=click.Choice(["log-log"]),
        rare=True,
        help="Take the published spectrum between its periods on straight lines in logarithms.",
    )
    fourier: bool = options.spectra.option(
        help="Fourier amplitude spectra of the acceleration instead."
    )
    smoothing: float | None = options.spectra.option(
        needs="--fourier",
        type=grammar.Written("bandwidth", _bandwidth),
        metavar="B|none",
        rare=True,
        help="With --fourier: bandwidth of the smoothing by Konno and Ohmachi's window; 40 by "
        "default.",
    )
    axes: str | None
    scale: float | None

    def read(self, file: str) -> list[Record]:
        """The components of a file, times the factor that is asked for."""
        horizontals = super().read(file)
        return (
            horizontals
            if self.scale is None
            else [record.scaled(self.scale) for record in horizontals]
        )

    def settings(self) -> dict[str, Any]:
        """As those of all tables, with what is chosen where nothing is given."""
        if self.fourier:
            told = super().settings()
            smoothing = "none" if self.bandwidth is None else self.bandwidth
            return {name: told[name] for name in _OF_RECORDS if name in told} | {
                "fourier": True,
                "smoothing": smoothing,
            }
        manner = self.manner
        # What has no part in this table is told as null, not as its default.
        yields = self.ductility or self.strength
        return super().settings() | {
            "method": self.method or "exact",
            "hardening": self.hardening or 0.0 if yields else None,
            "maxima": manner.maxima.name,
            "interpolation": manner.interpolation.name,
            "against_sha256": self.published(self.damping[0]).input.sha256
            if self.against
            else None,
        }

    @property
    def bandwidth(self) -> float | None:
        """Of the smoothing of Fourier spectra; None for none."""
        from tdint.analysis.spectra.fourier import BANDWIDTH

        return BANDWIDTH if self.smoothing is None else (self.smoothing or None)

    def published(self, damping: float) -> PublishedSpectrum:
        """The published spectrum for a damping ratio."""
        from tdint.analysis.spectra.target import read_published

        assert self.against is not None
        return read_published(self.against, damping, self.against_column)

    @property
    def aim(self) -> TargetSpectrum | None:
        """The target spectrum, if one is asked for."""
        from tdint.analysis.spectra.target import read_target

        return read_target(self.target) if self.target is not None else None

    @property
    def manner(self) -> SpectrumSettings:
        """How elastic spectra are made."""
        from tdint.analysis.spectra.elastic import choose_settings

        return choose_settings(self.method, self.maxima, self.interpolation)

    @property
    def stated(self) -> dict[str, Any]:
        """What was chosen by name and therefore has a column."""
        return {
            name: value
            for name in ("maxima", "interpolation")
            if (value := getattr(self, name)) is not None
        }


# ---- Spectrum kinds

_PERIODS = NAMES | {"damping", "periods", "plot"}
"""What all spectra of records over the period take."""

TARGET = Mode(
    "without RECORD",
    frozenset(("target", "periods", "plot")),
    {"damping": "a design spectrum takes it by name: ec8:...,damping=2%"},
)
"""A target spectrum alone."""


class _OfOscillators(Kind):
    """Spectra over the periods that a command line asks for, with a remark on these."""

    def check(self, request: SpectrumRequest) -> None:
        """Refuse, before any work, what makes no sense together."""
        _ = request.manner
        if request.aim and not request.plot:
            raise UsageError(
                "--target beside records is drawn: add --plot; without records its table is written"
            )
        if request.aim and request.axes not in (None, "periods"):
            raise UsageError("--target is drawn over the period; leave --axes out")

    def remark(self, request: SpectrumRequest, interval: float) -> str:
        """What a person should know of the periods."""
        periods = request.chosen_periods()
        remarks: list[str] = []
        # Periods at which the ground motion between the samples matters
        limit = STEPS_PER_PERIOD * interval
        if any((periods > 0.0) & (periods < limit * (1.0 - 1e-9))):
            manner = request.manner
            remarks.append(
                f"below a period of {limit:.6g} s ({STEPS_PER_PERIOD} sampling intervals) the "
                "ground motion between its samples matters: taken as "
                f"{manner.interpolation.words}, maxima {manner.maxima.words}"
            )
        # A grid that nobody chose and that is coarser than half the width of resonance, which is
        # the damping ratio
        if request.periods is None:
            apart, damping = float(periods[1] / periods[0]) - 1.0, min(request.damping)
            if apart > damping * (1.0 + 1e-9):
                remarks.append(
                    f"the periods are {100.0 * apart:.2g} % apart: with {100.0 * damping:.3g} % "
                    "damping the spectrum may be higher between them; --periods takes more"
                )
        return "; ".join(remarks)


class Elastic(_OfOscillators):
    """Elastic spectra of single components."""

    mode = Mode(
        "with elastic spectra", _PERIODS | {"method", "maxima", "interpolation", "target", "axes"}
    )

    def compute(self, request: SpectrumRequest, records: Sequence[Record]) -> Results:
        """The spectra of each component with each damping ratio."""
        from tdint.analysis.spectra.elastic import spectrum

        periods = request.chosen_periods()
        lines = [
            spectrum(record, periods, damping, method=request.method, **request.stated)
            for record in records
            for damping in request.damping
        ]
        return Results(lines, records)

    def table(self, request: SpectrumRequest, lines: Sequence[Spectrum]) -> Table:
        """A row for each spectrum and period."""
        return tables.spectra.result_table(lines, tuple(request.stated))

    def picture(self, request: SpectrumRequest, lines: Sequence[Spectrum]) -> Figure:
        """A line for each spectrum."""
        axes = request.axes or "periods"
        return figures.spectrum_curves.spectrum_picture(
            lines, axes, request.shown_units, request.aim
        )


class Inelastic(_OfOscillators):
    """Inelastic spectra: oscillators with bilinear hysteresis, of given ductility or of given
    strength."""

    mode = Mode("with --ductility or --strength", _PERIODS | {"ductility", "strength"})

    def check(self, request: SpectrumRequest) -> None:
        """Refuse, before any work, what makes no sense together."""
        if request.ductility and request.strength:
            raise UsageError("--ductility and --strength are given; leave one of them out")

    def compute(self, request: SpectrumRequest, records: Sequence[Record]) -> Results:
        """The spectra of each component with each damping ratio, and ductility or strength."""
        from tdint.analysis.spectra.inelastic import constant_ductility, constant_strength

        periods = request.chosen_periods()
        hardening = request.hardening or 0.0
        lines: list[InelasticSpectrum] = []
        for record in records:
            for damping in request.damping:
                if request.ductility:
                    lines += constant_ductility(
                        record, periods, request.ductility, damping, hardening=hardening
                    )
                else:
                    lines += constant_strength(
                        record, periods, request.strength or (), damping, hardening=hardening
                    )
        return Results(lines, records)

    def picture(self, request: SpectrumRequest, lines: Sequence[InelasticSpectrum]) -> Figure:
        """A line for each spectrum."""
        return figures.spectrum_curves.inelastic_picture(lines, request.shown_units)


class Fourier(Kind):
    """Fourier amplitude spectra of single components."""

    mode = Mode("with --fourier", NAMES | {"fourier", "plot"})

    def compute(self, request: SpectrumRequest, records: Sequence[Record]) -> Results:
        """The spectrum of each component."""
        from tdint.analysis.spectra.fourier import fourier_spectrum

        return Results([fourier_spectrum(record, request.bandwidth) for record in records], records)

    def picture(self, request: SpectrumRequest, lines: Sequence[FourierSpectrum]) -> Figure:
        """A line for each component."""
        return figures.comparison.fourier_picture(lines, request.shown_units)


class Histories(Kind):
    """The motion of oscillators at the samples of single components."""

    mode = Mode("with --oscillator", NAMES | {"damping", "oscillator"})

    def check(self, request: SpectrumRequest) -> None:
        """Refuse, before any work, what makes no sense together."""
        if request.history != BESIDE:
            raise UsageError(
                f"--history {request.history}: the table goes to -o; write -o {request.history} "
                "--history"
            )

    def compute(self, request: SpectrumRequest, records: Sequence[Record]) -> Results:
        """The motion of each oscillator with each damping ratio under each component."""
        from tdint.analysis.spectra.elastic import oscillator_motion

        lines = [
            oscillator_motion(record, period, damping)
            for record in records
            for damping in request.damping
            for period in request.oscillator or ()
        ]
        return Results(lines, records)


class Rotated(_OfOscillators):
    """Spectra of two horizontal components together, over all directions."""

    mode = Mode(
        "with --rotd", (_PERIODS - {"component"}) | {"rotd", "maxima", "interpolation", "target"}
    )

    def gather(self, request: SpectrumRequest, files: Sequence[str]) -> list[tuple[str, ...]]:
        """The files of each motion: those that are named alike but for the component, in the order
        of the first ones.

        Two files of a single horizontal component each are one motion, too, whatever their names
        are.
        """
        from tdint.ground_motion.horizontals import USUAL, files_of_motions

        result, others = files_of_motions(files, request.pairs or USUAL)
        if others:
            note(f"left out, named otherwise than --pairs says: {', '.join(others)}")
        if (
            len(files) == len(result) == 2
            and STDIN not in files
            and all(_is_single(request, file) for file in files)
        ):
            return [tuple(files)]
        return result

    def compute(self, request: SpectrumRequest, records: Sequence[Record]) -> Results:
        """The spectra of the two horizontals among the components of a motion, for each damping
        ratio."""
        from tdint.analysis.spectra.rotated import rotated_spectrum
        from tdint.ground_motion.horizontals import find_horizontals, with_component

        motion = find_horizontals([with_component(record) for record in records])
        periods = request.chosen_periods()
        lines = [
            rotated_spectrum(motion, periods, damping, request.rotd or (), **request.stated)
            for damping in request.damping
        ]
        return Results(
            lines,
            (motion.first, motion.second),
            [f"{motion.source}: {note}" for note in motion.notes],
        )

    def table(self, request: SpectrumRequest, lines: Sequence[RotatedSpectrum]) -> Table:
        """A row for each damping ratio and period."""
        return tables.spectra.rotated_table(lines, tuple(request.stated))

    def picture(self, request: SpectrumRequest, lines: Sequence[RotatedSpectrum]) -> Figure:
        """A line for each percentile."""
        return figures.spectrum_curves.rotated_picture(lines, request.shown_units, request.aim)


class Against(Kind):
    """Elastic spectra beside a published one."""

    mode = Mode("with --against", _PERIODS | {"against", "method", "maxima", "interpolation"})

    def check(self, request: SpectrumRequest) -> None:
        """Refuse, before any work, what makes no sense together."""
        Elastic().check(request)
        for ratio in request.damping:
            request.published(ratio)

    def compute(self, request: SpectrumRequest, records: Sequence[Record]) -> Results:
        """The spectra of each component with each damping ratio, and the published values."""
        from tdint.analysis.spectra.target import differences

        log_log = request.against_interpolation is not None
        lines: list[SpectrumDifference] = []
        for ratio in request.damping:
            # A published spectrum is of one damping ratio: each is held beside its own.
            published = request.published(ratio)
            of_ratio = replace(request, damping=(ratio,))
            if request.periods is None:
                of_ratio = replace(of_ratio, periods=tuple(published.periods.tolist()))
            lines += differences(Elastic().compute(of_ratio, records).lines, published, log_log)
        notes = []
        for line in lines:
            if line.largest is None:
                notes.append(f"{line.record.name}: the published spectrum is zero")
                continue
            difference, period = line.largest
            notes.append(
                f"{line.record.name}, damping {line.damping:g}: largest difference of "
                f"{line.published.quantity} to {line.published.source} {100.0 * difference:+.3g} % "
                f"at {period:.4g} s"
            )
        return Results(lines, records, notes)

    def table(self, request: SpectrumRequest, lines: Sequence[SpectrumDifference]) -> Table:
        """A row for each spectrum and period."""
        return tables.spectra.difference_table(lines)

    def picture(self, request: SpectrumRequest, lines: Sequence[SpectrumDifference]) -> Figure:
        """Both spectra, and their difference."""
        return figures.spectrum_curves.difference_picture(lines, request.shown_units)


MODES = (
    TARGET,
    *(kind.mode for kind in (Elastic, Inelastic, Fourier, Histories, Rotated, Against)),
)


def _is_single(request: SpectrumRequest, file: str) -> bool:
    from tdint.ground_motion.horizontals import is_vertical
    from tdint.ground_motion.reading.read import read_records

    try:
        records = read_records(
            file, units=request.units, inventory=request.inventory, layout=request.layout
        )
    except RecordError:
        return False  # It will be told when its turn comes.
    return sum(not is_vertical(record.component) for record in records) == 1
