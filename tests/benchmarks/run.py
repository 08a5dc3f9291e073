"""Write the benchmark page: python tests/benchmarks/run.py

The page is README.md in this directory, with its figures: the cost of each method for an error in
many problems. The results of all runs are stored in points.csv, problems.csv and conditions.csv.
All tables and figures are made from these files and from adaptive.csv.
`--page` writes the page from the files without a measurement. Finished problems are kept
(TDINT_CACHE_DIR or the user's cache) until methods or problems change, so that a command that was
interrupted continues. `--tolerances` measures only the lines `by tolerance` again.
`--second-machine` stores the results in the directory `second_machine`. The page compares its
verdicts with these results.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import io
import math
import pickle
import platform
import re
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from itertools import product
from multiprocessing import get_context
from pathlib import Path

# Directories of the modules of the tests and of the benchmarks.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).parent))
import page_tables
import raw_points
from page_tables import WORDS, percent, table
from raw_points import Conditions, Entry

import png_text
import tdint
from tdint import system
from tdint.assessment.chart import opensees_worker, work_precision
from tdint.assessment.chart import peers as peers_module
from tdint.assessment.chart import performance_profiles as profiles
from tdint.assessment.chart.chart_figures import chart_picture, profile_picture
from tdint.assessment.chart.performance_profiles import (
    COARSE,
    METHODS,
    PARTS,
    PEAKS,
    STANDARD,
    TOLERANCES,
    FieldChart,
    FieldProblem,
    Measured,
    field_chart,
    measure_problem,
    read_problems,
)
from tdint.assessment.chart.problem import FloorMotion, Reference, ending_together
from tdint.assessment.chart.work_precision import Chart, PerformanceProfile, Point, within
from tdint.errors import TdintError
from tdint.kernels.building.sources import digest_of_all
from tdint.methods.catalogue import chosen, parse
from tdint.output.figures.style import picture

HERE = Path(__file__).parent
SECOND_MACHINE = HERE / "second_machine"
"""Directory of the results of another machine."""
PAGE = HERE / "README.md"
COMMAND = "python tests/benchmarks/run.py"
"""The command of the page, stored in its figures."""

CHARTS = (("linear", "near-fault"), ("bilinear", "near-fault"), ("bouc-wen", "near-fault"))
"""Problems whose points are drawn: a smooth problem that suits methods of order 4, one with kinks
of the force, and one with smooth hysteresis."""

SAME = ("openseespy/newmark-average", "openseespy/hht")
"""Lines of OpenSees whose errors are compared with those of our method of the same name."""
MINUTES = 20.0
"""Default time after which no further problem is started, min."""
REPEATS = 3
"""Number of times that the lines by tolerance are timed."""


# ---- Measuring, a file for each finished problem


def journal(methods: Sequence[str], peers: bool) -> Path:
    """Return the directory of finished problems.

    The directory depends on everything that changes the measured times and errors: methods, time
    loops, the version of OpenSeesPy, and the modules that measure.

    Parameters
    ----------
    methods : sequence of str
        Names of the methods.
    peers : bool
        True if OpenSeesPy is measured if it is installed.
    """
    sources = [
        Path(module.__file__).read_text(encoding="utf-8")
        for module in (profiles, work_precision, peers_module, opensees_worker)
    ]
    program = (
        (version("openseespy") if find_spec("openseespy") else "missing") if peers else "without"
    )
    identity = (*methods, program, digest_of_all(), *sources)
    digest = hashlib.sha256("\n".join(identity).encode()).hexdigest()[:16]
    directory = system.cache_subfolder(f"benchmarks-{digest}")
    if directory is None:
        sys.exit("the cache directory cannot be written: set TDINT_CACHE_DIR to another directory")
    return directory


def problem_file(directory: Path, problem: FieldProblem) -> Path:
    """Return the file for the results of a problem.

    Its name contains a digest of the building and the ground motion, so a changed problem has
    another file.
    """
    posed = problem.posed
    tables = (
        posed.building.linear_terms,
        posed.building.law_parameters,
        posed.building.modal,
        posed.ground,
    )
    digest = hashlib.sha256(b"".join(table.tobytes() for table in tables)).hexdigest()[:12]
    return directory / f"{problem.name}-{problem.motion}-{digest}.pickle"


def measure_standard_problem(number: int, file: Path, methods: Sequence[str], peers: bool) -> str:
    """Measure one of the standard problems, store its results, and return a line about it.

    Parameters
    ----------
    number : int
        Index of the problem in the file of standard problems.
    file : Path
        File for the results.
    methods : sequence of str
        Names of the methods.
    peers : bool
        True to measure OpenSeesPy also, if it is installed.
    """
    problem = read_problems(STANDARD)[number]
    names = dict.fromkeys([*methods, "impulse4", "moment4"])
    problem.posed.prepared.compile([parse(name) for name in names])
    began = time.process_time()
    measured = measure_problem(problem, chosen(methods), tolerances=TOLERANCES, peers=peers)
    # On a busy machine the process of OpenSees may not start. Such a result is not stored, so that
    # the next command measures the problem again.
    if peers_module.NO_PROCESS in measured.peer_note:
        return f"{problem.name}, {problem.motion}: not kept, openseespy: {measured.peer_note}"
    day = datetime.datetime.now(tz=datetime.UTC).date().isoformat()
    seconds = time.process_time() - began
    new = file.with_suffix(".new")
    new.write_bytes(pickle.dumps((measured, day, system.load(), seconds)))
    new.replace(file)
    return f"{problem.name}, {problem.motion}: {seconds:.0f} s of processor time"


def measure_tolerance_lines(number: int, file: Path, methods: Sequence[str]) -> str:
    """Measure the lines `by tolerance` of a standard problem again, and replace the stored lines.

    The machine may be slower now than in the first measurement. The times are therefore multiplied
    by the ratio of the former to the present time of a run that both measurements contain: impulse4
    at the sampling interval.

    Parameters
    ----------
    number : int
        Index of the problem in the file of standard problems.
    file : Path
        File with the results of the problem; it is replaced.
    methods : sequence of str
        Names of the methods. Only methods with a choice of the time step by a tolerance are
        measured.

    Returns
    -------
    str
        A line about the measurement.
    """
    problem = read_problems(STANDARD)[number]
    measured, day, load, seconds = pickle.loads(file.read_bytes())
    problem.posed.prepared.compile([parse("impulse4"), parse("moment4")])
    posed = ending_together(problem.posed, [problem.posed.interval * part for part in PARTS])
    steps = posed.steps(posed.interval)
    true = posed.case(parse("impulse4")).integrate(posed.steps(posed.interval / profiles._FINE))
    judge = partial(profiles._peak_errors, true.stories)
    lines: list[Point] = []
    for name in (name for name in work_precision.CHOOSING if name in methods):
        lines += work_precision.by_tolerance(posed, parse(name), TOLERANCES, judge, REPEATS)
    case = posed.case(parse("impulse4"))
    now = min(case.integrate(steps).solver_time for _ in range(REPEATS))
    former = next(p for p in measured.points if (p.line, p.steps) == ("impulse4", steps.count))
    ratio = former.fastest / now
    lines = [replace(p, times=tuple(ratio * time for time in p.times), walls=()) for p in lines]
    kept = [p for p in measured.points if not p.line.endswith(work_precision.BY_TOLERANCE)]
    # The lines of other programs are the last.
    first_peer = next((i for i, p in enumerate(kept) if profiles.PEER in p.line), len(kept))
    new_points = (*kept[:first_peer], *lines, *kept[first_peer:])
    new = file.with_suffix(".new")
    new.write_bytes(pickle.dumps((replace(measured, points=new_points), day, load, seconds)))
    new.replace(file)
    return f"{problem.name}, {problem.motion}: by tolerance, times {ratio:.2f}"


def measure(todo: Sequence[Callable[[], str]], processes: int, minutes: float) -> None:
    """Call functions in processes and print their results.

    Parameters
    ----------
    todo : sequence of callable
        Functions that measure a problem and return a line about it.
    processes : int
        Number of processes.
    minutes : float
        Time after which no further function is called, min.
    """
    deadline = time.monotonic() + 60.0 * minutes
    waiting = list(todo)
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        running = {pool.submit(waiting.pop(0)) for _ in range(min(processes, len(waiting)))}
        while running:
            done = next(as_completed(running))
            running.remove(done)
            print(done.result(), flush=True)
            if waiting and time.monotonic() < deadline:
                running.add(pool.submit(waiting.pop(0)))


# ---- The page


def complete_chart(entries: Sequence[Entry], conditions: Conditions | None = None) -> FieldChart:
    """Return the chart of all problems, with the largest load during the measurement.

    `conditions` are the stored conditions. None: the present conditions of this machine.
    """
    chart = field_chart([entry.measured for entry in entries])
    load = max((entry.load for entry in entries if entry.load is not None), default=None)
    if conditions is not None:
        chart = replace(chart, timing=conditions.timing, peers=conditions.peers)
    return replace(chart, timing=replace(chart.timing, load=load))


def conditions_of(entries: Sequence[Entry]) -> Conditions:
    """Return the conditions of a measurement that has just been made."""
    packages = {"NumPy": "numpy", "numba": "numba", "llvmlite": "llvmlite"}
    versions = [f"tdint {tdint.__version__}", f"Python {platform.python_version()}"]
    versions += [f"{name} {version(package)}" for name, package in packages.items()]
    chart = complete_chart(entries)
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"],
        cwd=HERE,
        capture_output=True,
        text=True,
        check=False,
    ).stdout.strip()
    return Conditions(
        ", ".join(versions),
        platform.system(),
        chart.timing,
        chart.peers,
        digest_of_all(),
        commit,
    )


def cell(profile: PerformanceProfile | None) -> str:
    """Return the cell of a method in a table of profiles.

    Its numbers, separated by slashes, are: problems solved within twice the minimum cost, median
    and largest ratio of the cost to the minimum cost, and problems that are not solved (in
    parentheses the number of problems that were not run). It is empty for a method without a
    profile.
    """
    if profile is None:
        return ""
    failed = profile.problems - profile.solved
    median = f"{profile.median:.2f}" if math.isfinite(profile.median) else "-"
    worst = f"{profile.worst:.1f}" if profile.solved else "-"
    not_run = f" ({profile.not_run} not run)" if profile.not_run else ""
    return f"{profile.within(2.0)}/{median}/{worst}/{failed}{not_run}"


def tables_of_profiles(chart: FieldChart) -> str:
    """Return a table for each quantity: a row for each method, a column for each tolerance."""
    profiles_by_key = {
        (profile.quantity, profile.tolerance, profile.method): profile for profile in chart.profiles
    }
    text = ""
    for quantity in PEAKS:
        # Number of problems by tolerance. A problem is omitted if its reference is too inexact.
        counts: dict[float, int] = {}
        for profile in chart.profiles:
            if profile.quantity == quantity:
                former = counts.get(profile.tolerance, 0)
                counts[profile.tolerance] = max(former, profile.problems)
        tolerances = [tolerance for tolerance in TOLERANCES if tolerance in counts]
        heads = [
            "method",
            *(f"{percent(tolerance)} ({counts[tolerance]})" for tolerance in tolerances),
        ]
        rows = [
            [
                f"`{line}`{chart.named(line).removeprefix(line)}",
                *(cell(profiles_by_key.get((quantity, t, line))) for t in tolerances),
            ]
            for line in chart.lines
            if any((quantity, t, line) in profiles_by_key for t in tolerances)
        ]
        text += f"### {WORDS[quantity].capitalize()}\n\n{table(heads, rows)}\n"
    return text


def _cheapest_points(problem: Measured, quantity: str, tolerance: float) -> dict[str, Point]:
    """Return the cheapest run of each method that meets a tolerance, by method."""
    points = [point for point in problem.points if profiles.has_specified_steps(point.line)]
    # The last run of a method that is entered is the cheapest.
    return {
        point.line: point
        for point in sorted(points, key=lambda point: -point.fastest)
        if point in within(points, point.line, quantity, tolerance)
    }


def _describe_run(point: Point, interval: float, quantity: str) -> list[str]:
    """Return samples per step, error, solves per step and microseconds per solve of a run."""
    return [
        f"{point.dt / interval:.3g}",
        f"{100.0 * point.error(quantity):.2g} %",
        f"{point.iterations / point.steps:.1f}",
        f"{1e6 * point.fastest / point.iterations:.2f}",
    ]


def most_expensive(chart: FieldChart, line: str = "impulse4") -> str:
    """Return a table of the problems on which a method costs most, compared with the cheapest.

    For each quantity and each tolerance of some percent, the table contains the problem with the
    largest ratio of the cost to the minimum cost.

    Parameters
    ----------
    chart : FieldChart
        Results of the problems.
    line : str
        Name of the method.

    Returns
    -------
    str
        Explanation and table; empty if the method solves no problem.
    """
    rows = []
    time_ratios, solve_ratios = [], []  # of the method to the cheapest: per solve, and per step
    for tolerance, quantity in product((0.1, COARSE), PEAKS):
        comparisons = []
        for problem in chart.measured:
            runs = _cheapest_points(problem, quantity, tolerance)
            if line in runs and problem.judges(quantity, tolerance):
                cheapest = min(runs.values(), key=lambda point: point.fastest)
                ratio = runs[line].fastest / cheapest.fastest
                comparisons.append((ratio, problem, runs[line], cheapest))
        comparisons.sort(key=lambda comparison: -comparison[0])
        for ratio, problem, own, cheapest in comparisons[:1]:
            rows.append(
                [
                    f"{WORDS[quantity]}, {percent(tolerance)}",
                    f"{problem.name}, {problem.motion}",
                    f"{ratio:.1f}",
                    *_describe_run(own, problem.interval, quantity),
                    f"`{cheapest.line}`",
                    *_describe_run(cheapest, problem.interval, quantity),
                ]
            )
            own_time = own.fastest / own.iterations
            time_ratios.append(own_time / (cheapest.fastest / cheapest.iterations))
            own_solves = own.iterations / own.steps
            solve_ratios.append(own_solves / (cheapest.iterations / cheapest.steps))
    if not rows:
        return ""
    # Largest ratio of all problems and quantities at 10 %, and at all smaller tolerances.
    own = [profile for profile in chart.profiles if profile.method == line and profile.solved]
    largest = max((p.worst for p in own if p.tolerance >= 0.1), default=math.nan)
    largest_below = max((p.worst for p in own if p.tolerance < 0.1), default=math.nan)
    run_heads = ["samples per step", "error", "solves per step", "us per solve"]
    heads = ["tolerance", "problem", "cost over minimum", *run_heads, "cheapest", *run_heads]
    return (
        f"If an error of some percent is sufficient, `{line}` is most expensive, relative to the "
        "cheapest method, on the following problems. A solve takes "
        f"{min(time_ratios):.1f} to {max(time_ratios):.1f} times as long as a solve of the "
        "cheapest method, because story forces are evaluated at two times of a step, and "
        "displacements and velocities are solved for together. Within a step, the method stops at "
        "each reversal and each kink of a story force that matters, which makes small errors "
        f"possible. A step has {min(solve_ratios):.1f} to {max(solve_ratios):.1f} times as many "
        f"solves. The largest ratios are {largest:.1f} at 10 % and {largest_below:.1f} at smaller "
        "tolerances; the goals are 5 and 4.\n\n"
        f"{table(heads, rows)}"
    )


def failures(chart: FieldChart) -> str:
    """Return a table of the number of cases that a method does not solve at the smallest tolerance.

    It has a row for each method and a column for each building.
    """
    buildings = list(dict.fromkeys(problem.name for problem in chart.measured))
    rows = []
    for line in chart.lines:
        cells = []
        for name in buildings:
            cases = [
                problem.costs(quantity, TOLERANCES[-1])
                for problem in chart.measured
                for quantity in PEAKS
                if problem.name == name and problem.judges(quantity, TOLERANCES[-1])
            ]
            costs = [case[line] for case in cases if line in case]
            failed = sum(math.isnan(cost) for cost in costs)
            cells.append("-" if not costs else f"**{failed}**" if failed else "0")
        rows.append([f"`{line}`", *cells])
    return table(["method", *buildings], rows)


def problems(chart: FieldChart) -> str:
    """Return a table of all problems, with the uncertainty of each reference solution."""
    rows = []
    for problem in chart.measured:
        ductility = "-" if math.isnan(problem.ductility) else f"{problem.ductility:.1f}"
        gaps = "/".join(f"{problem.gap.of(name):.0e}" for name in PEAKS)
        changes = str(problem.changes)
        rows.append([problem.name, problem.motion, str(problem.stories), ductility, changes, gaps])
    heads = [
        "building", "motion", "stories", "ductility", "changes of branch", "reference known to",
    ]  # fmt: skip
    return f"{PROBLEMS}\n{table(heads, rows)}"


def chart_of(problem: Measured, chart: FieldChart) -> Chart:
    """Return the results of one problem as a chart of `tdint chart`.

    Parameters
    ----------
    problem : Measured
        Results of the problem.
    chart : FieldChart
        Results of all problems; it states how times were measured.
    """
    usual = next(
        point
        for point in problem.points
        if point.line == "newmark-average" and abs(point.dt - problem.interval) < 1e-9
    )
    reference = Reference(
        "impulse4", problem.interval / 32, problem.confirmed_by, problem.gap, NO_MOTION
    )  # type: ignore[arg-type]
    return Chart(
        problem.stories, problem.interval, True, problem.points, reference, usual, chart.timing
    )


NO_MOTION = FloorMotion(1, *4 * (None,))  # type: ignore[arg-type]
"""Placeholder for the motion of the reference, which the figures do not use."""


def pictures(chart: FieldChart) -> list[tuple[str, str, Callable[[], object]]]:
    """Return file, description and drawing function of all figures of the page."""
    shown: list[tuple[str, str, Callable[[], object]]] = []
    for quantity in PEAKS:
        figure = partial(profile_picture, chart, target=quantity.replace("_", "-"))
        file = f"profile-{quantity.replace('_', '-')}.png"
        shown.append((file, f"Performance profiles, errors of {WORDS[quantity]}", figure))
    for name, motion in CHARTS:
        problem = next((m for m in chart.measured if (m.name, m.motion) == (name, motion)), None)
        if problem is not None:
            title = f"{name}, {motion}"
            figure = partial(
                chart_picture, chart_of(problem, chart), name=title, target="peak-drift"
            )
            text = f"Time over error of the peak drifts: {title}"
            shown.append((f"chart-{name}.png", text, figure))
    return shown


def write(file: Path, figure: Callable[[], object]) -> None:
    """Write a figure as PNG with 64 colors, which makes the file small."""
    from PIL import Image  # Pillow is a dependency of matplotlib

    stream = io.BytesIO()
    picture(".png", figure)(stream)  # type: ignore[arg-type]
    Image.open(stream).convert("RGB").quantize(64).save(file, optimize=True)
    png_text.stamp(file, COMMAND)


def machine(entries: Sequence[Entry], chart: FieldChart, conditions: Conditions) -> str:
    """Return versions, machine, days and load of the measurement."""
    days = sorted({entry.day for entry in entries})
    loads = [entry.load for entry in entries if entry.load is not None]
    load = f"load {min(loads):.1f} to {max(loads):.1f}" if loads else "load unknown"
    counts = sorted(chart.timing.repeats)
    # A step that cannot be the cheapest for any tolerance is timed once.
    repeats = (
        f"the least of {counts[-1]} times where a step may be the cheapest, else of {counts[0]}"
    )
    return (
        f"{conditions.versions}; {chart.timing.processor}, {chart.timing.processors} processors, "
        f"{conditions.system}; {' to '.join(dict.fromkeys((days[0], days[-1])))}; "
        f"{system.CLOCKS[chart.timing.clock]}, {repeats}, {load} on {chart.timing.processors} "
        "processors"
    )


def separate_lines(chart: FieldChart) -> str:
    """Return a sentence on each line that the profiles do not contain, with the reason."""
    lines = {point.line for problem in chart.measured for point in problem.points}
    return "".join(
        f"`{line}` is not among the profiles, because it does not implement the method of this "
        f"name. {peers_module.ITERATED}.\n\n"
        for line in profiles.APART
        if line in lines
    )


def _opensees_gaps(chart: FieldChart) -> str:
    """Return a table of the differences between OpenSees and the reference, by building."""
    motions = list(dict.fromkeys(problem.motion for problem in chart.measured))
    gaps = {
        (problem.name, problem.motion): problem.peer_gap
        for problem in chart.measured
        if _has_peers(problem)
    }
    rows = [
        [name, *(f"{gaps[name, motion]:.1e}" for motion in motions)]
        for name in dict.fromkeys(name for name, _ in gaps)
    ]
    return table(["difference from the reference", *motions], rows)


def _has_peers(problem: Measured) -> bool:
    """Return True if another program solved the problem."""
    return any(profiles.PEER in point.line for point in problem.points)


def other_programs(chart: FieldChart) -> str:
    """Return the text and tables about OpenSees, or the reason why it was not measured."""
    if not chart.peers:
        try:
            version("openseespy")
            reason = "was omitted (--no-peers), or can solve none of these problems"
        except PackageNotFoundError:
            reason = "is not installed on this machine"
        return f"No other program was measured for this page: OpenSeesPy {reason}.\n"
    programs = "; ".join(f"{peer.name} {peer.version}" for peer in chart.peers)
    solved = [problem for problem in chart.measured if _has_peers(problem)]
    # The note of a problem contains "3 of 15 runs" if time was too short for three runs.
    not_run = sum(
        int(count)
        for problem in solved
        for count in re.findall(r"(\d+) of \d+ runs", problem.peer_note)
    )
    limit = profiles._SHARE * opensees_worker.SECONDS  # s
    return (
        f"OpenSees is measured on {len(solved)} of {len(chart.measured)} problems, those whose "
        "hysteresis models it contains, and medians refer to these problems. To show that it "
        "solves the same problem, its results with average acceleration are extrapolated to a time "
        "step of zero: their histories of drift and absolute acceleration differ from the "
        "reference (L2 norm) by at most "
        f"{profiles._SURE * TOLERANCES[-1]:.0e}. As in tdint, accelerations are those of "
        "equilibrium at the end of each step. Costs are divided by the minimum cost of the methods "
        f"of tdint. For each problem and integrator, no run starts after {limit:g} s of processor "
        f"time, and long steps are run first: {not_run} runs with short steps are missing. "
        f"{programs}; its settings are in [conditions.csv](conditions.csv).\n\n"
        f"{_opensees_gaps(chart)}\n{separate_lines(chart)}"
    )


def adaptive_table() -> str:
    """Return the table of adaptive.csv, with its explanation."""
    rows = [
        [
            f"{row['problem']}, {row['motion']}",
            f"`{row['method']}`",
            row["rtol"],
            *(f"{float(row[f'{name}_error']):.1e}" for name in PEAKS),
            row["evaluations"],
            row["events"],
            f"{1e3 * float(row['time_s']):.3g}",
            f"{float(row['time_s']) / float(row['impulse4_time_s']):.0f}",
        ]
        for row in raw_points.read(HERE / "adaptive.csv")
        if row["status"] == "done"
    ]
    heads = ["problem", "method", "rtol", "drift error", "acceleration error", "shear error"]
    heads += ["evaluations", "events", "ms", "times impulse4"]
    return f"{ADAPTIVE}\n{table(heads, rows)}"


def second_machine(
    chart: FieldChart,
    conditions: Conditions,
    entries: Sequence[Entry],
    other_chart: FieldChart,
    other_conditions: Conditions,
) -> str:
    """Return the comparison of the verdicts of this page with the verdicts of another machine.

    Parameters
    ----------
    chart, conditions : FieldChart, Conditions
        Results of all problems on the first machine, and the conditions of their measurement.
    entries, other_chart, other_conditions : sequence of Entry, FieldChart, Conditions
        Results and conditions of the second machine.
    """
    return (
        "The verdicts depend on times, and therefore on the machine. "
        "`python tests/benchmarks/run.py --second-machine` was run on another machine with "
        f"{machine(entries, other_chart, other_conditions)} (first machine: "
        f"{conditions.timing.processor}). Its results are in the directory "
        "[second_machine](second_machine/points.csv).\n\n"
        f"{page_tables.compare_verdicts(chart, other_chart)}"
    )


def page(
    entries: Sequence[Entry],
    problem_count: int,
    pictures: Sequence[tuple[str, str]],
    conditions: Conditions,
) -> str:
    """Return the page.

    Parameters
    ----------
    entries : sequence of Entry
        Results of the problems.
    problem_count : int
        Number of standard problems.
    pictures : sequence of tuple of str
        File and description of each figure.
    conditions : Conditions
        Conditions of the measurement.
    """
    chart = complete_chart(entries, conditions)
    other_entries, other_conditions = raw_points.load(SECOND_MACHINE)
    other_chart = complete_chart(other_entries, other_conditions)
    leading = [
        page_tables.describe_methods(
            chart, page_tables.leading_methods([chart, other_chart], tolerance), tolerance
        )
        for tolerance in (0.0, COARSE)
    ]
    leaders = chart.leaders()
    ours = sum(map(profiles.has_specified_steps, chart.lines))
    missing = ""
    if len(entries) < problem_count:
        not_measured = problem_count - len(entries)
        missing = f" {not_measured} of {problem_count} problems were not measured in time."
    images = [f"![{text}]({file})\n" for file, text in pictures]
    sections = {
        "Performance profiles": PROFILES + "\n" + "\n".join(images[: len(PEAKS)]),
        "Tables": TABLES
        + "\n"
        + tables_of_profiles(chart)
        + f"### Where `impulse4` costs most\n\n{most_expensive(chart)}",
        "Cost of a tolerance": page_tables.cost_of_tolerances(chart),
        "Which method is cheapest": page_tables.cheapest_methods(chart),
        "Time over error on three of them": "\n".join(images[len(PEAKS) :]),
        "Where methods fail": FAILURES + "\n" + failures(chart) + MATRIX,
        "Wind and blast": page_tables.loads_table(),
        "Other programs": other_programs(chart) + page_tables.errors_of_same_methods(chart, SAME),
        "Adaptive solvers": adaptive_table(),
        "A plain loop and the cost of a call": page_tables.plain_loop_tables(),
        "A second machine": second_machine(
            chart, conditions, other_entries, other_chart, other_conditions
        ),
        "The problems": problems(chart),
        "A method or a problem of your own": OWN,
    }
    contents = "\n".join(f"- [{title}](#{anchor(title)})" for title in sections)
    body = "\n".join(f"## {title}\n\n{text.rstrip()}\n" for title, text in sections.items())
    return (
        f"{INTRODUCTION}\n{len(entries)} problems, {ours} methods.{missing} Most often at most "
        "twice the minimum cost (all quantities and tolerances): "
        f"{leading[0]}; for errors of {percent(COARSE)} and more: {leading[1]}. A method is listed "
        f"if its count is at least the largest count divided by {page_tables.ALIKE:g}, here or on "
        "[a second machine](#a-second-machine). The method that fails least often: "
        f"`{leaders.safest}`.\n\n"
        f"Measured with {machine(entries, chart, conditions)}.{_age(conditions)}\n\n"
        f"{contents}\n\n{body}"
    )


def _age(conditions: Conditions) -> str:
    """Return a sentence if kernels or methods have changed since the measurement."""
    if conditions.kernels == digest_of_all():
        return ""
    return (
        f" **Kernels and methods have changed since {conditions.commit or 'this measurement'}: all "
        f"verdicts by time belong to the former time loops.**{'' if conditions.kernels else ERRORS}"
    )


ERRORS = (
    " Of 2907 errors computed again on 2026-11-30 (near-fault, steps of a sample and more), 13 had "
    "changed by more than 2 %."
)
"""Check of the errors of the measurement without a stored digest."""


def anchor(title: str) -> str:
    """Return the anchor that GitHub generates for a heading."""
    return "".join(c for c in title.lower().replace(" ", "-") if c.isalnum() or c == "-")


INTRODUCTION = """# Benchmark of methods

This page answers the question: how much processor time does each method need for a given error? Many buildings and
motions are integrated with many time steps. One command measures the points and writes the page, also on your machine.
It starts no problem after 20 minutes, and the next call continues:

```
$ python tests/benchmarks/run.py
```

`tdint chart --problems standard --peers --repeat 3 --tolerance 10%,3%,1%,0.3%,0.1%,0.01%` measures the same points, and
prints a row for each quantity, tolerance and method. OpenSeesPy is measured if it is installed (`pip install
'tdint[peers]'`).
"""  # noqa: E501

PROFILES = f"""\
For each problem, quantity and tolerance, the cost of a method is the time of the cheapest of {len(PARTS)} time steps, from
16 samples to a sixteenth of a sample, that meets the tolerance, as all shorter steps do. The lines show the share of
problems that a method solves at no more than a given multiple of the minimum cost of all methods (Dolan and More 2002).
Errors are the maximum over all stories.
"""  # noqa: E501

TABLES = """\
Each cell contains four numbers: the number of problems that a method solves at no more than twice the minimum cost; the
median of the cost divided by the minimum cost; the largest of these ratios; the number of problems that it does not
solve. The median refers to the problems that a method can be applied to. A problem is omitted if the errors of the second
solution exceed a fifth of the tolerance. Times that differ by less than a tenth count as equal. Lines `by tolerance` contain
the time of the complete command `tdint run --tolerance`, of the cheapest run with a small enough error, for whatever
tolerance it was asked (`python tests/benchmarks/run.py --tolerances`). All numbers are in [points.csv](points.csv) with one
row per run, [problems.csv](problems.csv) and [conditions.csv](conditions.csv); `python tests/benchmarks/run.py --page`
writes this page from these files.
"""  # noqa: E501

ADAPTIVE = """\
DOP853 and LSODA of SciPy (`solve_ivp`), restarted at branch changes that are located as events, with a compiled right-hand
side: `python tests/benchmarks/adaptive.py`. The last column is the time over the time of `impulse4` with the longest step
whose drift error is as small.
"""  # noqa: E501

FAILURES = """\
Number of cases (three quantities, each motion) in which no time step of a method has an error of at most 0.01 %; `-`: the
method cannot be applied to the building, for example `exact` to a nonlinear one.
"""  # noqa: E501

PROBLEMS = """\
The file of [the standard problems](../../src/tdint/assessment/chart/standard_problems.yaml) states why each is included.
"""  # noqa: E501

MATRIX = """
Twelve problems with known solutions, on which methods dissipate or generate energy, oscillate or diverge, are on
[the page of the methods](../../src/tdint/methods/README.md#where-methods-fail):

![Matrix of methods and problems: which methods conserve energy, decay and remain stable](../../configs/failures.png)
"""  # noqa: E501

OWN = """\
Your own method is a Python file ([how to write it](../../src/tdint/methods/README.md#adding-a-method)), your own problems are
a YAML file like that of the standard problems:

```
$ tdint chart --problems standard --plugin verlet.py --method verlet,impulse4,newmark-average --plot profile.png
$ tdint chart --problems mine.yaml -o mine.csv --plot
$ tdint chart office.yaml tower.yaml a.mseed b.mseed
```

The lines of plug-ins are thick and in front. To add a problem to this page, add an entry to the file of standard problems; to add a method, add its name to `METHODS`
of [profiles.py](../../src/tdint/assessment/chart/performance_profiles.py). Then run the command above.
"""  # noqa: E501


def main() -> int:
    """Measure the problems, store the results, and write the page and its figures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--minutes", type=float, default=MINUTES, help="start no problem after this time (20)"
    )
    parser.add_argument(
        "--processes", type=int, default=min(2, system.processors()), help="number of processes (2)"
    )
    parser.add_argument("--method", default=",".join(METHODS), help="methods, separated by commas")
    parser.add_argument("--no-peers", action="store_true", help="do not measure OpenSeesPy")
    parser.add_argument(
        "--page", action="store_true", help="write the page from the CSV files; measure nothing"
    )
    parser.add_argument(
        "--second-machine", action="store_true", help="store the results for the comparison"
    )
    parser.add_argument(
        "--tolerances", action="store_true", help="measure only the lines `by tolerance` again"
    )
    arguments = parser.parse_args()
    methods = arguments.method.split(",")
    peers = not arguments.no_peers
    directory = journal(methods, peers)
    standard = read_problems(STANDARD)
    files = [problem_file(directory, problem) for problem in standard]
    if not arguments.page:
        if arguments.tolerances:
            todo = [
                partial(measure_tolerance_lines, number, file, methods)
                for number, file in enumerate(files)
                if file.exists()
            ]
        else:
            todo = [
                partial(measure_standard_problem, number, file, methods, peers)
                for number, file in enumerate(files)
                if not file.exists()
            ]
        measure(todo, arguments.processes, arguments.minutes)
        entries = [Entry(*pickle.loads(file.read_bytes())) for file in files if file.exists()]
        if not entries:
            sys.exit("no problem was measured completely; run the command again")
        results = SECOND_MACHINE if arguments.second_machine else HERE
        raw_points.store(entries, conditions_of(entries), results)
    # The page is written only from the stored files.
    entries, conditions = raw_points.load()
    shown = pictures(complete_chart(entries, conditions))
    for name, _, figure in shown:
        write(HERE / name, figure)
    text = page(entries, len(standard), [(name, title) for name, title, _ in shown], conditions)
    PAGE.write_text(text, encoding="utf-8")
    print(f"{PAGE.name}: {len(entries)} of {len(standard)} problems")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (TdintError, RuntimeError) as error:
        sys.exit(f"{error}")
