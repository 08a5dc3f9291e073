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
from tdint.assessment.chart.work_precision import BY_TOLERANCE
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
and its error estimate already cost 3 times the single run. The search controls the error of the
story drifts. The goal, a median of at most 4 for peak drifts, is not met above .01 %:
the error of a run is confirmed by the next longer step of the search, and the Python code of each
run counts. A longer first step would double the number of results beyond the tolerance.
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
                    f"{beyond} of {len(over_all)}",
                ]
            )
    heads = [
        "error", "tolerance", "median, cheapest method", f"median, {method}", f"largest, {method}",
        "beyond the tolerance",
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
    """Return how often each method is the cheapest, one text for each tolerance."""
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
        listed = ", ".join(f"`{line}` {count}" for line, count in leaders)
        sentences.append(f"{percent(tolerance)}: {listed}")
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
        "The cheapest methods of a building have the smallest geometric mean, over its ground "
        "motions and the three quantities, of the cost divided by the minimum cost, or at most "
        f"{ALIKE:g} times this mean (at most three are listed). Only methods that solve all cases "
        "are compared. Number of buildings for which a method is the cheapest, by tolerance:\n\n"
        f"{listed}\n\n"
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
        "Errors of OpenSees divided by errors of the method of tdint with the same name and time "
        "step, up to the sampling interval: the median, and in parentheses the number of ratios "
        f"between {NEAR[0]:g} and {NEAR[1]:g}. Drifts differ because the peaks of tdint include "
        f"peaks between the time steps, {OTHER_SCHEME} because OpenSees integrates its law with a "
        "scheme of order 1."
        f"\n\n{table(heads, rows)}"
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
        "Time of a plain loop divided by the time of `run_case` with `impulse4` and without error "
        "estimate, for ten random bilinear buildings. The plain loop is 40 lines of average "
        "acceleration, compiled with numba, without energies, peaks between steps and checks. Each "
        "program uses the longest time step for which it and all shorter steps meet the tolerance "
        "(`python tests/benchmarks/plain_loop.py`).\n\n"
        f"{table(heads, rows)}\n"
        f"A call without error estimate for {first_call['stories']} stories and "
        f"{first_call['steps']} steps, compared with its time loop, which takes "
        f"{1e3 * float(first_call['loop_s']):.2f} ms:\n\n"
        f"{table(['call', 'ms more than the loop', 'times the loop'], fixed)}"
    )


# ---- Forces on floors


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
a table, and [a frame under a blast](../../configs/blast-frame.yaml), whose stories yield and whose forces jump. The time
steps are multiples of a fiftieth of the first period, so that kinks and jumps are inside steps. The table contains the cost
of a tolerance divided by the minimum cost of all methods (`-`: no time step meets the tolerance); measure it with
`python tests/benchmarks/loads.py`.
"""  # noqa: E501
