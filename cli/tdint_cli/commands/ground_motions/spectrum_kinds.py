"""What `tdint spectrum` makes of each record: elastic, inelastic and rotated spectra, or one beside a published one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

from tdint.analysis.defaults import PERIODS, STEPS_PER_PERIOD
from tdint.errors import RecordError, UsageError
from tdint.input_bytes import STDIN
from tdint.output import figures, tables
from tdint_cli.commands.ground_motions.spectrum_request import Kind, Results, SpectrumRequest
from tdint_cli.options.headings import BESIDE
from tdint_cli.terminal import note

if TYPE_CHECKING:
    from tdint.analysis.spectra.elastic import OscillatorMotion, Spectrum
    from tdint.analysis.spectra.inelastic import InelasticSpectrum
    from tdint.analysis.spectra.published import SpectrumDifference
    from tdint.analysis.spectra.rotated import RotatedSpectrum
    from tdint.ground_motion.record import Record
    from tdint.output.figures.style import Figure
    from tdint.output.tables.table import Table

Function = TypeVar("Function", bound=Callable[..., Any])


class _OfOscillators(Kind):
    """Spectra over the periods that a command line asks for, with a remark on these."""

    def remark(self, request: SpectrumRequest, interval: float) -> str:
        """What a person should know of the periods."""
        return "; ".join(filter(None, (_between_samples(request, interval), _between_periods(request))))


class Elastic(_OfOscillators):
    """Elastic spectra of single components."""

    def check(self, request: SpectrumRequest) -> None:
        """Refuse, before any work, what makes no sense together."""
        _ = request.manner
        if request.aim and not request.plot:
            raise UsageError("--target beside records is drawn: add --plot; without records its table is written")
        if request.aim and request.axes not in (None, "periods"):
            raise UsageError("--target is drawn over the period; leave --axes out")

    def compute(self, request: SpectrumRequest, records: Sequence[Record]) -> Results:
        """The spectra of each component with each damping ratio."""
        from tdint.analysis.spectra.elastic import spectrum

        periods = request.chosen_periods(PERIODS)
        lines = [
            spectrum(
                record,
                periods,
                damping,
                method=request.method,
                maxima=request.maxima,
                interpolation=request.interpolation,
            )
            for record in records
            for damping in request.damping
        ]
        return Results(lines, records)

    def table(self, request: SpectrumRequest, lines: Sequence[Spectrum]) -> Table:
        """A row for each spectrum and period."""
        return tables.spectra.spectrum_table(lines, request.stated)

    def picture(self, request: SpectrumRequest, lines: Sequence[Spectrum]) -> Figure:
        """A line for each spectrum."""
        axes = request.axes or "periods"
        return figures.spectrum_curves.spectrum_picture(lines, axes, request.shown_units, request.aim)


class Inelastic(_OfOscillators):
    """Inelastic spectra: oscillators with bilinear hysteresis, of given ductility or of given strength."""

    def check(self, request: SpectrumRequest) -> None:
        """Refuse, before any work, what makes no sense together."""
        if request.ductility and request.strength:
            raise UsageError("--ductility and --strength are given; leave one of them out")
        elastic = ("axes", "rotd", "method", "maxima", "interpolation", "target")
        request.refuse(elastic, "is for elastic spectra; leave it out with --ductility and --strength")

    def compute(self, request: SpectrumRequest, records: Sequence[Record]) -> Results:
        """The spectra of each component with each damping ratio, and ductility or strength."""
        from tdint.analysis.spectra.inelastic import constant_ductility, constant_strength

        periods = request.chosen_periods(PERIODS)
        hardening = request.hardening or 0.0
        lines: list[InelasticSpectrum] = []
        for record in records:
            for damping in request.damping:
                if request.ductility:
                    lines += constant_ductility(record, periods, request.ductility, damping, hardening=hardening)
                else:
                    lines += constant_strength(record, periods, request.strength or (), damping, hardening=hardening)
        return Results(lines, records)

    def table(self, _: SpectrumRequest, lines: Sequence[InelasticSpectrum]) -> Table:
        """A row for each spectrum and period."""
        return tables.spectra.inelastic_table(lines)

    def picture(self, request: SpectrumRequest, lines: Sequence[InelasticSpectrum]) -> Figure:
        """A line for each spectrum."""
        return figures.spectrum_curves.inelastic_picture(lines, request.shown_units)


class Histories(Kind):
    """The motion of oscillators at the samples of single components."""

    def check(self, request: SpectrumRequest) -> None:
        """Refuse, before any work, what makes no sense together."""
        others = ("axes", "rotd", "method", "maxima", "interpolation", "target", "plot", "periods", "period")
        request.refuse(others, "is for spectra; leave it out with --oscillator")
        if request.history != BESIDE:
            raise UsageError(f"--history {request.history}: the table goes to -o; write -o {request.history} --history")

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

    def table(self, _: SpectrumRequest, lines: Sequence[OscillatorMotion]) -> Table:
        """A row for each oscillator and sample."""
        return tables.table.Table.of_results(tables.spectra.OSCILLATOR, lines)


class Rotated(_OfOscillators):
    """Spectra of two horizontal components together, over all directions."""

    def check(self, request: SpectrumRequest) -> None:
        """Refuse, before any work, what makes no sense together."""
        request.refuse(("axes", "method", "component"), "is for single components; leave it out with --rotd")
        Elastic().check(request)

    def gather(self, request: SpectrumRequest, files: Sequence[str]) -> list[tuple[str, ...]]:
        """The files of each motion: those that are named alike but for the component, in the order of the first ones.

        Two files of a single horizontal component each are one motion, too, whatever their names are.
        """
        from tdint.ground_motion.pairing import USUAL, files_of_motions

        result, others = files_of_motions(files, request.pairs or USUAL)
        if others:
            note(f"left out, named otherwise than --pairs says: {', '.join(others)}")
        if len(files) == len(result) == 2 and STDIN not in files and all(_is_single(request, file) for file in files):
            return [tuple(files)]
        return result

    def compute(self, request: SpectrumRequest, records: Sequence[Record]) -> Results:
        """The spectra of the two horizontals among the components of a motion, for each damping ratio."""
        from tdint.analysis.spectra.rotated import rotated_spectrum
        from tdint.ground_motion.horizontals import find_horizontals
        from tdint.ground_motion.pairing import with_component

        motion = find_horizontals([with_component(record) for record in records])
        periods = request.chosen_periods(PERIODS)
        lines = [
            rotated_spectrum(
                motion,
                periods,
                damping,
                request.rotd or (),
                maxima=request.maxima,
                interpolation=request.interpolation,
            )
            for damping in request.damping
        ]
        return Results(lines, (motion.first, motion.second), [f"{motion.source}: {note}" for note in motion.notes])

    def table(self, request: SpectrumRequest, lines: Sequence[RotatedSpectrum]) -> Table:
        """A row for each damping ratio and period."""
        return tables.spectra.rotated_table(lines, request.stated)

    def picture(self, request: SpectrumRequest, lines: Sequence[RotatedSpectrum]) -> Figure:
        """A line for each percentile."""
        return figures.spectrum_curves.rotated_picture(lines, request.shown_units, request.aim)


class Against(Kind):
    """Elastic spectra beside a published one."""

    def check(self, request: SpectrumRequest) -> None:
        """Refuse, before any work, what makes no sense together."""
        Elastic().check(request)
        request.refuse(
            ("axes", "rotd", "ductility", "strength", "target"),
            "has no published spectrum beside it; leave --against out",
        )
        for ratio in request.damping:
            request.published(ratio)

    def compute(self, request: SpectrumRequest, records: Sequence[Record]) -> Results:
        """The spectra of each component with each damping ratio, and the published values."""
        from tdint.analysis.spectra.published import differences

        log_log = request.against_interpolation is not None
        own = request.periods is not None or bool(request.period)
        lines: list[SpectrumDifference] = []
        for ratio in request.damping:
            published = request.published(ratio)
            of_ratio = replace(request, damping=(ratio,))
            if not own:
                of_ratio = replace(of_ratio, period=tuple(published.periods.tolist()))
            lines += differences(Elastic().compute(of_ratio, records).lines, published, log_log)
        return Results(lines, records, [_largest(line) for line in lines])

    def table(self, request: SpectrumRequest, lines: Sequence[SpectrumDifference]) -> Table:
        """A row for each spectrum and period."""
        return tables.spectra.difference_table(lines)

    def picture(self, request: SpectrumRequest, lines: Sequence[SpectrumDifference]) -> Figure:
        """Both spectra, and their difference."""
        return figures.spectrum_curves.difference_picture(lines, request.shown_units)


def _between_periods(request: SpectrumRequest) -> str:
    """On a grid that nobody chose and that is coarser than half the width of resonance, which is the damping ratio."""
    if request.period or request.periods is not None:
        return ""
    periods = request.chosen_periods(PERIODS)
    apart, damping = float(periods[1] / periods[0]) - 1.0, min(request.damping)
    if apart <= damping * (1.0 + 1e-9):
        return ""
    return (
        f"the periods are {100.0 * apart:.2g} % apart: with {100.0 * damping:.3g} % damping the spectrum may be higher "
        "between them; --periods takes more"
    )


def _between_samples(request: SpectrumRequest, interval: float) -> str:
    """On periods at which the ground motion between the samples matters."""
    periods = request.chosen_periods(PERIODS)
    limit = STEPS_PER_PERIOD * interval
    if not any((periods > 0.0) & (periods < limit * (1.0 - 1e-9))):
        return ""
    manner = request.manner
    return (
        f"below a period of {limit:.6g} s ({STEPS_PER_PERIOD} sampling intervals) the ground motion between its "
        f"samples matters: taken as {manner.interpolation.words}, maxima {manner.maxima.words}"
    )


def _is_single(request: SpectrumRequest, file: str) -> bool:
    from tdint.ground_motion.horizontals import is_vertical
    from tdint.ground_motion.reading.read import read_records

    try:
        records = read_records(file, units=request.units, inventory=request.inventory, layout=request.layout)
    except RecordError:
        return False  # It will be told when its turn comes.
    return sum(not is_vertical(record.component) for record in records) == 1


def _largest(line: SpectrumDifference) -> str:
    where = line.record.name
    if line.largest is None:
        return f"{where}: the published spectrum is zero"
    difference, period = line.largest
    return (
        f"{where}, damping {line.damping:g}: largest difference of {line.published.quantity} to "
        f"{line.published.source} {100.0 * difference:+.3g} % at {period:.4g} s"
    )
