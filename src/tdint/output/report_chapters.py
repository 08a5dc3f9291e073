"""The pages of a run and of a suite: which chapters they have."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.analysis.spectra.elastic import spectrum
from tdint.ground_motion.record import Record, component_names
from tdint.model.building import assemble
from tdint.output import figures
from tdint.output.report import LEFT_OUT, Chapter, Part, Picture, input_points, model_chapter, page
from tdint.output.summary import campaign_summary
from tdint.output.tables.campaign import profile_table
from tdint.output.tables.responses import story_table
from tdint.output.tables.spectra import motion_table
from tdint.output_units import SI, OutputUnits
from tdint.written_numbers import how_many

if TYPE_CHECKING:
    from tdint.analysis.run.outcome import Response
    from tdint.campaign.plan import Plan
    from tdint.campaign.profiles import Profile
    from tdint.campaign.store.store import Store

_MOST_MOTIONS = 60
"""Motions whose spectra are drawn."""

_MOST_LEVELS = 4
"""Levels of which the motions are listed."""

_PERIODS = (0.05, 5.0, 100)
_OF_STORIES = (
    "peak_drift",
    "peak_drift_ratio",
    "residual_drift",
    "peak_total_shear",
    "peak_damper_force",
    "ductility",
    "peak_displacement",
    "peak_absolute_acceleration",
    "corrected_peak_drift",
)
_OF_SUITE = (
    "peak_drift_ratio",
    "peak_drift",
    "residual_drift",
    "peak_absolute_acceleration",
    "peak_total_shear",
    "peak_damper_force",
)


def run_page(
    response: Response, content: Mapping[str, Any], said: str, warnings: Sequence[str], units: OutputUnits = SI
) -> bytes:
    """The page of a run.

    Parameters
    ----------
    response : Response
        With its history, for the picture.
    content : mapping
        Its summary (`tdint.output.run_summary.run_summary`), in SI units.
    said : str
        The run in a few sentences.
    warnings : sequence of str
        What changes the meaning of a number.
    """
    model = response.model
    check = response.check
    table = story_table(response.stories, *((check.errors, check.corrected) if check else ())).in_units(units)
    names = [name for name in table.columns if name == "story" or name.startswith(_OF_STORIES)]
    building = assemble(model)
    omega, damping = building.first_mode()
    drawn = [Picture(lambda: figures.runs.run_picture(response, units), "Histories, energies, profiles, hysteresis")]
    chapters = [
        Chapter("Result", (said, *(drawn if response.history is not None else ()))),
        Chapter("Peaks of the stories", (table.chosen(names), _errors(response))),
        model_chapter(model, 2.0 * math.pi / omega, damping, units),
        _motions([[(response.record, 1.0)]] if response.record else [], units),
        _assumptions(f"{response.method}, {how_many(response.steps, 'step')} of {response.dt:.6g} s", ()),
        Chapter("Notes", (list(response.notes),)),
        Chapter("Inputs", (input_points(content["inputs"]),)),
    ]
    about = f"Response in time of {model.name}: status {response.status}."
    return page(model.name, about, chapters, warnings)


def _errors(response: Response) -> str:
    check = response.check
    if check is None or check.drift_error is None:
        return "The error of the time integration was not estimated; --check does."
    corrected = " Corrected drifts are those without it." if check.corrected else ""
    return (
        f"Columns of errors: estimated absolute errors of the time integration; the largest of a peak drift is "
        f"{100.0 * check.drift_error:.2g} % (story {check.drift_story}).{corrected}"
    )


def suite_page(
    plan: Plan,
    store: Store,
    found: Sequence[Profile],
    *,
    said: Sequence[str] = (),
    warnings: Sequence[str] = (),
    limit: float | None = None,
    units: OutputUnits = SI,
) -> bytes:
    """The page of several runs.

    Parameters
    ----------
    store : Store
        All runs of the plan, done.
    found : sequence of Profile
        Of each building and level.
    said : sequence of str
        What was found beside a limit.
    """
    content = campaign_summary(store)
    runs = content["runs"]
    about = ", ".join(f"{count} {status}" for status, count in runs["by_status"].items())
    buildings = {one.name: one for one in plan.buildings}
    models = [one.subject() for one in buildings.values()]
    limits = "" if limit is None else f", limit {100.0 * limit:g} %"
    profile = Picture(
        lambda: figures.demands.profile_picture(found, units, limit=limit, title=plan.name),
        f"Drifts, floor accelerations, total shears: motions, mean, largest{limits}",
    )
    methods = ", ".join(dict.fromkeys(one.method for one in models))
    own = plan.settings.dt
    step = f"{methods}, steps of {own:g} s" if own else f"{methods}, steps of the models or the records"
    rest = ("runs go on with the ground at rest until the building is",) if plan.settings.until_rest else ()
    chapters = [
        Chapter("Result", (list(said), *((profile,) if found else ()))),
        *(Chapter(f"Over the motions: {_with_level(one)}", (profile_table(one, _OF_SUITE, units),)) for one in found),
        *(
            model_chapter(one.model, one.period, assemble(one.model).first_mode()[1], units)
            for one in models[:_MOST_MODELS]
        ),
        _motions(_as_run(plan, store), units),
        _assumptions(step, [*rest, _SUITE]),
        Chapter("Notes", (list(plan.notes),)),
        Chapter("Inputs", (_inputs(plan, content),)),
    ]
    return page(plan.name, f"{runs['done']} of {how_many(runs['all'], 'run')}: {about}.", chapters, warnings)


_MOST_MODELS = 8
"""Buildings whose stories are listed."""


def _with_level(one: Profile) -> str:
    return ", ".join(filter(None, [one.building, one.level_text]))


def _inputs(plan: Plan, content: Mapping[str, Any]) -> list[str]:
    models = {one.name: one.digest for one in plan.buildings}
    files = [{**one, "file": f"{one['file']} {one['component']}, its samples"} for one in content["records"]]
    return [
        *(f"{name}, as it was run: SHA-256 {digest}" for name, digest in models.items()),
        *input_points(files),
        f"the whole campaign: {content['fingerprint']}",
    ]


def _as_run(plan: Plan, store: Store) -> list[list[tuple[Record, float]]]:
    """The motions with the factors on them, level by level from the smallest; what several buildings share once."""
    factors: dict[tuple[int, int, int], list[float]] = {}
    for building, motion, scale, sample, *_ in store.runs():
        factors.setdefault((building, motion, sample), []).append(scale)
    levels: dict[tuple[int, int], list[tuple[int, float]]] = {}
    for (building, motion, _), scales in factors.items():
        for rank, scale in enumerate(sorted(scales, key=abs)):
            levels.setdefault((building, rank), []).append((motion, scale))
    return [
        [(plan.motions[motion].record, scale) for motion, scale in one]
        for one in dict.fromkeys(map(tuple, levels.values()))
    ]


def _motions(levels: Sequence[Sequence[tuple[Record, float]]], units: OutputUnits) -> Chapter:
    """The ground motions as they were run, and their spectra, level by level."""
    parts: list[Part] = []
    for number, level in enumerate(levels[:_MOST_LEVELS], start=1):
        records = [record.scaled(factor) for record, factor in level]
        factors = {factor for _, factor in level}
        times = f"times {level[0][1]:.4g}" if len(factors) == 1 else "each times its factor"
        said = "" if factors == {1.0} else f", {times}"
        parts += [f"Level {number} of {len(levels)}{said}:"] * (len(levels) > 1)
        parts.append(motion_table(records, component_names(records)).in_units(units))
        if len(records) <= _MOST_MOTIONS:
            periods = np.geomspace(_PERIODS[0], _PERIODS[1], int(_PERIODS[2]))
            spectra = [spectrum(record, periods) for record in records]
            draw = partial(figures.spectrum_curves.spectrum_picture, spectra, "periods", units)
            parts.append(Picture(draw, f"Response spectra, 5 % damping{said}"))
    return Chapter("Ground motions", parts)


_SUITE = (
    "of pairs of horizontal components the larger value counts; means are over the motions under which the building "
    "stood"
)


def _assumptions(step: str, more: Sequence[str]) -> Chapter:
    points = (
        f"Time integration: {step}.",
        *(f"{text[0].upper()}{text[1:]}." for text in more),
        "A shear building: " + LEFT_OUT[0][0].lower() + LEFT_OUT[0][1:],
        *LEFT_OUT[1:],
        "Drifts and displacements are relative to the floor below and to the ground; accelerations are absolute.",
    )
    return Chapter("Assumptions", (points,))
