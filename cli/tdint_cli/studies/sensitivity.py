"""`tdint sensitivity`: the sensitivity of peak responses to building parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tdint import studies
from tdint.errors import UsageError
from tdint.files import digest_of, is_folder, record_digest
from tdint.number_parsing import pluralize
from tdint.system import processors
from tdint_cli import options
from tdint_cli.options.analysis import assignments, warn_of_unit
from tdint_cli.options.grammar import refuse_idle
from tdint_cli.options.option_types import FileName
from tdint_cli.options.output import Outputs
from tdint_cli.options.record import RecordsRequest
from tdint_cli.terminal import Failures, note, note_of_runs, say

if TYPE_CHECKING:
    from tdint.model.definition import Model


def _ranges(
    ctx: click.Context, parameter: click.Parameter, texts: tuple[str, ...]
) -> dict[str, tuple[str, str]]:
    """Split the values of --vary (click callback): NAME=LOW:HIGH, separated by commas."""
    ranges: dict[str, tuple[str, str]] = {}
    for name, text in assignments(texts, _range_error).items():
        low, colon, high = text.partition(":")
        if not (colon and low.strip() and high.strip()):
            raise _range_error(f"{name}={text}")
        ranges[name] = low.strip(), high.strip()
    return ranges


def _range_error(text: str) -> UsageError:
    """Return the error of a value of --vary."""
    return UsageError(
        f"--vary {text!r} must be NAME=LOW:HIGH with LOW less than HIGH, such as damping=2%:5% or "
        "stiffness_factor=0.8:1.2"
    )


def _si_ranges(
    model: Model, ranges: Mapping[str, tuple[str, str]]
) -> dict[str, tuple[float, float]]:
    """Return the ranges of --vary in SI units: numbers without a unit are in units of the model, as
    in its file, which a line reports if these are not SI units."""
    si_ranges: dict[str, tuple[float, float]] = {}
    for name, texts in ranges.items():
        low, high = (model.file_value(name, text) for text in texts)
        if not low < high:
            raise _range_error(f"{name}={':'.join(texts)}")
        si_ranges[name] = low, high
        warn_of_unit(model, "--vary", name, texts)
    return si_ranges


@options.request
class Request(RecordsRequest):
    """The command line of `tdint sensitivity`."""

    building: str
    outputs: Outputs
    ranges: dict[str, tuple[str, str]] = options.option("--vary", multiple=True, callback=_ranges)
    method: str | None = options.analysis.method
    dt: float | None = options.option()


@options.command
@options.analysis.plugin
@click.argument("building", metavar="MODEL.yaml|DIR", type=FileName())
@options.record.optional_plain_record_options
@options.output.to_files(picture=True)
@options.of(Request)
def command(request: Request) -> None:
    """Compute the sensitivity of peak responses to building parameters.

    MODEL.yaml is run under the RECORDs with its own parameters, and with a parameter of --vary at
    a time at its low and its high value. CSV: for each peak response the parameters, sorted by
    effect; medians over the records; and the effect, which is the difference between the high and
    the low value, divided by the peak of the unchanged building. --plot draws a tornado diagram for
    each peak response.

    If a campaign directory with `vary` is given instead of a model, the table contains the
    (Spearman) rank correlations of the varied parameters with the medians of the peak responses.
    """
    # A campaign contains its results: compute their rank correlations, without new runs.
    if is_folder(request.building):
        refuse_idle("campaign")
        from tdint.studies.sensitivity.sensitivity_tables import correlation_table
        from tdint.studies.store.opening import check_chunks, open_existing
        from tdint_cli.studies.campaign_files import warn_unfinished

        with open_existing(Path(request.building)) as store:
            check_chunks(store)
            warn_unfinished(store)
            record_digest(store.name, lambda: digest_of(Path(store.name)))
            table = correlation_table(store)
        request.outputs.deliver(table)
        return
    if request.ranges and not request.records:
        from tdint.model.config.model_file import load_model

        if load_model(request.building).excitation.has_forces:
            raise UsageError(
                "RECORDs are required; for forces alone, run a campaign with `vary` and load cases "
                "(key `forces` of `tdint campaign -o DIR`), then `tdint sensitivity DIR`"
            )
    if not request.records or not request.ranges:
        raise UsageError(
            "RECORDs and --vary NAME=LOW:HIGH are required, or a campaign directory with `vary`"
        )
    _one_at_a_time(request)


def _one_at_a_time(request: Request) -> None:
    """Run a building with its parameters, and with a single parameter at its low or high value.

    The table of the effects is written, and the largest effect on the peak drift ratio is printed.
    Failures is raised afterwards if some records could not be read.
    """
    from tdint.model.config.model_file import load_model
    from tdint.model.config.record_files import RecordFiles
    from tdint.response.pairs import PairRule
    from tdint.studies.campaign.execute import threads
    from tdint.studies.campaign.inputs import read_motions
    from tdint.studies.sensitivity.sensitivity import parameter_effects, plan_of
    from tdint.studies.sensitivity.sensitivity_tables import parameter_effect_table
    from tdint.studies.store.opening import open_store
    from tdint_cli.studies.campaign_files import advance_with_bar, report_outcomes, warn_of_plan

    model = load_model(request.building)
    motions = read_motions(RecordFiles(request.records, request.choice))
    # The runs are a campaign in memory, with the unchanged building and with buildings where a
    # parameter has its low or its high value.
    ranges = _si_ranges(model, request.ranges)
    plan = plan_of(model, ranges, motions, method=request.method, dt=request.dt)
    store, _ = open_store(None, plan)
    warn_of_plan(plan)
    rule = PairRule.from_motions(plan.motions, plan.pair_demand)
    note(*([rule.note([motion.name for motion in plan.motions])] if rule.pairs else ()))
    note_of_runs(*dict.fromkeys(plan.notes))
    with store:
        advance = advance_with_bar(plan, store, threads(processors()))
        report_outcomes(store)
        effects = parameter_effects(store, model.name, ranges)

    outputs = request.outputs.else_in(model.output_units)
    outputs.deliver(
        parameter_effect_table(effects, outputs.shown_units),
        lambda: studies.sensitivity_figures.sensitivity_picture(effects, outputs.shown_units),
    )
    # The table starts with the effects on the peak drift ratio, in descending order.
    largest = effects[0]
    result = (
        "No effect on the peak drift ratio is known, because peaks are zero or missing."
        if math.isnan(largest.effect)
        else f"{largest.parameter} has the largest effect on the peak drift ratio: "
        f"{100.0 * largest.effect:.3g} %."
    )
    say(f"{pluralize(advance.done, 'run')}. {result}")
    if plan.failures:
        raise Failures([*plan.failures])
