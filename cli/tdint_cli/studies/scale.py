"""`tdint scale`: factors that scale ground motions to an intensity or to a target spectrum."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tdint import studies
from tdint.errors import AnalysisError, UsageError
from tdint.files import check_outputs
from tdint.number_parsing import abbreviate, parse_positive
from tdint_cli import options
from tdint_cli.options import option_types
from tdint_cli.options.output import Outputs
from tdint_cli.options.record import RecordsRequest
from tdint_cli.studies import options as study_options
from tdint_cli.studies.options import pair_measure, read_suite
from tdint_cli.terminal import Failures, say, warn

if TYPE_CHECKING:
    from tdint.arrays import Array
    from tdint.grids import Grid
    from tdint.ground_motion.reading.suites import Suite
    from tdint.response.spectra.target import TargetSpectrum
    from tdint.studies.motions.scaling import Scaling
    from tdint.units import OutputUnits

_SI_UNITS = {"acceleration": "m/s^2", "velocity": "m/s", "displacement": "m"}
_EXAMPLES = {"m/s^2": "0.4g", "m/s": "40cm/s", "m": "5cm"}
"""Value of an intensity measure with a unit, by its SI unit."""

_RULES = ("mean", "asce7", "ec8")
_BY_PERIOD = ("asce7", "ec8")


def _measure_value(text: str) -> tuple[str, float]:
    """Return the name of an intensity measure and its value in SI units from a text such as
    pga=0.4g; BadParameter or UsageError for an invalid text."""
    from tdint.response.spectra.elastic import SA_DAMPING
    from tdint.studies.motions.intensity import measure_at, scalable_measures, scaling_obstacle
    from tdint.units import parse_units

    name, _, value = text.partition("=")
    if reason := scaling_obstacle(name):
        raise click.BadParameter(
            f"{name}: ground motions cannot be scaled to this measure, because {reason}"
        )
    if name not in scalable_measures():
        raise click.BadParameter(
            f"{text!r} is not MEASURE=VALUE with {', '.join(scalable_measures())}"
        )
    unit = measure_at(name, SA_DAMPING, 1.0).unit
    # A plug-in may have a measure in a unit that ground motions do not have.
    if unit not in _EXAMPLES:
        return name, parse_positive(name, value.removesuffix(unit))
    try:
        units = parse_units(value)
    except UsageError as error:
        raise click.BadParameter(f"{error}") from None
    if not units.has_factor or _SI_UNITS.get(units.quantity) != unit or not units.scale > 0.0:
        raise click.BadParameter(
            f"{value!r} must be a positive number with a unit of {unit}, such as "
            f"{name}={_EXAMPLES[unit]}"
        )
    return name, units.scale


@options.request
class ScaleRequest(RecordsRequest):
    """The command line of `tdint scale`."""

    spectra: str | None
    outputs: Outputs
    target: str | None = options.spectra.target("Scale to this spectrum")
    range: Grid | None = options.option(type=option_types.span_at(100))
    rule: str | None = options.option()
    building: tuple[str, ...] | None = options.option()
    max_factor: float | None = options.option()
    select: int | None = options.option()
    factor_range: tuple[float, float] | None = options.option()
    per_event: int | None = options.option()
    events: str | None = options.option()
    target_std: str | None = options.option()
    to: tuple[str, float] | None = options.option(
        type=option_types.Written("measure", _measure_value)
    )
    at: float | None = options.option()
    p695: bool = options.option()
    pairs: option_types.PairWish | None = study_options.pairs
    damping: float = options.option(default=0.05)

    def check(self) -> None:
        """Check that the options can be used together.

        Raises
        ------
        UsageError
            No target value is given or several are given, or an option has no effect.
        """
        measure = self.to[0] if self.to else ""
        goals = ["--target"] if self.target else []
        if self.p695:
            goals.append("--p695")
        elif measure:
            goals.append("--to")
        if len(goals) != 1:
            problem = "no target is specified"
            if goals:
                problem = f"{' and '.join(goals)} cannot be used together"
            raise UsageError(f"{problem}; specify one of --target, --to or --p695")
        if self.p695 and measure not in ("", "sa"):
            raise UsageError(
                f"--p695 cannot be used with --to {measure}; use --to sa=VALUE with --at"
            )
        # The rules asce7 and ec8 compare spectra from 0.2 T to 2 T with the period T of the
        # structure, unless --range specifies the periods.
        needs_period = self.rule in _BY_PERIOD and self.range is None
        if measure.startswith("sa") and self.at is None:
            raise UsageError(f"--to {measure} requires a period; add --at SECONDS")
        if self.at is not None and not (measure.startswith("sa") or needs_period):
            raise UsageError(
                "--at requires --to sa or sa-avg, or --rule asce7 or ec8 without --range"
            )
        if self.building and (self.at is not None or self.range is not None):
            raise UsageError(
                f"--building and --{'range' if self.at is None else 'at'} cannot be used together; "
                "omit one"
            )
        if needs_period and self.at is None and not self.building:
            raise UsageError(
                f"--rule {self.rule} compares spectra from 0.2 T to 2 T and requires the period T; "
                "add --at, --building or --range"
            )
        if (self.p695 or self.rule == "asce7") and self.pairs is not None and self.pairs.measure:
            raise UsageError(
                f"--pairs {self.pairs.measure} cannot be used with "
                f"{'--p695' if self.p695 else '--rule asce7'}, which defines the measure of a pair"
            )

    @property
    def pair_wish(self) -> option_types.PairWish | None:
        """Settings for pairs of components; None for single components."""
        from tdint.ground_motion.horizontals import USUAL

        # --p695 and --rule asce7 are defined for pairs, so that --pairs is not required.
        return self.pairs or (
            option_types.PairWish(None, USUAL) if self.p695 or self.rule == "asce7" else None
        )

    @property
    def pair(self) -> str:
        """Name of the measure of a pair of components."""
        return pair_measure(self.pairs)


_SPECTRA = options.option("--spectra")


@options.command
@options.analysis.plugin
@options.record.plain_record_options
@options.output.to_files(picture=True, more=[_SPECTRA])
@options.of(ScaleRequest)
def command(request: ScaleRequest) -> None:
    """Select and scale ground motions to an intensity or to a target spectrum.

    CSV: one factor per component; both components of a pair have the same factor. RECORD is a file
    or a directory (all records in it). The two horizontal components of a ground motion, in one
    file or in files with matching names, have one factor. A campaign reads the table as `factors`.
    With -o, a JSON file next to the table describes the records and the computation of the factors.

    If a record fails, the remaining records are processed, unless the factors depend on the
    complete set (--p695, --rule asce7 and ec8).
    """
    from hashlib import sha256

    from tdint.output.summary import record_summary, table_summary

    request.check()
    outputs, units = request.outputs, request.outputs.shown_units
    spectra = [Path(request.spectra)] if request.spectra else []
    check_outputs([*outputs.files, *spectra], overwrite=outputs.overwrite)
    suite, scaling = _scaled(request)
    if request.max_factor is not None and (larger := scaling.beyond(0.0, request.max_factor)):
        factors = ", ".join(f"{name} {factor:.4g}" for name, factor in larger)
        raise AnalysisError(
            f"factors larger than --max-factor {request.max_factor:g}: {factors}; remove these "
            "ground motions from the suite"
        )
    table = studies.scaling_tables.factor_table(scaling)

    def summarize() -> dict[str, Any]:
        """Return the content of the JSON file.

        With the SHA-256 of the table, `tdint campaign` recognizes the table of the file.
        """
        records = [record_summary(record) for record in suite.records]
        content = table_summary("scale", _settings(request, scaling), records, table.meanings)
        return content | {
            "warnings": _warnings(scaling),
            "factors_sha256": sha256(table.csv()).hexdigest(),
        }

    spectra_table = studies.scaling_tables.scaled_table
    outputs.deliver(
        table,
        lambda: studies.scaling_figures.suite_picture(scaling, units),
        summarize,
        more={file: spectra_table(scaling).in_units(units).csv() for file in spectra},
    )
    say(_summary_text(scaling, units))
    warn(*_warnings(scaling))
    if suite.failures:
        raise Failures(suite.failures)


def _scaled(request: ScaleRequest) -> tuple[Suite, Scaling]:
    """Read the ground motions of the command line, and scale them by the requested rule, or scale
    a selection.

    The target and other tables are read before the records, so that their errors are reported
    immediately. UsageError is raised if the target cannot be read, or does not cover the periods;
    Failures, if the factors depend on a record that cannot be read.
    """
    from tdint.response.pairs import join_pairs
    from tdint.studies.motions.intensity import measure_at
    from tdint.studies.motions.scaling import BOUNDS, scale
    from tdint.studies.motions.selection import named_events, select

    settings: dict[str, Any] = {"damping": request.damping, "pair": request.pair}
    settings["rule"] = "p695" if request.p695 else request.rule or "mean"
    measure = value = None
    if request.target is not None:
        from tdint.response.spectra.target import read_targets

        (target,) = read_targets(request.target, (request.damping,))
        periods = _period_range(request, target).values()
        try:
            target.at(periods)
        except UsageError as error:
            raise UsageError(
                f"{error}; specify the periods for the comparison: --range FIRST:LAST:COUNT"
            ) from None
        target.check_damping(request.damping, "of the records")
        settings |= {"target": target, "periods": periods}
        scatter, event_of_record = _selection_tables(request, periods)
    elif request.to:
        name, value = request.to
        measure = measure_at(name, request.damping, request.at or math.nan)
    suite = read_suite(request.records, request.choice, request.pair_wish)
    motions = join_pairs(suite.motions)
    if request.select is None:
        # Factors that depend on the complete set are invalid if a record is missing.
        if suite.failures and (request.p695 or request.rule in _BY_PERIOD):
            raise Failures(suite.failures)
        return suite, scale(motions, measure, value, **settings)
    # A selection is complete without the missing records.
    scaling = select(
        motions,
        count=request.select,
        factors=request.factor_range or BOUNDS,
        events=named_events(motions, event_of_record) if event_of_record else None,
        per_event=request.per_event,
        scatter=scatter,
        **settings,
    )
    return suite, scaling


def _period_range(request: ScaleRequest, target: TargetSpectrum) -> Grid:
    """Return the periods of the comparison of the spectra with the target, s.

    The range is, in this order of priority: --range; 0.2 to 2 times the period of --at; 0.2 times
    the shortest to 2 times the longest first period of the buildings; all periods of the target.
    """
    from tdint.grids import Grid

    if request.range is not None:
        return request.range
    if request.at is not None:
        return Grid(0.2 * request.at, 2.0 * request.at, 100)
    if not request.building:
        return Grid(float(target.periods[0]), float(target.periods[-1]), 100)
    from tdint.model.building import assemble
    from tdint.model.config.model_file import load_model

    buildings = [assemble(load_model(file)) for file in request.building]
    # The first value of `first_mode` is the circular frequency, rad/s.
    first_periods = [building.first_period for building in buildings]
    return Grid(0.2 * min(first_periods), 2.0 * max(first_periods), 100)


def _selection_tables(request: ScaleRequest, periods: Array) -> tuple[Any, dict[str, str]]:
    """Return the target standard deviation (--target-std) at the periods, s, where the spectra are
    compared with the target, and the event of each record (--events, empty without a table)."""
    import numpy as np

    from tdint.csv_table import read_table

    # The target standard deviation is a number, or the name of a table over the periods.
    scatter: Any = None
    if request.target_std is not None:
        try:
            scatter = float(request.target_std)
        except ValueError:
            table = read_table(
                request.target_std,
                "--target-std must be a number, or a CSV file with the columns period_s and "
                "scatter",
            )
            table.need("period_s", "scatter")
            table_periods = np.array(table.numbers("period_s", positive=True))
            scatter = np.interp(np.log(periods), np.log(table_periods), table.numbers("scatter"))
    if request.events is None:
        return scatter, {}
    table = read_table(request.events, "events are a CSV file with the columns record and event")
    table.need("record", "event")
    records, events = (table.texts(name, empty=False) for name in ("record", "event"))
    return scatter, dict(zip(records, events, strict=True))


def _warnings(scaling: Scaling) -> list[str]:
    """Return warnings about a suite: unusual factors, too few selected motions for the rule."""
    from tdint.studies.motions.scaling import BOUNDS, POSSIBLE, missing_motions

    text = missing_motions(scaling.rule, len(scaling.factors))
    warnings = [f"{text}; select more ground motions"] if text else []
    # Factors that scale to a value of an intensity measure may be larger than factors that scale to
    # a target spectrum.
    bounds, reason = POSSIBLE, "which often indicates incorrect units"
    if scaling.target is not None:
        bounds, reason = BOUNDS, "the range of common practice"
    if unusual := scaling.beyond(*bounds):
        listed = abbreviate([f"{name} {factor:.4g}" for name, factor in unusual], 5)
        warnings.append(f"factors outside {bounds[0]:g} to {bounds[1]:g}, {reason}: {listed}")
    return warnings


def _settings(request: ScaleRequest, scaling: Scaling) -> dict[str, Any]:
    """Return the settings that affect the factors, for the JSON file."""
    periods = scaling.periods
    return {
        "rule": scaling.rule,
        "measure": scaling.measure.name if scaling.measure else None,
        "value": scaling.value,
        "unit": scaling.measure.unit if scaling.measure else None,
        "target": request.target,
        "building": list(request.building or ()),
        "max_factor": request.max_factor,
        "periods_s": None
        if periods is None
        else [float(periods[0]), float(periods[-1]), int(periods.size)],
        "damping": scaling.damping,
        "pairs": None if scaling.noun == "record" else scaling.pair,
        "least_average_over_target": scaling.least[0] if scaling.least else None,
        **(
            {
                "selected": list(scaling.chosen),
                "left_out": scaling.left_out,
                "limits_of_factors": list(scaling.limits),
                "at_limit": {
                    "selected": [name for name, _ in scaling.at_limit],
                    "others": scaling.others_at_limit,
                },
                **({"events": list(scaling.events)} if scaling.events else {}),
            }
            if scaling.chosen
            else {}
        ),
    }


def _summary_text(scaling: Scaling, units: OutputUnits) -> str:
    """Return the summary on standard error: number of records, target and factors."""
    import numpy as np

    from tdint.fractiles import fractiles

    factors, text = scaling.factors, scaling.suite
    if scaling.rule == "p695":
        text += " normalized by peak velocity"
    if scaling.measure is not None and scaling.value is not None:
        median = "median " if scaling.rule == "p695" else ""
        text += (
            f" scaled to {median}{scaling.measure.name} = "
            f"{units.text(scaling.value, scaling.measure.unit)}"
        )
    if scaling.target is not None and scaling.periods is not None:
        text += (
            f" scaled to {scaling.target.source} over {scaling.periods[0]:.4g} to "
            f"{scaling.periods[-1]:.4g} s"
        )
    text += (
        f": factors {np.min(factors):.4g} to {np.max(factors):.4g}, median "
        f"{fractiles(factors, (0.5,))[0]:.4g}."
    )
    if scaling.chosen:
        text += _selection_text(scaling)
    if scaling.least is not None:
        ratio, period = scaling.least
        spectra = "maximum-direction spectra" if scaling.rule == "asce7" else "spectra"
        text += (
            f"\nThe minimum ratio of the average of the {spectra} to the target is "
            f"{100.0 * ratio:.3g} %, at {period:.4g} s."
        )
    return text


def _selection_text(scaling: Scaling) -> str:
    """Return the lines about a selection: its misfit, omitted motions, factors at a limit."""
    import numpy as np

    periods, target, remaining = scaling.periods, scaling.target, scaling.unselected_spectra
    if target is None or periods is None or remaining is None:
        return ""
    # The rows of the spectra are ground motions and the columns are periods.
    ln_sa = np.log(scaling.spectra(periods))
    difference = np.mean(ln_sa, axis=0) - np.log(target.at(periods))
    text = (
        f"\nSelected from {len(scaling.chosen) + len(remaining)}: the mean of ln Sa differs from "
        f"the target by {100.0 * np.sqrt(np.mean(difference**2)):.2g} % (root mean square)"
    )
    if scaling.target_std is not None:
        of_std = np.std(ln_sa, axis=0, ddof=1) - scaling.target_std
        text += f", its standard deviation by {np.sqrt(np.mean(of_std**2)):.2g}"
    text += ". "
    reasons = ", ".join(f"{count} {reason}" for reason, count in scaling.left_out.items() if count)
    text += f"Not considered: {reasons}." if reasons else "No motion was omitted."
    # Factors that are equal to a limit of --factor-range, of selected and of other ground motions
    if scaling.at_limit or scaling.others_at_limit:
        low, high = scaling.limits
        text += (
            f"\nAt a limit of the factors ({low:g} to {high:g}): {len(scaling.at_limit)} of "
            f"{len(scaling.factors)} selected"
        )
        if scaling.at_limit:
            listed = abbreviate([f"{name} {factor:.4g}" for name, factor in scaling.at_limit], 5)
            text += f" ({listed})"
        if len(remaining):
            text += f", {scaling.others_at_limit} of {len(remaining)} others"
        text += "."
    return text
