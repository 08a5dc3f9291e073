"""`tdint match`: ground motions matched to a target spectrum with the smallest change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tdint import studies
from tdint.errors import AnalysisError, UsageError
from tdint.files import check_outputs
from tdint.number_parsing import pluralize
from tdint_cli import options
from tdint_cli.options.option_types import PairWish, Ratio, pairs_of
from tdint_cli.options.output import Outputs
from tdint_cli.options.record import RecordsRequest
from tdint_cli.studies.options import read_table_of_factors
from tdint_cli.terminal import Failures, note, progress_bar, say, warn

if TYPE_CHECKING:
    from tdint.ground_motion.origin import MotionOrigin
    from tdint.ground_motion.record import Record
    from tdint.output.tables.table import Table
    from tdint.response.spectra.target import TargetSpectrum
    from tdint.studies.motions.matching import Match

MATCHED, PICTURE = "matched.csv", "matched.png"
SUITES = ("each", "mean")

PAIR = "rotd100"
"""Intensity measure of a pair. The matching requires its derivatives, which are implemented only
for RotD100."""

_MAX_CHANGE = 1.0
"""Size of the added wavelets divided by the size of the ground motion. If it is larger, the record
is not similar to the target, and a warning recommends another record."""

_MAX_PGA_RATIO = 1.2
"""Peak ground acceleration of a match divided by that of the target, above which a warning is
printed. It exceeds the misfit that a match usually has at its shortest period."""

_MAX_PGD_RATIO = 2.0
"""Peak ground displacement after matching divided by its value before. A larger ratio causes a
warning, because wavelets of long periods can produce unrealistic displacements."""


@options.request
class MatchRequest(RecordsRequest):
    """The command line of `tdint match`."""

    output: str | None = options.output.output
    target: str = options.option(required=True)
    range: tuple[float, float] = options.option(default="0.05:4")
    damping: tuple[float, ...] = options.option(default=(0.05,))
    format: str = options.option(default="mseed")
    pairs: PairWish | None = options.option(type=pairs_of((PAIR,)), metavar=f"{PAIR}[,NAMES]")
    suite: str = options.option(type=click.Choice(SUITES), default=SUITES[0])
    factors: str | None = options.option()
    max_misfit: float = options.option(type=Ratio(0.0, 1.0, min_open=True), default="5%")
    require: bool = options.option()
    plot: str | None = options.output.plot
    overwrite: bool = options.option()


@options.command
@options.record.optional_plain_record_options
@options.of(MatchRequest)
def command(request: MatchRequest) -> None:
    """Match ground motions to a target spectrum with the smallest changes.

    RECORD is a file, or a directory (all records in it). All horizontal components are matched
    unless --component selects one; with --pairs, the two components are matched together. Each
    ground motion is first scaled by a constant factor (the scaled seed). Small wavelets are then
    added to the strong part, such that the maximum response at each period equals the target. With
    --suite mean, only the mean spectrum of the ground motions is matched to the target. The table
    lists the misfit over 1000 periods, and compares the intensity measures of the matched motion
    with the scaled seed. If matching would increase the misfit, the scaled seed is written
    unchanged.
    """
    from tdint.ground_motion.origin import written_motion
    from tdint.response.spectra.target import read_targets
    from tdint.studies.motions.matching import match, match_suite
    from tdint.studies.motions.motion_files import motion_contents, motion_file_names

    # A missing option or an existing output file must not be detected after a long computation.
    if request.output is None:
        raise UsageError("-o DIR is required: the directory for the matched ground motions")
    folder = Path(request.output)
    outputs = Outputs.checked(str(folder / MATCHED), request.plot, request.overwrite)
    targets = read_targets(request.target, request.damping)
    suite, factors = read_table_of_factors(
        request.records, request.factors, request.choice, request.pairs
    )
    files = [folder / name for name in motion_file_names(suite.motions, request.format)]
    check_outputs(files, overwrite=request.overwrite)
    matching_options: dict[str, Any] = {"periods": request.range, "damping": request.damping}
    with progress_bar(to_terminal=False) as show_progress:
        if request.suite == "mean":
            matches = match_suite(
                suite.motions,
                targets,
                factors=factors.common_factors(suite.motions) if factors else None,
                progress=lambda done, total: show_progress("matching", done / total),
                **matching_options,
            )
        else:
            count = len(suite.motions)

            def show(number: int, done: int, total: int) -> None:
                """Show the progress over all motions after `done` of `total` steps of a motion."""
                show_progress(f"motion {number + 1}/{count}", (number + done / total) / count)

            matches = [
                match(motion, targets, progress=partial(show, number), **matching_options)
                for number, motion in enumerate(suite.motions)
            ]
    table = studies.matching_tables.match_table(matches)

    origins = _origins(request, matches)
    contents, notes = motion_contents(
        [matched.record for matched in matches], request.format, origins
    )
    written = [
        written_motion(file.name, content, "", origin)
        for file, content, origin in zip(files, contents, origins, strict=True)
    ]
    note(*notes)
    outputs.deliver(
        table,
        lambda: studies.matching_figures.match_picture(matches[0]),
        lambda: _summary(request, suite.records, written, table),
        more=dict(zip(files, contents, strict=True)),
    )
    _report(request, matches, targets)
    above_max_misfit = [
        matched.seed.name
        for matched in matches
        if any(spectrum.largest_misfit > request.max_misfit for spectrum in matched.by_damping)
    ]
    if suite.failures:
        raise Failures(suite.failures)
    if request.require and above_max_misfit:
        raise AnalysisError(
            f"the misfit after matching exceeds {100.0 * request.max_misfit:g} % (--max-misfit): "
            f"{', '.join(above_max_misfit)}; use another record, or a narrower --range"
        )


def _origins(request: MatchRequest, matches: Sequence[Match]) -> list[MotionOrigin]:
    """Return the origin of each component of the matched motions, with the warnings about it.

    The warnings omit their subject, because they are reported with the file of the component.
    """
    origins = []
    for matched in matches:
        texts = [text.partition(": ")[2] for text in _warnings(matched, request.max_misfit)]
        # The change and the misfits of a pair are values of both components together.
        origin = matched.origin(texts)
        for part in matched.parts:
            seed = part.seed
            origins.append(origin._replace(seed=seed.source, seed_component=seed.component))
    return origins


def _summary(
    request: MatchRequest,
    records: Sequence[Record],
    written: Sequence[Mapping[str, Any]],
    table: Table,
) -> dict[str, Any]:
    """Return the content of the JSON file of a match: settings, records and written files.

    `records` contains the records before scaling and matching; `written` contains the entries of
    the written files with their origins.
    """
    from tdint.ground_motion.origin import WRITTEN
    from tdint.output.summary import record_summary, table_summary

    settings: dict[str, Any] = {
        "target": request.target,
        "range_s": list(request.range),
        "damping": request.damping[0] if len(request.damping) == 1 else list(request.damping),
        "format": request.format,
        "max_misfit": request.max_misfit,
        "suite": request.suite,
        "pairs": PAIR if request.pairs else None,
    }
    seeds = list(map(record_summary, records))
    return table_summary("match", settings, seeds, table.meanings) | {
        "motions": [entry["file"] for entry in written],
        WRITTEN: list(written),
    }


def _report(
    request: MatchRequest, matches: Sequence[Match], targets: Sequence[TargetSpectrum]
) -> None:
    """Write the misfits of all matched ground motions to the terminal, with warnings."""
    for matched in matches:
        # The representation of a match is a sentence in angle brackets.
        say(repr(matched)[1:-1] + ".")
        warn(*_warnings(matched, request.max_misfit))
    note(
        "a good fit is not sufficient for design: building codes also specify the number of "
        "ground motions, their sources, and near-fault pulses"
    )
    if request.suite == "mean":
        for number, target in enumerate(targets):
            say(_mean_sentence([matched.by_damping[number] for matched in matches], target))


def _mean_sentence(matches: Sequence[Match], target: TargetSpectrum) -> str:
    """Return a sentence with the misfit of the mean spectrum of a suite and with its scatter.

    The scatter is the standard deviation of ln Sa over the motions, averaged over the periods,
    before and after matching.
    """
    import numpy as np

    # Each row belongs to a ground motion, each column to a period.
    matched_psa = np.array([matched.psa for matched in matches])
    seed_psa = np.array([matched.seed_psa for matched in matches])
    misfit = np.abs(np.mean(matched_psa, axis=0) / target.at(matches[0].periods) - 1.0)
    text = (
        f"At {100.0 * matches[0].damping:g} % damping the mean spectrum of "
        f"{pluralize(len(matches), 'ground motion')} differs from the target by at most "
        f"{100.0 * np.max(misfit):.2g} %, on average by {100.0 * np.mean(misfit):.2g} %"
    )
    # The scatter is defined for two or more motions.
    if len(matches) < 2:
        return f"{text}."
    seed_scatter, matched_scatter = (
        float(np.mean(np.std(np.log(psa), axis=0, ddof=1))) for psa in (seed_psa, matched_psa)
    )
    return (
        f"{text}; standard deviation of ln Sa {seed_scatter:.3f} before matching, "
        f"{matched_scatter:.3f} after."
    )


def _warnings(matched: Match, max_misfit: float) -> list[str]:
    """Return the warnings about a misfit of a match above `max_misfit` (fraction of the target), a
    large change, a large ground displacement or a doubtful baseline."""
    from tdint.ground_motion.measures import baseline_notes

    subject = matched.seed.name
    warnings = [
        f"{subject}: the largest misfit after matching is {100.0 * spectrum.largest_misfit:.2g} % "
        f"({100.0 * spectrum.damping:g} % damping), more than --max-misfit "
        f"{100.0 * max_misfit:g} %; use another record, or a narrower --range"
        for spectrum in matched.by_damping
        if spectrum.largest_misfit > max_misfit
    ]
    if matched.change > _MAX_CHANGE:
        warnings.append(
            f"{subject}: the added wavelets are {matched.change:.3g} times as large as the "
            "ground motion itself; choose a record with a more similar spectrum"
        )
    # The components of a pair are compared separately.
    target_pga = matched.target.zero
    for component in matched.parts:
        subject = component.seed.name
        matched_measures, seed_measures = component.measures
        if target_pga and matched_measures.pga > _MAX_PGA_RATIO * target_pga:
            warnings.append(
                f"{subject}: the peak ground acceleration of the match is "
                f"{matched_measures.pga / target_pga:.3g} times that of the target, because the "
                "match begins at a longer period; begin --range at a shorter period"
            )
        if matched_measures.pgd > _MAX_PGD_RATIO * seed_measures.pgd:
            warnings.append(
                f"{subject}: matching increases the peak ground displacement to "
                f"{matched_measures.pgd / seed_measures.pgd:.2g} times its initial value"
            )
        warnings += [
            f"{component.after.name}, matched: {text}" for text in baseline_notes(component.after)
        ]
    return warnings
