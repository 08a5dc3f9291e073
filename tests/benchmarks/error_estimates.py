"""Compare estimated with true errors: python tests/benchmarks/error_estimates.py [reliability |
tolerance | separate-solver]

reliability: print the table of tests/README.md for `--buildings` random buildings of all hysteresis
models from `--seed` on (`random_buildings.any_building`), by eight methods with the time steps of
`--samples` sampling intervals. With `--scales`, print a second table for the frames of `configs`
under the ground motions of `records`, scaled by that number of random factors from 0.2 to 1.1. Each
cell is the share of true errors that exceed twice the estimate / the share of estimates that are
more than ten times the true error, in %, over all stories. True values are those of impulse4 with
32 steps per sampling interval. An error is not judged if gauss4 (moment4 for power-law dashpots)
with the same steps differs from the true value by more than a fifth of the error, or if it is below
1e-6 of the peak.

tolerance: print how many runs for tolerances of 10 to 0.01 % are within them, by the methods of
`--method`, and the solves of all runs of a search (without runs of impulse4 that estimate errors of
other methods) divided by those of the cheapest run of impulse4 that is within the tolerance with
all shorter steps. The same ratio is printed for the first pair of runs and for the accepted run.
With `--standard`, the cases are the problems of the benchmark page instead of random buildings.

separate-solver: print the table of `reliability` with the true values of `plain_solver`, which uses
no code of tdint, for buildings with the hysteresis models that it has.

no-record: print the shares of `reliability` over all columns for time steps of 1/10, 1/5 and 1/3 of
the first period, for buildings in free vibration (even seeds) and under a harmonic force on a floor
(odd seeds). True values are those of impulse4 with 3200 steps in the period; newmark-average is the
second method.
"""

import argparse
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from itertools import chain, product, takewhile
from pathlib import Path

import numpy as np
import plain_solver
from common import ROOT

from random_buildings import any_building
from tdint import load_model, prepare, run
from tdint.analysis.chart.problem import ending_together
from tdint.analysis.chart.profiles import PARTS, STANDARD, read_problems
from tdint.analysis.run.outcome import FailedRun, Response
from tdint.analysis.run.step_choice import _Search
from tdint.ground_motion.reading.read import read_records

NAMES = (
    "peak_drift",
    "peak_absolute_acceleration",
    "peak_total_shear",
    "peak_damper_force",
    "residual_drift",
    "peak_shear",
)
HEADS = ("drift", "acceleration", "total shear", "damper force", "residual", "story shear")
METHODS = (
    *("impulse4", "moment4", "gauss4", "newmark-average"),
    *("bathe", "central-difference", "hht:alpha=-0.1", "generalized-alpha:rho_inf=0.8"),
)
SAMPLES = (2.0, 1.0, 0.5, 5.0, 10.0)
LONG = 5  # sampling intervals in a step, from which the table has a row of its own
WHOLE = 20  # sampling intervals: a common multiple of all time steps
FINE = 32
SURE = 0.2  # maximum difference of the two true values, divided by the true error
# Minimum true error divided by the peak. Smaller errors include the tolerance of Newton iterations
# and errors between time steps that both true values have in common.
RESOLUTION = 1e-6
PERIOD_PARTS, FINE_PARTS, PERIODS = (10, 5, 3), 3200, 9
NO_RECORD_METHODS = ("impulse4", "moment4", "newmark-average")
TOLERANCES = (0.1, 0.03, 0.01, 0.003, 0.001, 0.0001)
SOLVER_LAWS = plain_solver.KINDS[1:]


@cache
def frames():
    """Return the models of `configs` that name a ground motion."""
    models = {file.stem: load_model(file) for file in sorted((ROOT / "configs").glob("*.yaml"))}
    return {name: model for name, model in models.items() if model.excitation.record}


@cache
def motions():
    """Return the horizontal ground motions of `records` by file and component."""
    files = sorted((ROOT / "records").rglob("*.mseed"))
    records = (record for file in files for record in read_records(file, units="m/s^2"))
    named = {f"{Path(record.source).stem} {record.component}": record for record in records}
    return {name: record for name, record in named.items() if not name.endswith("Z")}


@cache
def standard_problems():
    """Return the problems of the benchmark page, extended so that all time steps end together."""
    problems = [one.posed for one in read_problems(STANDARD)]
    return [ending_together(one, [one.interval * part for part in PARTS]) for one in problems]


def names_of(seed, buildings, scales, standard=False):
    """Yield the names of the cases, from which `case_of` derives models and ground motions.

    With `standard`, the cases are the standard problems, and the other parameters are ignored.
    """
    if standard:
        yield from (f"standard {number}" for number in range(len(standard_problems())))
        return
    rng = np.random.default_rng(seed)
    for frame, motion in product(frames(), motions()) if scales else ():
        for scale in rng.uniform(0.2, 1.1, scales):
            yield f"{frame} {motion} {scale:.4f}"
    yield from (f"building {number}" for number in range(seed, seed + buildings))


def case_of(name, laws=None):
    """Return the model and the ground motion of a case, and a duration (s) that is a multiple of
    all time steps."""
    first, *others = name.split()
    if first == "standard":
        problem = standard_problems()[int(others[0])]
        return problem.model, problem.record, problem.samples * problem.interval
    if first == "building":
        model, record = any_building(int(others[0]), laws)
        if laws:
            rng = np.random.default_rng(int(others[0]))
            model["damping"] = {
                "rayleigh": {"mass": rng.uniform(0.0, 0.6), "stiffness": rng.uniform(0.0, 2e-3)}
            }
    else:
        model, record = frames()[first], motions()[" ".join(others[:2])].scaled(float(others[2]))
    longest = WHOLE * record.dt
    return model, record, longest * int(record.duration / longest + 1e-9)


def attempt(model, record, **how):
    """Return the response, or None if the run fails or collapses."""
    try:
        response = run(model, record, **how)
    except FailedRun:
        return None
    return None if response.collapse else response


def truths(model, record, duration):
    """Return the peaks by name from two methods with short steps; None if one of them fails."""
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


def solver_truths(model, record, duration):
    """Return the peaks of `plain_solver` by name, extrapolated and with its shorter step."""
    coarse, fine = (plain_solver.peaks(model, record, parts, duration) for parts in (1024, 2048))
    return [{name: (4.0 * fine[name] - coarse[name]) / 3.0 for name in fine}, fine]


def judged_rows(true, response):
    """Return true and estimated errors of a response by column, divided by the peak, as arrays of
    two rows with one column for each error that is judged."""
    rows = {}
    for column in true[0]:
        size = true[0]["peak_drift" if column == "residual_drift" else column]
        error = np.abs(getattr(response.stories, column) - true[0][column])
        gap = np.abs(true[0][column] - true[1][column])
        sure = (error > RESOLUTION * size) & (gap < SURE * error) & (size > 0.0)
        estimate = getattr(response.check.errors, column)
        rows[column] = np.array([error, estimate])[:, sure] / size[sure]
    return rows


def judged(name, separate=False, samples=SAMPLES):
    """Return the name of a case, and by method, time step and column an array with the rows true
    error and estimated error, divided by the peak; one column for each story."""
    definition, record, duration = case_of(name, SOLVER_LAWS if separate else None)
    model = load_model(definition) if isinstance(definition, dict) else definition
    true = (
        solver_truths(definition, record, duration) if separate else truths(model, record, duration)
    )
    rows = {}
    for method, length in product(METHODS, samples) if true else ():
        response = attempt(model, record, method=method, dt=length * record.dt, duration=duration)
        if response is None or response.check.drift_error is None:
            continue
        for column, values in judged_rows(true, response).items():
            rows[method, length, column] = values
    return name, rows


def building_without_record(seed):
    """Return a random building, free or under a harmonic force, and its first period, s."""
    definition, _ = any_building(seed)
    rng = np.random.default_rng(seed)
    stories = len(definition["stories"])

    def period():
        building = prepare(load_model(definition), method="impulse4").building
        return 2.0 * np.pi / building.modes().omega[0]

    if seed % 2 == 0:
        definition.pop("excitation", None)
        displacement = np.cumsum(rng.uniform(-0.03, 0.03, stories)).tolist()
        velocity = rng.uniform(-0.3, 0.3, stories).tolist()
        definition["initial"] = {"displacement": displacement, "velocity": velocity}
    else:
        definition.pop("initial", None)
        weight = 9.81 * sum(one["mass"] for one in definition["stories"])
        force = {"floor": int(rng.integers(1, stories + 1)), "phase": "sin", "omega": 1.0}
        force["amplitude"] = float(0.1 * weight * rng.uniform(0.5, 1.5) / stories**0.5)
        definition["excitation"] = {"forces": [force]}
        force["omega"] = float(rng.uniform(0.3, 1.5) * 2.0 * np.pi / period())
    return load_model(definition), period()


def judged_without_record(seed):
    """Return a seed, and by method and part of the period the arrays of `judged_rows`."""
    model, period = building_without_record(seed)
    duration = PERIODS * period
    fine = [
        attempt(model, None, method=one, dt=period / FINE_PARTS, duration=duration, check=False)
        for one in ("impulse4", "newmark-average")
    ]
    rows = {}
    if None in fine:
        return seed, rows
    true = [{name: getattr(one.stories, name) for name in NAMES} for one in fine]
    for method, part in product(NO_RECORD_METHODS, PERIOD_PARTS):
        response = attempt(model, None, method=method, dt=period / part, duration=duration)
        if response is not None and response.check.drift_error is not None:
            rows[method, part] = list(judged_rows(true, response).values())
    return seed, rows


def table_without_record(found):
    """Print the two shares over all columns by method and time step."""
    heads = [f"{kind}, 1/{part}" for kind, part in product(("free", "force"), PERIOD_PARTS)]
    print(f"| method | {' | '.join(heads)} |")
    print("|---" * (len(heads) + 1) + "|")
    for method in NO_RECORD_METHODS:
        cells = [
            cell(
                [
                    one
                    for seed, rows in found
                    if seed % 2 == odd
                    for one in rows.get((method, part), ())
                ]
            )
            for odd, part in product((0, 1), PERIOD_PARTS)
        ]
        print(f"| {method} | {' | '.join(cells)} |")
    print(f"\n{sum(bool(rows) for _, rows in found)} of {len(found)} buildings have a true value")


def cell(parts):
    """Return the two shares of errors that were judged, %."""
    true, estimate = np.concatenate(parts, axis=1)
    return f"{100.0 * np.mean(true > 2.0 * estimate):.2f} / " + (
        f"{100.0 * np.mean(estimate > 10.0 * true):.1f}"
    )


def table(found, samples):
    """Print the two shares by method and column, and the numbers of errors that were judged."""
    short = [length for length in samples if length < LONG]
    long = [length for length in samples if length >= LONG]
    lines = [(method, [method], short or long) for method in METHODS]
    lines += [("all methods", METHODS, short)] if short else []
    lines += [
        (f"all methods, {' and '.join(f'{x:g}' for x in sorted(long))} samples", METHODS, long)
    ]
    by_key = defaultdict(list)
    for _, rows in found:
        for key, values in rows.items():
            by_key[key].append(values)
    columns = [name for name in NAMES if any(key[2] == name for key in by_key)]
    lengths = ", ".join(f"{length:g}" for length in sorted(short or long))
    heads = [HEADS[NAMES.index(name)] for name in columns]
    print(f"| steps of {lengths} samples | {' | '.join(heads)} | all |")
    print("|---" * (len(columns) + 2) + "|")
    for title, methods, steps in lines if long else lines[:-1]:
        keys = list(product(methods, steps))
        parts = [[one for key in keys for one in by_key[*key, name]] for name in columns]
        cells = [
            cell(part) if any(one.size for one in part) else "-"
            for part in (*parts, list(chain.from_iterable(parts)))
        ]
        print(f"| {title} | {' | '.join(cells)} |")
    numbers = [
        sum(one.shape[1] for key in by_key if key[2] == name for one in by_key[key])
        for name in columns
    ]
    print(
        f"\n{sum(bool(rows) for _, rows in found)} of {len(found)} cases have a true value; "
        f"errors judged by column: {', '.join(map(str, numbers))}"
    )
    if long:
        shares = {
            (method, name): cell([one for length in long for one in by_key[method, length, name]])
            for method, name in product(METHODS, columns)
            if any(one.size for length in long for one in by_key[method, length, name])
        }
        method, name = max(shares, key=lambda key: float(shares[key].split()[0]))
        print(f"largest share with long steps: {shares[method, name]} ({method}, {name})")


LADDER = (16, 12, 8, 6, 4, 3, 2, 1, 1 / 2, 1 / 3, 1 / 4, 1 / 6, 1 / 8, 1 / 12, 1 / 16)
"""Time steps of single runs, sampling intervals."""


def single_runs(model, record, duration, true):
    """Return maximum errors of the peak drifts and solves of impulse4 by time step."""
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
    """Return the solves of the cheapest run that is within a tolerance with all shorter steps."""
    good = takewhile(lambda run: run[0] <= tolerance, reversed(runs))
    return min((solves for _, solves in good), default=np.nan)


def search_of(model, record, duration, method, tolerance):
    """Return the response for a tolerance, and the solves of all runs of the search, of its first
    two runs and of the accepted run; None and nan if the search fails."""
    case = prepare(model, record, method=method)
    search = _Search.of(case, tolerance, None, duration)
    try:
        _, response = search.within(np.inf)
    except FailedRun:
        return None, np.full(3, np.nan)
    solves = [one.iterations for one in search.runs.values() if isinstance(one, Response)]
    return response, np.array([sum(solves), sum(solves[:2]), response.iterations])


def within(name, methods):
    """Return the name of a case with a row for each method and tolerance.

    The row contains the method, the tolerance, the true error of the peak drifts divided by the
    tolerance, the time step in sampling intervals, and the solves of the search, of its first pair
    and of the accepted run, each divided by the least solves of a single run.
    """
    definition, record, duration = case_of(name)
    model = load_model(definition) if isinstance(definition, dict) else definition
    true = truths(model, record, duration)
    rows = []
    single = single_runs(model, record, duration, true[0]["peak_drift"]) if true else ()
    for method, tolerance in product(methods, TOLERANCES) if true else ():
        response, solves = search_of(model, record, duration, method, tolerance)
        gap = np.max(np.abs(true[1]["peak_drift"] / true[0]["peak_drift"] - 1.0))
        if response is not None and gap < SURE * tolerance:
            off = np.max(np.abs(response.stories.peak_drift / true[0]["peak_drift"] - 1.0))
            ratios = solves / least_solves(single, tolerance)
            rows.append((method, tolerance, off / tolerance, response.dt / record.dt, *ratios))
    return name, rows


def tolerances(found, methods):
    """Print how many runs are within each tolerance, and how many solves the searches need."""
    for method, tolerance in product(methods, TOLERANCES):
        rows = [
            (name, *row[2:])
            for name, of_case in found
            for row in of_case
            if row[:2] == (method, tolerance)
        ]
        parts, samples, *ratios = np.array([row[1:] for row in rows]).T
        search, pair, accepted = (np.nanmedian(one) for one in ratios)
        print(
            f"{method}, {100.0 * tolerance:g} %: {np.sum(parts > 1.0)} of {len(rows)} beyond, "
            f"medians: {np.median(parts):.2f} of the tolerance, {np.median(samples):g} samples a "
            f"step, {search:.2f} times the least solves (first pair {pair:.2f}, accepted run "
            f"{accepted:.2f})"
        )
        for name, part, length, *_ in rows:
            if part > 1.0:
                print(f"  {name}: {part:.3g} times the tolerance, {length:g} samples")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument(
        "table",
        nargs="?",
        choices=["reliability", "tolerance", "separate-solver", "no-record"],
        default="reliability",
    )
    parser.add_argument("--seed", type=int, default=5_200_000)
    parser.add_argument("--buildings", type=int, default=300)
    parser.add_argument("--scales", type=int, default=0)
    parser.add_argument("--standard", action="store_true")
    parser.add_argument("--samples", default=",".join(f"{length:g}" for length in SAMPLES))
    parser.add_argument("--method", default="impulse4,newmark-average")
    parser.add_argument("--processes", type=int, default=1)
    given = parser.parse_args()
    names = list(names_of(given.seed, given.buildings, given.scales, given.standard))
    methods, samples = given.method.split(","), [float(one) for one in given.samples.split(",")]
    work = (
        partial(within, methods=methods)
        if given.table == "tolerance"
        else partial(judged, separate=given.table == "separate-solver", samples=samples)
    )
    if given.table == "no-record":
        work, names = judged_without_record, range(given.seed, given.seed + given.buildings)
    with ProcessPoolExecutor(given.processes) as pool:
        found = list(pool.map(work, names))
    if given.table == "no-record":
        table_without_record(found)
        return
    if given.table == "tolerance":
        tolerances(found, methods)
        return
    for is_random in (True, False):
        if group := [one for one in found if one[0].startswith("building") == is_random]:
            table(group, samples)


if __name__ == "__main__":
    main()
