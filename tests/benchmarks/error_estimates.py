"""Compare estimated with true errors.

    python tests/benchmarks/error_estimates.py [TABLE] [OPTIONS]

TABLE is one of the following (default: reliability).

reliability: print the table of tests/MEASUREMENTS.md for `--buildings` random buildings of all
hysteresis models from `--seed` on (`random_buildings.any_building`), by eight methods with the time
steps of `--samples` sampling intervals. With `--scales`, print a second table for the frames of
`configs` under the ground motions of `records`, scaled by that number of random factors from 0.2 to
1.1. Each cell is the share of true errors that exceed twice the estimate / the share of estimates
that are more than ten times the true error, in %, over all stories. The reference solution is
impulse4 with 32 steps per sampling interval. An error is not judged if gauss4 (moment4 for
power-law dashpots) with the same steps differs from the true value by more than a fifth of the
error, or if it is below 1e-6 of the peak. `--store` writes the numbers of errors to
reliability.csv, from which `python tests/readmes.py --parts` writes the tables of the page.

tolerance: print how many runs for tolerances of 10 to 0.01 % are within them, by the methods of
`--method`, and the solves of all runs of a search (without runs of impulse4 that estimate errors of
other methods) divided by those of the cheapest run of impulse4 that is within the tolerance with
all shorter steps. The same ratio is printed for the first pair of runs and for the accepted run.
With `--standard`, the cases are the problems of the benchmark page instead of random buildings.

separate-solver: print the table of `reliability` with the true values of `plain_solver`, which uses
no code of tdint, for buildings with the hysteresis models that it has.

no-record: print the shares of `reliability` over all columns for time steps of 1/10, 1/5 and 1/3 of
the first period, for buildings in free vibration (even seeds) and under a harmonic force on a floor
(odd seeds). The reference solution is impulse4 with 3200 steps in the period, and the second
method is newmark-average.
"""

import argparse
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from itertools import chain, product, takewhile
from pathlib import Path

import measured
import numpy as np
import plain_solver
from common import ROOT

from random_buildings import any_building
from tdint import load_model, prepare, run
from tdint.assessment.chart.performance_profiles import PARTS, STANDARD, read_problems
from tdint.assessment.chart.problem import ending_together
from tdint.ground_motion.reading.read import read_records
from tdint.response.runs.outcome import FailedRun, Response
from tdint.response.runs.step_choice import _Search

# Columns of the tables: quantities, and their titles.
NAMES = (
    "peak_drift", "peak_absolute_acceleration", "peak_total_shear", "peak_damper_force",
    "residual_drift", "peak_shear",
)  # fmt: skip
HEADS = ("drift", "acceleration", "total shear", "damper force", "residual", "story shear")
METHODS = (
    *("impulse4", "moment4", "gauss4", "newmark-average"),
    *("bathe", "central-difference", "hht:alpha=-0.1", "generalized-alpha:rho_inf=0.8"),
)
# Time steps, sampling intervals.
SAMPLES = (2.0, 1.0, 0.5, 5.0, 10.0)
LONG = 5  # sampling intervals; longer time steps have a separate row in the table
WHOLE = 20  # sampling intervals; a common multiple of all time steps
FINE = 32  # time steps of the reference per sampling interval
MAX_DIFFERENCE = 0.2  # maximum difference of the two true values, divided by the true error
# Minimum true error divided by the peak. Smaller errors include the tolerance of Newton iterations
# and errors between time steps that both true values have in common.
RESOLUTION = 1e-6
# Without a record: time steps and reference step as fractions of the first period (1/10, ...), and
# number of periods of a run.
PERIOD_PARTS, FINE_PARTS, PERIODS = (10, 5, 3), 3200, 9
NO_RECORD_METHODS = ("impulse4", "moment4", "newmark-average")
TOLERANCES = (0.1, 0.03, 0.01, 0.003, 0.001, 0.0001)
SOLVER_LAWS = plain_solver.KINDS[1:]  # without linear stories


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
    problems = [problem.posed for problem in read_problems(STANDARD)]
    return [
        ending_together(problem, [problem.interval * part for part in PARTS])
        for problem in problems
    ]


def names_of(seed, buildings, scales, standard=False):
    """Yield the names of the cases, from which `case_of` derives models and ground motions.

    Parameters
    ----------
    seed, buildings : int
        First seed and number of the random buildings.
    scales : int
        Number of random factors for each pair of a frame of configs and a ground motion; 0 for no
        frames.
    standard : bool
        True for the standard problems only. The other parameters are ignored.
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
    all time steps.

    The model is a dictionary for random buildings. `laws` restricts the laws of random buildings;
    in this case they have Rayleigh damping, which `plain_solver` supports.
    """
    first, *details = name.split()
    if first == "standard":
        problem = standard_problems()[int(details[0])]
        return problem.model, problem.record, problem.samples * problem.interval
    if first == "building":
        model, record = any_building(int(details[0]), laws)
        if laws:
            rng = np.random.default_rng(int(details[0]))
            model["damping"] = {
                "rayleigh": {"mass": rng.uniform(0.0, 0.6), "stiffness": rng.uniform(0.0, 2e-3)}
            }
    else:
        model, record = frames()[first], motions()[" ".join(details[:2])].scaled(float(details[2]))
    longest = WHOLE * record.dt
    return model, record, longest * int(record.duration / longest + 1e-9)


def attempt(model, record, **options):
    """Return the response of `tdint.run`, or None if the run fails or collapses."""
    try:
        response = run(model, record, **options)
    except FailedRun:
        return None
    return None if response.collapse else response


def truths(model, record, duration):
    """Return the peaks by name from two methods with short steps, as a list of two dictionaries;
    None if a run fails."""
    # gauss4 does not support power-law dashpots.
    has_power_law = any(
        isinstance(story.dashpot, dict) or story.power_dashpot for story in model.stories
    )
    names = ("impulse4", "moment4" if has_power_law else "gauss4")
    fine = [
        attempt(model, record, method=method, dt=record.dt / FINE, duration=duration, check=False)
        for method in names
    ]
    if None in fine:
        return None
    return [{name: getattr(response.stories, name) for name in NAMES} for response in fine]


def solver_truths(model, record, duration):
    """Return the peaks of `plain_solver` by name, as a list of two dictionaries: extrapolated from
    two time steps (Richardson, order 2), and with the shorter step."""
    coarse, fine = (plain_solver.peaks(model, record, parts, duration) for parts in (1024, 2048))
    return [{name: (4.0 * fine[name] - coarse[name]) / 3.0 for name in fine}, fine]


def judged_rows(true, response):
    """Return true and estimated errors of a response for the stories whose error is judged.

    Parameters
    ----------
    true : list of dict
        Two reference solutions; see `truths`.
    response : Response
        Response with an error estimate.

    Returns
    -------
    dict of str to ndarray, shape (2, judged stories)
        By quantity: true errors and estimated errors, divided by the peak. Residual drifts are
        divided by the peak drift.
    """
    rows = {}
    for column in true[0]:
        size = true[0]["peak_drift" if column == "residual_drift" else column]
        error = np.abs(getattr(response.stories, column) - true[0][column])
        difference = np.abs(true[0][column] - true[1][column])
        is_judged = (
            (error > RESOLUTION * size) & (difference < MAX_DIFFERENCE * error) & (size > 0.0)
        )
        estimate = getattr(response.check.errors, column)
        rows[column] = np.array([error, estimate])[:, is_judged] / size[is_judged]
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
        """Return the first period of the present definition, s."""
        building = prepare(load_model(definition), method="impulse4").building
        return 2.0 * np.pi / building.modes().omega[0]

    if seed % 2 == 0:
        definition.pop("excitation", None)
        displacement = np.cumsum(rng.uniform(-0.03, 0.03, stories)).tolist()
        velocity = rng.uniform(-0.3, 0.3, stories).tolist()
        definition["initial"] = {"displacement": displacement, "velocity": velocity}
    else:
        definition.pop("initial", None)
        weight = 9.81 * sum(story["mass"] for story in definition["stories"])
        # `period` needs a valid model, so omega is replaced afterwards.
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
        attempt(model, None, method=method, dt=period / FINE_PARTS, duration=duration, check=False)
        for method in ("impulse4", "newmark-average")
    ]
    rows = {}
    if None in fine:
        return seed, rows
    true = [{name: getattr(response.stories, name) for name in NAMES} for response in fine]
    for method, part in product(NO_RECORD_METHODS, PERIOD_PARTS):
        response = attempt(model, None, method=method, dt=period / part, duration=duration)
        if response is not None and response.check.drift_error is not None:
            rows[method, part] = list(judged_rows(true, response).values())
    return seed, rows


def print_without_record(results):
    """Print the two shares over all columns by method and time step.

    `results` is a list of results of `judged_without_record`.
    """
    heads = [f"{case}, 1/{part}" for case, part in product(("free", "force"), PERIOD_PARTS)]
    print(f"| method | {' | '.join(heads)} |")
    print("|---" * (len(heads) + 1) + "|")
    for method in NO_RECORD_METHODS:
        cells = []
        # Even seeds are free vibrations, odd seeds have a harmonic force.
        for remainder, part in product((0, 1), PERIOD_PARTS):
            arrays = [
                array
                for seed, rows in results
                if seed % 2 == remainder
                for array in rows.get((method, part), ())
            ]
            cells.append(cell(arrays))
        print(f"| {method} | {' | '.join(cells)} |")
    print(
        f"\n{sum(bool(rows) for _, rows in results)} of {len(results)} buildings have a true value"
    )


def cell(arrays):
    """Return the text of a cell: share of true errors above twice the estimate / share of estimates
    above ten times the true error, %.

    `arrays` are results of `judged_rows` with the rows true error and estimate.
    """
    true, estimate = np.concatenate(arrays, axis=1)
    too_small = 100.0 * np.mean(true > 2.0 * estimate)
    too_large = 100.0 * np.mean(estimate > 10.0 * true)
    return f"{too_small:.2f} / {too_large:.1f}"


def counted(arrays):
    """Return the numbers of errors, of estimates that are too small, and of those that are more
    than ten times too large, as a dictionary; `arrays` as for `cell`."""
    true, estimate = np.concatenate(arrays, axis=1) if arrays else np.empty((2, 0))
    return {
        "errors": true.size,
        "too_small": int(np.sum(true > 2.0 * estimate)),
        "too_large": int(np.sum(estimate > 10.0 * true)),
    }


def store(table, results, found):
    """Replace the rows of a table in reliability.csv.

    Parameters
    ----------
    table : str
        Name of the table.
    results : list
        Name and errors of each case.
    found : iterable of (tuple of str, list of ndarray)
        Method, time steps and quantity of each row, and its arrays as for `cell`.
    """
    cases = {"cases": len(results), "confirmed": sum(bool(rows) for _, rows in results)}
    old = [row for row in measured.rows(measured.RELIABILITY) if row["table"] != table]
    heads = ("method", "samples", "quantity")
    new = [
        {"table": table} | dict(zip(heads, key, strict=True)) | counted(arrays) | cases
        for key, arrays in found
    ]
    measured.write(measured.RELIABILITY, sorted(old + new, key=lambda row: row["table"]))
    measured.store("Reliability of error estimates")


def rows_with_record(results):
    """Yield the rows of `store` for results of `judged` with the time steps of `SAMPLES`."""
    groups = {measured.SHORT: [x for x in SAMPLES if x < LONG]}
    groups[measured.LONG] = [x for x in SAMPLES if x >= LONG]
    for method, (samples, lengths), name in product(METHODS, groups.items(), NAMES):
        keys = [(method, length, name) for length in lengths]
        arrays = [rows[key] for _, rows in results for key in keys if key in rows]
        if arrays:
            yield (method, samples, name), arrays


def rows_without_record(results):
    """Yield the rows of `store` for results of `judged_without_record`."""
    for method, part, case in product(NO_RECORD_METHODS, PERIOD_PARTS, (0, 1)):
        arrays = [
            array
            for seed, rows in results
            if seed % 2 == case
            for array in rows.get((method, part), ())
        ]
        yield (method, f"1/{part} of the period", ("free", "force")[case]), arrays


def print_table(results, samples):
    """Print the two shares by method and column, and the numbers of errors that were judged.

    Parameters
    ----------
    results : list
        Results of `judged`.
    samples : list of float
        Time steps, sampling intervals.
    """
    short = [length for length in samples if length < LONG]
    long = [length for length in samples if length >= LONG]
    # Title, methods and time steps of each row.
    lines = [(method, [method], short or long) for method in METHODS]
    lines += [("all methods", METHODS, short)] if short else []
    lines += [
        (f"all methods, {' and '.join(f'{x:g}' for x in sorted(long))} samples", METHODS, long)
    ]
    # Arrays of all cases by method, time step and column.
    by_key = defaultdict(list)
    for _, rows in results:
        for key, values in rows.items():
            by_key[key].append(values)
    columns = [name for name in NAMES if any(key[2] == name for key in by_key)]
    lengths = ", ".join(f"{length:g}" for length in sorted(short or long))
    heads = [HEADS[NAMES.index(name)] for name in columns]
    print(f"| steps of {lengths} samples | {' | '.join(heads)} | all |")
    print("|---" * (len(columns) + 2) + "|")
    for title, methods, steps in lines if long else lines[:-1]:
        keys = list(product(methods, steps))
        arrays_by_column = [
            [array for key in keys for array in by_key[*key, name]] for name in columns
        ]
        # The last column contains all errors.
        cells = [
            cell(arrays) if any(array.size for array in arrays) else "-"
            for arrays in (*arrays_by_column, list(chain.from_iterable(arrays_by_column)))
        ]
        print(f"| {title} | {' | '.join(cells)} |")
    numbers = [
        sum(array.shape[1] for key in by_key if key[2] == name for array in by_key[key])
        for name in columns
    ]
    print(
        f"\n{sum(bool(rows) for _, rows in results)} of {len(results)} cases have a true value; "
        f"errors judged by column: {', '.join(map(str, numbers))}"
    )
    if long:
        shares = {}
        for method, name in product(METHODS, columns):
            arrays = [array for length in long for array in by_key[method, length, name]]
            if any(array.size for array in arrays):
                shares[method, name] = cell(arrays)
        # The first number of a cell is the share of estimates that are too small.
        method, name = max(shares, key=lambda key: float(shares[key].split()[0]))
        print(f"largest share with long steps: {shares[method, name]} ({method}, {name})")


LADDER = (16, 12, 8, 6, 4, 3, 2, 1, 1 / 2, 1 / 3, 1 / 4, 1 / 6, 1 / 8, 1 / 12, 1 / 16)
"""Time steps of single runs, sampling intervals."""


def single_runs(model, record, duration, true):
    """Return errors and costs of impulse4 with the time steps of `LADDER`.

    Parameters
    ----------
    model, record, duration
        See `case_of`.
    true : ndarray
        True peak drifts, m.

    Returns
    -------
    list of (float, float)
        Maximum relative error of the peak drifts, and number of solves; both inf for a failed run.
    """
    runs = []
    for part in LADDER:
        response = attempt(
            model, record, method="impulse4", dt=part * record.dt, duration=duration, check=False
        )
        if response is None:
            runs.append((np.inf, np.inf))
            continue
        error = np.max(np.abs(response.stories.peak_drift / true - 1.0))
        runs.append((error, response.iterations))
    return runs


def least_solves(runs, tolerance):
    """Return the solves of the cheapest run that meets a tolerance with all shorter steps; nan if
    no run does. `runs` is a result of `single_runs`, from long to short steps."""
    good = takewhile(lambda run: run[0] <= tolerance, reversed(runs))
    return min((solves for _, solves in good), default=np.nan)


def search_step(model, record, duration, method, tolerance):
    """Search the time step for a tolerance.

    Parameters
    ----------
    model, record, duration
        See `case_of`.
    method : str
        Name of the method.
    tolerance : float
        Tolerance of the error.

    Returns
    -------
    response : Response or None
        Accepted run; None if the search fails.
    solves : ndarray, shape (3,)
        Solves of all runs of the search, of its first two runs, and of the accepted run; nan if the
        search fails.
    """
    case = prepare(model, record, method=method)
    search = _Search.of(case, tolerance, None, duration)
    try:
        _, response = search.within(np.inf)
    except FailedRun:
        return None, np.full(3, np.nan)
    solves = [run.iterations for run in search.runs.values() if isinstance(run, Response)]
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
        response, solves = search_step(model, record, duration, method, tolerance)
        difference = np.max(np.abs(true[1]["peak_drift"] / true[0]["peak_drift"] - 1.0))
        if response is not None and difference < MAX_DIFFERENCE * tolerance:
            error = np.max(np.abs(response.stories.peak_drift / true[0]["peak_drift"] - 1.0))
            ratios = solves / least_solves(single, tolerance)
            rows.append((method, tolerance, error / tolerance, response.dt / record.dt, *ratios))
    return name, rows


def print_tolerances(results, methods):
    """Print the number of runs that exceed each tolerance, and the solves of the searches.

    `results` is a list of results of `within`.
    """
    for method, tolerance in product(methods, TOLERANCES):
        rows = [
            (name, *row[2:])
            for name, rows_of_case in results
            for row in rows_of_case
            if row[:2] == (method, tolerance)
        ]
        errors, samples, *ratios = np.array([row[1:] for row in rows]).T
        search, pair, accepted = (np.nanmedian(values) for values in ratios)
        print(
            f"{method}, {100.0 * tolerance:g} %: {np.sum(errors > 1.0)} of {len(rows)} runs exceed "
            f"it; medians: error {np.median(errors):.2f} of the tolerance, {np.median(samples):g} "
            f"samples per step, {search:.2f} times the minimum number of solves (first pair "
            f"{pair:.2f}, accepted run {accepted:.2f})"
        )
        for name, error, length, *_ in rows:
            if error > 1.0:
                print(
                    f"  {name}: error {error:.3g} times the tolerance, {length:g} samples per step"
                )


def main():
    """Run the cases of a table in processes, and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
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
    parser.add_argument("--store", action="store_true")
    options = parser.parse_args()
    names = list(names_of(options.seed, options.buildings, options.scales, options.standard))
    methods, samples = (
        options.method.split(","),
        [float(length) for length in options.samples.split(",")],
    )
    work = (
        partial(within, methods=methods)
        if options.table == "tolerance"
        else partial(judged, separate=options.table == "separate-solver", samples=samples)
    )
    if options.table == "no-record":
        work, names = judged_without_record, range(options.seed, options.seed + options.buildings)
    with ProcessPoolExecutor(options.processes) as pool:
        results = list(pool.map(work, names))
    if options.table == "no-record":
        if options.store:
            store(options.table, results, rows_without_record(results))
        print_without_record(results)
        return
    if options.table == "tolerance":
        print_tolerances(results, methods)
        return
    if options.store:
        store(options.table, results, rows_with_record(results))
    for is_random in (True, False):
        group = [result for result in results if result[0].startswith("building") == is_random]
        if group:
            print_table(group, samples)


if __name__ == "__main__":
    main()
