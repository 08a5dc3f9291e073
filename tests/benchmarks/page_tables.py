"""Tables of the benchmark page that are made from stored points and measurements.

Each function returns Markdown, and `run.py` inserts it into a section. No function measures.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from itertools import product
from pathlib import Path
from statistics import geometric_mean, median

import raw_points

from tdint.assessment.chart.performance_profiles import (
    COARSE,
    PEAKS,
    TOLERANCES,
    FieldChart,
    Measured,
    has_specified_steps,
)
from tdint.assessment.chart.work_precision import BY_TOLERANCE, NOT_RUN
from tdint.model.status import DONE

HERE = Path(__file__).parent
WORDS = {
    "peak_drift": "peak drift",
    "peak_absolute_acceleration": "peak absolute acceleration",
    "peak_total_shear": "peak total shear",
}
ALIKE = 1.1
"""Costs that differ by at most this factor count as equal: repeated measurements differ as much."""
NEAR = (0.95, 1.05)
"""Range of the ratio of two errors of the same method by two programs."""
TOLERANCE_NOTE = """\
Processor time of the whole command `tdint run --tolerance` with `impulse4` (choice of the time step
and error estimate), divided by the time of the cheapest single run that meets the tolerance: of all
methods, and of `impulse4`. The user who asks for a tolerance does not know this single run; a run
and its check with half the time step already cost 3 times the single run. The run counted here is
the one for which the tolerance was asked. The search controls the error of the story drifts.

The goal is a median of at most 4 for peak drifts. It is met at .01 % alone, for two reasons:

- The time of the single run is that of its time loop, and the time of the command contains also
  the Python code of each run and of the error estimates. In a separate measurement of 33 problems,
  the medians at 10, 3, 1, .3, .1 and .01 % were 6.3, 5.4, 5.2, 5.3, 4.5 and 3.7. The medians of the
  time loops alone were 4.0, 3.7, 3.2, 3.8, 3.3 and 3.0; the Python code of the runs added 1.0, .9,
  .8, .7, .5 and .4, and the selection and the error estimates 1.4, 1.1, 1.0, .8, .6 and .5.
- The error of a run is confirmed by the next longer step of the search. Solves are counted by
  `python tests/benchmarks/error_estimates.py tolerance --method impulse4 --standard`. On the 36
  problems, a search needs 4.5, 3.8, 3.4, 3.5, 3.4 and 3.0 times the solves of the single run. The
  first pair of runs, with 4 and 2 sampling intervals (2 and 1 below .3 %), needs 4.3, 3.2, 2.7,
  2.2, 3.0 and 1.5 times these solves, and the accepted run 2.8, 2.3, 2.0, 2.0, 2.0 and 2.0 times.
  With a first step of eight intervals, twice as many results exceed the tolerance in random
  buildings, see [tests](../MEASUREMENTS.md#reliability-of-error-estimates).

A profile (cProfile; tanh, near-fault, 10 %, a search of two runs) shows no work that is repeated or
discarded. The time loops take 1.6 ms, the Python code 0.9 ms with 1375 function calls: two fifths
of this time for the results of both runs, a seventh for the error estimates, and less for all other
functions.
"""
SPECTRA = (
    "tdint at most 5.8e-12, eqsig 0.11 % above 0.1 s and 1.8 % below 0.02 s, pyrotd 5.8 to 31 %"
)
"""Errors of elastic spectra in the table of tests/MEASUREMENTS.md."""
LOOPS_NOTE = """\
The cause is the selection of the law of each story. Loops for all laws without modal damping and
forces on floors take 1.05 times the time of own loops (base-isolated, `gauss4`; all laws and all
features 1.10), loops for the laws of the building with all features 0.99 times. The linear and the
bilinear law are tested first and are part of the loop. Other laws are called; code of all laws
within the loop would make it larger, and its compilation several times longer.
Loops of a wheel, for the oldest processor of its platform (linux-x86-64-v3), take 1.00
(base-isolated), 1.12 (ten-story) and 1.05 times (collapse-prone-frame) the time with `gauss4`.

The gap remains: up to 15 % of the time of a loop. Loops for groups of laws would multiply the size
of a wheel, which has 1.4 MB for one processor. An own loop that is compiled during a long study
takes 13 to 21 s of processor time for ten stories ([measured](../MEASUREMENTS.md)). With the median
gain of 6 %, it pays for studies of more than 4 to 6 minutes, and only if numba is installed. It is
not built: it would change the loops during a study. `tdint compile MODEL.yaml` compiles own loops
before a long study; these are used in preference to the loops for all laws.
"""
OTHER_SCHEME = "bouc-wen"
"""Building whose law OpenSees integrates by a scheme of order 1."""


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    return (
        "\n".join("|" + "|".join(line) + "|" for line in (heads, ["---"] * len(heads), *rows))
        + "\n"
    )


def percent(tolerance: float) -> str:
    """Return a tolerance in percent."""
    return f"{100.0 * tolerance:g} %"


# ---- The cost of `tdint run --tolerance`


def cost_of_tolerances(chart: FieldChart, method: str = "impulse4") -> str:
    """Return the table of the costs of runs for which a tolerance was asked.

    The tables of profiles take the cheapest run of a line whose error is small enough, so a run
    for 3 % may count at 0.01 %. This table takes the run for which the tolerance was asked.

    Parameters
    ----------
    chart : FieldChart
        Results of the problems.
    method : str
        Method whose lines with and without a tolerance are compared.

    Returns
    -------
    str
        Explanation and table, a row for each quantity and tolerance.
    """
    rows = []
    for quantity, tolerance in product(PEAKS, TOLERANCES):
        over_all: list[float] = []
        over_method: list[float] = []
        beyond = 0
        for problem in chart.measured:
            asked = [
                point
                for point in problem.points
                if point.method == f"{method} within {tolerance:g}" and point.outcome == DONE
            ]
            if not asked or not problem.judges(quantity, tolerance):
                continue
            beyond += asked[0].error(quantity) > tolerance
            costs = problem.costs(quantity, tolerance)
            single = {
                line: cost
                for line, cost in costs.items()
                if has_specified_steps(line) and not line.endswith(BY_TOLERANCE) and cost == cost
            }
            over_all.append(asked[0].fastest / min(single.values()))
            if method in single:
                over_method.append(asked[0].fastest / single[method])
        if over_all:
            rows.append(
                [
                    WORDS[quantity],
                    percent(tolerance),
                    f"{median(over_all):.2f}",
                    f"{median(over_method):.2f}",
                    f"{max(over_method):.1f}",
                    f"{sum(ratio <= 4.0 for ratio in over_method)} of {len(over_method)}",
                    f"{beyond} of {len(over_all)}",
                ]
            )
    heads = [
        "error", "tolerance", "median, cheapest method", f"median, {method}", f"largest, {method}",
        "at most 4", "beyond the tolerance",
    ]  # fmt: skip
    return f"{TOLERANCE_NOTE}\n{table(heads, rows)}"


# ---- The cheapest method by building and tolerance


def mean_costs(measured: Sequence[Measured], tolerance: float) -> dict[str, float]:
    """Return the geometric mean of the cost over the least cost of each of our methods.

    Parameters
    ----------
    measured : sequence of Measured
        Problems.
    tolerance : float
        Tolerance of all three quantities.

    Returns
    -------
    dict
        Means by method; only methods that solve all problems for all quantities.
    """
    ratios = defaultdict(list)
    judged = 0
    for problem, quantity in product(measured, PEAKS):
        if not problem.judges(quantity, tolerance):
            continue
        judged += 1
        # The cost of a method that does not solve the problem is nan.
        costs = {
            line: cost
            for line, cost in problem.costs(quantity, tolerance).items()
            if has_specified_steps(line) and not math.isnan(cost)
        }
        minimum = min(costs.values(), default=math.nan)
        for line, cost in costs.items():
            ratios[line].append(cost / minimum)
    return {
        line: geometric_mean(values) for line, values in ratios.items() if len(values) == judged
    }


def cheapest(measured: Sequence[Measured], tolerance: float) -> list[str]:
    """Return the methods with the least mean cost, the cheapest first; see `ALIKE`."""
    means = sorted(mean_costs(measured, tolerance).items(), key=lambda item: item[1])
    return [line for line, mean in means if mean <= ALIKE * means[0][1]]


def by_building(chart: FieldChart) -> dict[str, list[Measured]]:
    """Return the problems of each building."""
    buildings: dict[str, list[Measured]] = {}
    for problem in chart.measured:
        buildings.setdefault(problem.name, []).append(problem)
    return buildings


def statements(chart: FieldChart) -> list[str]:
    """Return sentences on the cheapest methods, one for each range of tolerances."""
    buildings = by_building(chart)
    sentences = []
    for tolerance in TOLERANCES:
        # Number of buildings for which a method is the cheapest, by method.
        counts: dict[str, int] = defaultdict(int)
        for problems in buildings.values():
            methods = cheapest(problems, tolerance)
            if methods:
                counts[methods[0]] += 1
        leaders = sorted(counts.items(), key=lambda item: -item[1])
        listed = ", ".join(f"`{line}` for {count}" for line, count in leaders)
        sentences.append(
            f"{percent(tolerance)}: the cheapest method of {len(buildings)} buildings is {listed}."
        )
    return sentences


def cheapest_methods(chart: FieldChart) -> str:
    """Return the table of the cheapest methods by building and tolerance, with statements."""
    rows = [
        [
            name,
            *(
                ", ".join(f"`{line}`" for line in cheapest(problems, tolerance)[:3]) or "-"
                for tolerance in TOLERANCES
            ),
        ]
        for name, problems in by_building(chart).items()
    ]
    listed = "\n".join(f"- {sentence}" for sentence in statements(chart))
    return (
        "The cheapest method of a building has the smallest geometric mean, over its ground "
        "motions and the three quantities, of the cost divided by the minimum cost. Only methods "
        f"that solve all cases are compared. Methods with at most {ALIKE:g} times the smallest "
        f"mean are listed also; at most three methods are listed.\n\n{listed}\n\n"
        f"{table(['building', *map(percent, TOLERANCES)], rows)}"
    )


# ---- The verdicts of two machines


def _count_near_minimum(chart: FieldChart, smallest_tolerance: float) -> dict[str, int]:
    """Return how often a method solves a problem at most at twice the minimum cost, by method.

    The count includes all quantities, and all tolerances from `smallest_tolerance` on. The methods
    are in the order of decreasing counts.
    """
    counts: dict[str, int] = defaultdict(int)
    for profile in chart.profiles:
        if has_specified_steps(profile.method) and profile.tolerance >= smallest_tolerance:
            counts[profile.method] += profile.within(2.0)
    return dict(sorted(counts.items(), key=lambda item: -item[1]))


def leading_methods(charts: Sequence[FieldChart], smallest_tolerance: float) -> list[str]:
    """Return the methods that lead on at least one machine.

    A method leads if it costs at most twice the minimum in the most cases. Counts that differ by at
    most the factor `ALIKE` are equal within the scatter of the times, so that several methods can
    lead. Methods that lead on a single machine are included, because a verdict of the page has to
    hold on all measured machines.

    Parameters
    ----------
    charts : sequence of FieldChart
        Results of the same problems on each machine.
    smallest_tolerance : float
        Smallest tolerance that is included.
    """
    leaders: list[str] = []
    for chart in charts:
        counts = _count_near_minimum(chart, smallest_tolerance)
        largest = max(counts.values())
        leaders += [name for name, count in counts.items() if count * ALIKE >= largest]
    return list(dict.fromkeys(leaders))


def describe_methods(chart: FieldChart, names: Sequence[str], smallest_tolerance: float) -> str:
    """Return methods with the number of cases in which they cost at most twice the minimum.

    Parameters
    ----------
    chart : FieldChart
        Results of the problems.
    names : sequence of str
        Methods.
    smallest_tolerance : float
        Smallest tolerance that is included.
    """
    counts = _count_near_minimum(chart, smallest_tolerance)
    return " and ".join(f"`{name}` ({counts.get(name, 0)} cases)" for name in names)


def compare_verdicts(first: FieldChart, second: FieldChart) -> str:
    """Return a table that compares the verdicts of two measurements of the same problems.

    Parameters
    ----------
    first, second : FieldChart
        Results on two machines.
    """
    rows = []
    for text, tolerance in (("all tolerances", 0.0), (f"{percent(COARSE)} and more", COARSE)):
        names = leading_methods([first, second], tolerance)
        counts = [describe_methods(chart, names, tolerance) for chart in (first, second)]
        rows.append([f"most often at most twice the minimum cost, {text}", *counts])
    safest = [f"`{chart.leaders().safest}`" for chart in (first, second)]
    rows.append(["method that fails least often", *safest])
    # Solved problems: errors and stability, which do not depend on the speed of a machine.
    solved = [
        {
            (profile.quantity, profile.tolerance, profile.method): profile.solved
            for profile in chart.profiles
            if has_specified_steps(profile.method)
        }
        for chart in (first, second)
    ]
    equal = sum(solved[1].get(key) == count for key, count in solved[0].items())
    # The cheapest method of the first machine for a building and tolerance, on the second machine.
    ratios = []
    buildings = by_building(first), by_building(second)
    for tolerance, name in product(TOLERANCES, buildings[0]):
        methods = cheapest(buildings[0][name], tolerance)
        if methods:
            means = mean_costs(buildings[1][name], tolerance)
            ratios.append(means[methods[0]] / min(means.values()))
    alike = sum(ratio <= ALIKE for ratio in ratios)
    return (
        f"{table(['verdict', 'first machine', 'second machine'], rows)}\n"
        f"- The number of solved problems is equal in {equal} of {len(solved[0])} cells of the "
        "tables above (methods of tdint, quantities, tolerances).\n"
        f"- The method that is cheapest on the first machine for a building and a tolerance costs "
        f"at most {ALIKE:g} times the minimum on the second machine in {alike} of {len(ratios)} "
        f"cases, and at most {max(ratios):.2f} times in all cases.\n"
    )


# ---- The same method by two programs


def ratios_of_errors(chart: FieldChart, line: str, quantity: str) -> dict[str, list[float]]:
    """Return errors of OpenSees divided by those of the method of tdint with the same name.

    Steps longer than the sampling interval are omitted, because peaks between the steps differ.

    Parameters
    ----------
    chart : FieldChart
        Results.
    line : str
        Line of OpenSees, such as `openseespy/hht`.
    quantity : str
        Quantity of the errors.

    Returns
    -------
    dict of str to list of float
        Ratios of all ground motions and time steps, by building.
    """
    own_method = line.partition("/")[2]
    ratios: dict[str, list[float]] = {}
    for problem in chart.measured:
        own_errors = {
            round(point.dt / problem.interval, 6): point.error(quantity)
            for point in problem.points
            if point.line == own_method
        }
        for point in problem.points:
            # The margin of 0.1 % absorbs rounding of the step.
            if point.line != line or point.dt > 1.001 * problem.interval:
                continue
            own_error = own_errors.get(round(point.dt / problem.interval, 6), math.nan)
            error = point.error(quantity)
            if own_error > 0.0 and error > 0.0:
                ratios.setdefault(problem.name, []).append(error / own_error)
    return ratios


def errors_of_same_methods(chart: FieldChart, lines: Sequence[str]) -> str:
    """Return a table of the ratios of errors of two programs.

    Parameters
    ----------
    chart : FieldChart
        Results.
    lines : sequence of str
        Lines of OpenSees.
    """
    rows = []
    for line, quantity in product(lines, PEAKS):
        found = ratios_of_errors(chart, line, quantity)
        cells = []
        for values in found.values():
            near = sum(NEAR[0] <= value <= NEAR[1] for value in values)
            cells.append(f"{median(values):.3g} ({near}/{len(values)})")
        if found:
            rows.append([f"`{line}`", WORDS[quantity], *cells])
            heads = ["ratio of errors", "quantity", *found]
    if not rows:
        return ""
    return (
        "The next table contains errors of OpenSees divided by errors of the method of tdint with "
        "the same name and time step, up to the sampling interval: the median, and in parentheses "
        f"the number of ratios between {NEAR[0]:g} and {NEAR[1]:g}. Accelerations and shears "
        "agree. Drifts differ because the peaks of tdint include peaks between the time steps. "
        f"OpenSees integrates the hysteresis model of {OTHER_SCHEME} with a scheme of order 1."
        f"\n\n{table(heads, rows)}"
    )


# ---- Questions of an independent review


def review(chart: FieldChart, lines: Sequence[str], apart: str, seconds: float) -> str:
    """Return the answers to five questions of a review, with numbers from the stored files.

    Parameters
    ----------
    chart : FieldChart
        Results.
    lines : sequence of str
        Lines of OpenSees that are among the profiles.
    apart : str
        Line of OpenSees in a separate table.
    seconds : float
        Time limit of OpenSees for a problem and an integrator, s.
    """
    points = [point for problem in chart.measured for point in problem.points]
    counts = {
        line: (
            sum(point.line == line for point in points),
            sum(point.line == line and point.outcome == NOT_RUN for point in points),
        )
        for line in (*lines, apart)
    }
    runs = "; ".join(f"`{line}` {missing} of {all_}" for line, (all_, missing) in counts.items())
    ratios = [
        ratio
        for line, quantity in product(lines, PEAKS[1:])
        for building, values in ratios_of_errors(chart, line, quantity).items()
        if building != OTHER_SCHEME
        for ratio in values
    ]
    near = sum(NEAR[0] <= ratio <= NEAR[1] for ratio in ratios)
    middle = median(ratios) if ratios else math.nan  # without OpenSees there are no ratios
    adaptive = [
        float(row["time_s"]) / float(row["impulse4_time_s"])
        for row in raw_points.read(HERE / "adaptive.csv")
        if row["status"] == DONE
    ]
    loops = [float(row["ratio"]) for row in raw_points.read(HERE / "loops.csv")]
    return (
        "An independent review of a former version of this page raised five questions.\n\n"
        "1. *Did OpenSees not solve a problem, or was it stopped?* Each integrator has its own "
        f"limit of {seconds:g} s for a problem, and long steps are run first. Runs that were not "
        f"executed count as not run: {runs}. [Other programs](#other-programs) contains the "
        "counts.\n"
        "2. *Are both programs judged by the same acceleration?* Yes, by that of equilibrium at "
        "the end of a step. At equal steps, the median ratio of the errors of accelerations and "
        f"shears of OpenSees to those of tdint is {middle:.2f}; {near} of {len(ratios)} "
        f"ratios are between {NEAR[0]:g} and {NEAR[1]:g} (without {OTHER_SCHEME}, see "
        "[Other programs](#other-programs)).\n"
        "3. *How large are the errors of spectra, measured by a second implementation?* "
        f"{SPECTRA[0].upper()}{SPECTRA[1:]} ([Spectra](../MEASUREMENTS.md#spectra)).\n"
        f"4. *Where are the raw points?* The {len(points)} runs are in [points.csv](points.csv); "
        "`python tests/benchmarks/run.py --page` writes all tables and figures from the CSV files "
        "without a run. Adaptive solvers with located events take "
        f"{min(adaptive):.0f} to {max(adaptive):.0f} times the time of `impulse4` "
        "([Adaptive solvers](#adaptive-solvers)).\n"
        "5. *Are all times measured in loops of the same kind?* Yes, in loops for the laws of the "
        "building. Loops for all laws, which wheels contain, take "
        f"{min(loops):.2f} to {max(loops):.2f} times as long, median {median(loops):.2f} "
        "([Loops for all laws](#loops-for-all-laws)).\n"
    )


# ---- A plain loop, and the cost of a call


def plain_loop_tables() -> str:
    """Return the tables of plain_loop.csv and fixed_cost.csv."""
    times: dict[str, dict[str, dict[str, float]]] = {}
    for row in raw_points.read(HERE / "plain_loop.csv"):
        building = times.setdefault(row["tolerance"], {}).setdefault(row["building"], {})
        building[row["program"]] = float(row["time_s"])
    rows = []
    for tolerance, buildings in times.items():
        both = [programs for programs in buildings.values() if len(programs) == 2]
        ratios = sorted(programs["plain loop"] / programs["run_case"] for programs in both)
        wins = sum(ratio > 1.0 for ratio in ratios)
        numbers = (f"{ratios[0]:.2g}", f"{median(ratios):.2g}", f"{ratios[-1]:.2g}")
        rows.append([percent(float(tolerance)), *numbers, f"{wins} of {len(ratios)}"])
    heads = ["error of the peak drifts", "minimum", "median", "maximum", "`run_case` is faster"]
    fixed = [
        [
            f"`{row['call'].partition(',')[0]}`",
            f"{1e3 * (float(row['call_s']) - float(row['loop_s'])):.2f}",
            f"{float(row['call_s']) / float(row['loop_s']):.2f}",
        ]
        for row in raw_points.read(HERE / "fixed_cost.csv")
    ]
    first_call = raw_points.read(HERE / "fixed_cost.csv")[0]
    return (
        "The table contains the time of a plain loop divided by the time of `run_case` with "
        "`impulse4` and without error estimate, for ten random bilinear buildings under the "
        "shipped motions. The plain loop is 40 lines of average acceleration for bilinear stories, "
        "compiled with numba, without energies, peaks between steps and checks. Each program uses "
        "the longest time step for which it and all shorter steps meet the tolerance (`python "
        "tests/benchmarks/plain_loop.py`; the programs run alternately in one process).\n\n"
        f"{table(heads, rows)}\n"
        f"A call without error estimate for {first_call['stories']} stories and "
        f"{first_call['steps']} steps, compared with its time loop, which takes "
        f"{1e3 * float(first_call['loop_s']):.2f} ms:\n\n"
        f"{table(['call', 'ms more than the loop', 'times the loop'], fixed)}"
    )


# ---- Loops for all laws


def loads_table() -> str:
    """Return the table of loads.csv: cost of each method under forces on floors."""
    measurements = raw_points.read(HERE / "loads.csv")
    cases = list(dict.fromkeys((row["quantity"], row["tolerance"]) for row in measurements))
    costs = {
        (row["problem"], row["method"], row["quantity"], row["tolerance"]): float(row["time_s"])
        for row in measurements
        if row["time_s"]
    }
    problems = list(dict.fromkeys((row["problem"], row["method"]) for row in measurements))
    heads = ["model", "method"]
    heads += [f"{WORDS[quantity]}, {percent(float(tolerance))}" for quantity, tolerance in cases]

    def cell(problem: str, method: str, case: tuple[str, str]) -> str:
        """Return the cost divided by the minimum cost of all methods; `-` if none is sufficient."""
        cost = costs.get((problem, method, *case))
        if cost is None:
            return "-"
        least = min(costs[key] for key in costs if key[0] == problem and key[2:] == case)
        return f"{cost / least:.2f}"

    rows = [
        [problem, f"`{method}`", *(cell(problem, method, case) for case in cases)]
        for problem, method in problems
    ]
    return f"{LOADS}\n{table(heads, rows)}"


LOADS = """\
Two models without a ground motion: [a tower in wind](../../configs/wind-tower.yaml), which is linear and has 20 forces from
a table, and [a frame under a blast](../../configs/blast-frame.yaml), whose stories yield and whose forces jump. They are not
part of the profiles. The time steps are the same multiples as above, of a fiftieth of the first period, so that kinks and
jumps are inside steps. The table contains the cost of a tolerance divided by the minimum cost of all methods (`-`: no time
step meets the tolerance). Write it with `python tests/benchmarks/loads.py` and `python tests/benchmarks/run.py --page`.
"""  # noqa: E501


def loops_table() -> str:
    """Return the table of loops.csv."""
    measurements = raw_points.read(HERE / "loops.csv")
    sources = list(dict.fromkeys(row["loops"] for row in measurements))  # of the loops
    methods = list(dict.fromkeys(row["method"] for row in measurements))
    ratios: dict[str, dict[tuple[str, str], str]] = {}
    for row in measurements:
        ratios.setdefault(row["model"], {})[row["loops"], row["method"]] = row["ratio"]
    heads = ["model", *(f"`{method}`, {source}" for source, method in product(sources, methods))]
    rows = [
        [
            model,
            *(
                f"{float(model_ratios[key]):.2f}" if key in model_ratios else "-"
                for key in product(sources, methods)
            ),
        ]
        for model, model_ratios in ratios.items()
    ]
    ranges = []
    for source in sources:
        values = [float(row["ratio"]) for row in measurements if row["loops"] == source]
        ranges.append(
            f"{source}: median {median(values):.2f}, {min(values):.2f} to {max(values):.2f}"
        )
    return (
        "All methods of this page run in loops that are compiled for the laws of the building. "
        "Methods and laws of plug-ins always run in such loops. If the cache was filled by `tdint "
        "compile --all`, or tdint was installed from a wheel with compiled loops, built-in methods "
        "run in loops for all laws. These contain the code of each law and select it for each "
        "story at run time. The table contains the time of loops for all laws divided by "
        "the time of loops for the building (`python tests/benchmarks/loops.py`; "
        f"{'; '.join(ranges)}).\n\n"
        f"{table(heads, rows)}\n{LOOPS_NOTE}"
    )
