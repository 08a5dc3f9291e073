"""Errors that are told, beside true ones: python tests/benchmarks/told_errors.py [honesty |
tolerance | outside]

honesty: `--buildings` random ones of all laws from `--seed` on (`random_buildings.any_building`)
and the frames of `configs` under the motions of `records`, at `--scales` factors drawn from 0.2 to
1.1 for each, by eight methods with steps of 2, 1 and 1/2 samples. Of each column, over all stories:
shares of told errors below a half and a tenth of the true ones, the median of told over true, the
share told ten times too large, and of `corrected` peaks that are worse. The truth is impulse4 with
32 steps in a sample; where gauss4 (moment4 with dashpots of powers) differs from it by more than a
fifth of an error, that is not judged, nor one below 1e-6 of the peak. tolerance: how many runs for
10 to 0.01 % are within it, by the methods of `--method`, and the equation solutions of all runs of
a search (without runs of impulse4 that estimate errors of other methods) over those of the cheapest
run of impulse4 that is within it with all smaller steps. outside: the truth of `plain_solver`,
which has nothing of tdint, for buildings of the laws that it knows.
"""

import argparse
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from itertools import product, takewhile
from pathlib import Path

import numpy as np
import plain_solver
from common import ROOT

from random_buildings import any_building
from tdint import load_model, prepare, run
from tdint.analysis.run.outcome import FailedRun, Response
from tdint.analysis.run.step_choice import _Search
from tdint.ground_motion.reading.read import read_records

NAMES = (
    "peak_drift",
    "peak_absolute_acceleration",
    "peak_total_shear",
    "peak_damper_force",
    "residual_drift",
)
METHODS = (
    *("impulse4", "moment4", "gauss4", "newmark-average"),
    *("bathe", "central-difference", "hht:alpha=-0.1", "generalized-alpha:rho_inf=0.8"),
)
SAMPLES = (2, 1, 0.5)
FINE = 32
SURE = 0.2  # of a true error: what both truths may differ by
# of a peak: below, Newton's tolerance and what both truths miss alike between steps are part of it
RESOLUTION = 1e-6
TOLERANCES = (0.1, 0.03, 0.01, 0.003, 0.001, 0.0001)
OUTSIDE = plain_solver.KINDS[1:]


@cache
def frames():
    """The models of `configs` that name a ground motion."""
    models = {file.stem: load_model(file) for file in sorted((ROOT / "configs").glob("*.yaml"))}
    return {name: model for name, model in models.items() if model.excitation.record}


@cache
def motions():
    """The horizontal motions of `records` by file and component."""
    files = sorted((ROOT / "records").rglob("*.mseed"))
    records = (record for file in files for record in read_records(file, units="m/s^2"))
    named = {f"{Path(record.source).stem} {record.component}": record for record in records}
    return {name: record for name, record in named.items() if not name.endswith("Z")}


def names_of(seed, buildings, scales):
    """Cases by name: their models and motions follow from it."""
    rng = np.random.default_rng(seed)
    for frame, motion in product(frames(), motions()) if scales else ():
        for scale in rng.uniform(0.2, 1.1, scales):
            yield f"{frame} {motion} {scale:.4f}"
    yield from (f"building {number}" for number in range(seed, seed + buildings))


def case_of(name, laws=None):
    """The model, the motion of a case, and a duration of whole steps of all lengths, s."""
    first, *others = name.split()
    if first == "building":
        model, record = any_building(int(others[0]), laws)
        if laws:
            rng = np.random.default_rng(int(others[0]))
            model["damping"] = {
                "rayleigh": {"mass": rng.uniform(0.0, 0.6), "stiffness": rng.uniform(0.0, 2e-3)}
            }
    else:
        model, record = frames()[first], motions()[" ".join(others[:2])].scaled(float(others[2]))
    longest = 4.0 * record.dt
    return model, record, longest * int(record.duration / longest + 1e-9)


def attempt(model, record, **how):
    """A run that came to its end without a collapse that ended it, else None."""
    try:
        response = run(model, record, **how)
    except FailedRun:
        return None
    return None if response.collapse else response


def truths(model, record, duration):
    """Two opinions on the true peaks by name; None where one of them has none."""
    power = any(isinstance(story.dashpot, dict) or story.power_dashpot for story in model.stories)
    names = ("impulse4", "moment4" if power else "gauss4")
    fine = [
        attempt(model, record, method=one, dt=record.dt / FINE, duration=duration, check=False)
        for one in names
    ]
    return (
        None
        if None in fine
        else [{name: getattr(one.stories, name) for name in NAMES} for one in fine]
    )


def judged(name, outside=False):
    """Of a case, by method, step and column: rows of true error, told error, error of the corrected
    peak, over the peak, one for each story."""
    model, record, duration = case_of(name, OUTSIDE if outside else None)
    if outside:
        fine = [plain_solver.peaks(model, record, parts, duration) for parts in (1024, 2048)]
        true = [{one: (4.0 * fine[1][one] - fine[0][one]) / 3.0 for one in NAMES}, fine[1]]
    model = load_model(model) if isinstance(model, dict) else model
    if not outside:
        true = truths(model, record, duration)
    rows = {}
    for method, samples in product(METHODS, SAMPLES) if true else ():
        response = attempt(model, record, method=method, dt=samples * record.dt, duration=duration)
        if response is None or response.check.drift_error is None:
            continue
        for column in NAMES:
            size = true[0]["peak_drift" if column == "residual_drift" else column]
            own, told = getattr(response.stories, column), getattr(response.check.errors, column)
            off, gap = np.abs(own - true[0][column]), np.abs(true[0][column] - true[1][column])
            sure = (off > RESOLUTION * size) & (gap < SURE * off) & (size > 0.0)
            left = np.abs(getattr(response.check.corrected, column) - true[0][column])
            rows[method, samples, column] = (np.array([off, told, left])[:, sure] / size[sure]).T
    return name, rows


def share(part):
    return f"{100.0 * np.mean(part):.2f}" if len(part) else "-"


def honesty(found):
    """A table of all columns for frames and random buildings, and one line for each method and
    step."""
    groups = {"frames": False, "random buildings": True}
    heads = (
        "beyond 2, %",
        "beyond 10, %",
        "told over true",
        "10 times too large, %",
        "corrected worse, %",
    )
    print(f"| cases | column | judged | {' | '.join(heads)} |")
    lines = defaultdict(list)
    for (group, is_random), column in product(groups.items(), NAMES):
        kept = []
        for name, rows in found:
            if name.startswith("building") == is_random:
                for (method, samples, of), values in rows.items():
                    if of == column:
                        kept.append(values)
                        lines[group, method, samples, column].append(values)
        if values := [one for one in kept if len(one)]:
            true, told, left = np.concatenate(values).T
            cells = [share(true > times * told) for times in (2.0, 10.0)] + [
                f"{np.median(told / true):.2f}"
            ]
            cells += share(told > 10.0 * true), share(left > true)
            print(f"| {group} | {column} | {len(true)} | {' | '.join(cells)} |")
    print(
        "\n| cases | method | samples | "
        + " | ".join(f"{name}: beyond 2, % (median)" for name in NAMES)
        + " |"
    )
    for group, method, samples in product(groups, METHODS, SAMPLES):
        cells = []
        for column in NAMES:
            values = [one for one in lines[group, method, samples, column] if len(one)]
            if values:
                true, told, _ = np.concatenate(values).T
                cells.append(f"{share(true > 2.0 * told)} ({np.median(told / true):.2f})")
        if cells:
            print(f"| {group} | {method} | {samples} | {' | '.join(cells)} |")


LADDER = (16, 12, 8, 6, 4, 3, 2, 1, 1 / 2, 1 / 3, 1 / 4, 1 / 6, 1 / 8, 1 / 12, 1 / 16)
"""Time steps of single runs, sampling intervals."""


def single_runs(model, record, duration, true):
    """True errors of the peak drifts and equation solutions of impulse4 by time step."""
    runs = []
    for part in LADDER:
        response = attempt(
            model, record, method="impulse4", dt=part * record.dt, duration=duration, check=False
        )
        if response is None:
            runs.append((np.inf, np.inf))
            continue
        off = np.max(np.abs(response.stories.peak_drift / true - 1.0))
        runs.append((off, response.iterations))
    return runs


def least_solves(runs, tolerance):
    """Solutions of the cheapest single run within a tolerance, as are all with smaller steps."""
    good = takewhile(lambda run: run[0] <= tolerance, reversed(runs))
    return min((solves for _, solves in good), default=np.nan)


def search_of(model, record, duration, method, tolerance):
    """The response by tolerance and the equation solutions of all runs of its search; None for a
    search that fails."""
    case = prepare(model, record, method=method)
    search = _Search.of(case, tolerance, None, duration)
    try:
        _, response = search.within(np.inf)
    except FailedRun:
        return None, np.nan
    return response, sum(
        one.iterations for one in search.runs.values() if isinstance(one, Response)
    )


def within(name, methods):
    """Of a case: for each method and tolerance the true error of the peak drifts over the
    tolerance, the steps, and the solutions of the search over the least."""
    model, record, duration = case_of(name)
    model = load_model(model)
    true = truths(model, record, duration)
    rows = []
    single = single_runs(model, record, duration, true[0]["peak_drift"]) if true else ()
    for method, tolerance in product(methods, TOLERANCES) if true else ():
        response, solves = search_of(model, record, duration, method, tolerance)
        gap = np.max(np.abs(true[1]["peak_drift"] / true[0]["peak_drift"] - 1.0))
        if response is not None and gap < SURE * tolerance:
            off = np.max(np.abs(response.stories.peak_drift / true[0]["peak_drift"] - 1.0))
            over = solves / least_solves(single, tolerance)
            rows.append((method, tolerance, off / tolerance, response.dt / record.dt, over))
    return name, rows


def tolerances(found, methods):
    for method, tolerance in product(methods, TOLERANCES):
        rows = [
            (name, *row[2:])
            for name, of_case in found
            for row in of_case
            if row[:2] == (method, tolerance)
        ]
        parts = np.array([row[1] for row in rows])
        print(
            f"{method}, {100.0 * tolerance:g} %: {np.sum(parts > 1.0)} of {len(rows)} beyond, "
            f"medians: {np.median(parts):.2f} of the tolerance, "
            f"{np.median([row[2] for row in rows]):g} samples a step, "
            f"{np.nanmedian([row[3] for row in rows]):.2f} times the least solutions"
        )
        for name, part, samples, _ in rows:
            if part > 1.0:
                print(f"  {name}: {part:.3g} times the tolerance, {samples:g} samples")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument(
        "table", nargs="?", choices=["honesty", "tolerance", "outside"], default="honesty"
    )
    parser.add_argument("--seed", type=int, default=1_000_000)
    parser.add_argument("--buildings", type=int, default=300)
    parser.add_argument("--scales", type=int, default=1)
    parser.add_argument("--method", default="impulse4,newmark-average")
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    names = list(
        names_of(given.seed, given.buildings, given.scales if given.table == "honesty" else 0)
    )
    methods = given.method.split(",")
    with ProcessPoolExecutor(given.processes) as pool:
        if given.table == "tolerance":
            tolerances(list(pool.map(partial(within, methods=methods), names)), methods)
        else:
            honesty(list(pool.map(partial(judged, outside=given.table == "outside"), names)))


if __name__ == "__main__":
    main()
