"""Write the benchmark page: python tests/benchmarks/run.py

The page is README.md beside this file, with its figures: the cost of each method for an error in
many problems. The results of all runs are stored in points.csv, problems.csv and conditions.csv.
All tables and figures are made from these files and from adaptive.csv.
`--page` writes the page from the files and measures nothing. Finished problems are kept
(TDINT_CACHE_DIR or the user's cache) until methods or problems change, so that a command that was
interrupted continues. `--tolerances` measures only the lines `by tolerance` again.
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

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # of the tests
sys.path.insert(0, str(Path(__file__).parent))  # of this folder
import page_tables
import raw_points
from page_tables import WORDS, percent, table
from raw_points import Conditions, Entry

import png_text
import tdint
from tdint import system
from tdint.analysis.chart import opensees_worker, profiles, work_precision
from tdint.analysis.chart import peers as peers_module
from tdint.analysis.chart.problem import FloorMotion, Reference, ending_together
from tdint.analysis.chart.profiles import (
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
from tdint.analysis.chart.work_precision import Chart, PerformanceProfile, Point, within
from tdint.errors import TdintError
from tdint.kernels.building.sources import digest_of_all
from tdint.methods.catalogue import chosen, parse
from tdint.output.figures.assessment import chart_picture
from tdint.output.figures.comparison import profile_picture
from tdint.output.figures.style import picture

HERE = Path(__file__).parent
PAGE = HERE / "README.md"
COMMAND = "python tests/benchmarks/run.py"
"""The command of the page, stored in its figures."""

CHARTS = (("linear", "near-fault"), ("bilinear", "near-fault"), ("bouc-wen", "near-fault"))
"""Problems whose points are drawn: methods of order 4 at home, kinks, smooth hysteresis."""

SAME = ("openseespy/newmark-average", "openseespy/hht")
"""Lines of OpenSees whose errors are compared with those of our method of the same name."""
MINUTES = 20.0
REPEATS = 3
"""Number of times that the lines by tolerance are timed."""


# ---- Measuring, a file for each finished problem


def journal(methods: Sequence[str], peers: bool) -> Path:
    """The folder of what is finished: another one for other methods, other loops, another way of
    measuring."""
    sources = [
        Path(module.__file__).read_text(encoding="utf-8")
        for module in (profiles, work_precision, peers_module, opensees_worker)
    ]
    program = (
        (version("openseespy") if find_spec("openseespy") else "missing") if peers else "without"
    )
    told = (*methods, program, digest_of_all(), *sources)
    digest = hashlib.sha256("\n".join(told).encode()).hexdigest()[:16]
    folder = system.cache_subfolder(f"benchmarks-{digest}")
    if folder is None:
        sys.exit("no cache folder can be written: set TDINT_CACHE_DIR to one that can")
    return folder


def place(folder: Path, problem: FieldProblem) -> Path:
    """The file of a problem: of its names and of what it is."""
    posed = problem.posed
    tables = (
        posed.building.linear_terms,
        posed.building.law_parameters,
        posed.building.modal,
        posed.ground,
    )
    digest = hashlib.sha256(b"".join(table.tobytes() for table in tables)).hexdigest()[:12]
    return folder / f"{problem.name}-{problem.motion}-{digest}.pickle"


def work(number: int, file: Path, methods: Sequence[str], peers: bool) -> str:
    """Measure one of the standard problems and keep it."""
    problem = read_problems(STANDARD)[number]
    # Loops of one kind for all methods, whatever the cache has: those for all laws are slower.
    problem.posed.prepared.compile(
        [parse(name) for name in dict.fromkeys([*methods, "impulse4", "moment4"])], own_loops=True
    )
    began = time.process_time()
    measured = measure_problem(problem, chosen(methods), tolerances=TOLERANCES, peers=peers)
    # The next command measures a problem again whose peers had no process on a busy machine.
    if peers_module.NO_PROCESS in measured.peer_note:
        return f"{problem.name}, {problem.motion}: not kept, openseespy: {measured.peer_note}"
    day = datetime.datetime.now(tz=datetime.UTC).date().isoformat()
    seconds = time.process_time() - began
    new = file.with_suffix(".new")
    new.write_bytes(pickle.dumps((measured, day, system.load(), seconds)))
    new.replace(file)
    return f"{problem.name}, {problem.motion}: {seconds:.0f} s of processor time"


def work_by_tolerance(number: int, file: Path, methods: Sequence[str]) -> str:
    """Measure the lines by tolerance of one of the standard problems again and keep them.

    The times are multiplied by the ratio of the former to the present time of a run that both
    measurements have, impulse4 at the sampling interval, because the machine may now be slower.
    """
    problem = read_problems(STANDARD)[number]
    measured, day, load, seconds = pickle.loads(file.read_bytes())
    problem.posed.prepared.compile([parse("impulse4"), parse("moment4")], own_loops=True)
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
    place_of_peers = next((i for i, p in enumerate(kept) if profiles.PEER in p.line), len(kept))
    new_points = (*kept[:place_of_peers], *lines, *kept[place_of_peers:])
    new = file.with_suffix(".new")
    new.write_bytes(pickle.dumps((replace(measured, points=new_points), day, load, seconds)))
    new.replace(file)
    return f"{problem.name}, {problem.motion}: by tolerance, times {ratio:.2f}"


def measure(todo: Sequence[Callable[[], str]], processes: int, minutes: float) -> None:
    """Measure all that is not finished; none is begun after so many minutes."""
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


def whole_chart(entries: Sequence[Entry], conditions: Conditions | None = None) -> FieldChart:
    """Return the chart of all problems, with the largest load during the measurement.

    The conditions are the stored conditions; without them the conditions are those of now.
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
    chart = whole_chart(entries)
    return Conditions(", ".join(versions), platform.system(), chart.timing, chart.peers)


def cell(profile: PerformanceProfile | None) -> str:
    """Solved within twice the least cost, median and worst ratio, not solved, and not run."""
    if profile is None:
        return ""
    failed = profile.problems - profile.solved
    median = f"{profile.median:.2f}" if math.isfinite(profile.median) else "-"
    worst = f"{profile.worst:.1f}" if profile.solved else "-"
    not_run = f" ({profile.not_run} not run)" if profile.not_run else ""
    return f"{profile.within(2.0)}/{median}/{worst}/{failed}{not_run}"


def tables_of_profiles(chart: FieldChart) -> str:
    """A table for each quantity: a row a method, a column a tolerance."""
    found = {(one.quantity, one.tolerance, one.method): one for one in chart.profiles}
    text = ""
    for quantity in PEAKS:
        judged = {
            tolerance: max(
                p.problems
                for p in chart.profiles
                if (p.quantity, p.tolerance) == (quantity, tolerance)
            )
            for tolerance in TOLERANCES
            if any((p.quantity, p.tolerance) == (quantity, tolerance) for p in chart.profiles)
        }
        heads = [
            "method",
            *(f"{percent(tolerance)} ({count})" for tolerance, count in judged.items()),
        ]
        rows = [
            [
                f"`{line}`{chart.named(line).removeprefix(line)}",
                *(cell(found.get((quantity, tolerance, line))) for tolerance in judged),
            ]
            for line in chart.lines
            if any((quantity, tolerance, line) in found for tolerance in judged)
        ]
        text += f"### {WORDS[quantity].capitalize()}\n\n{table(heads, rows)}\n"
    return text


def dearest(chart: FieldChart, line: str = "impulse4") -> str:
    """Where a method costs most over the least: of each error of some percent the two dearest
    problems, and what it and the cheapest method do there."""
    rows, costs, counts = [], [], []

    def done(point: Point, interval: float, quantity: str) -> list[str]:
        solves = point.iterations / point.steps
        return [
            f"{point.dt / interval:.3g}",
            f"{100.0 * point.error(quantity):.2g} %",
            f"{solves:.1f}",
            f"{1e6 * point.fastest / point.iterations:.2f}",
        ]

    for tolerance, quantity in product((0.1, COARSE), PEAKS):
        found = []
        for one in chart.measured:
            points = [point for point in one.points if profiles.of_steps(point.line)]
            best = {
                point.line: point
                for point in sorted(points, key=lambda point: -point.fastest)
                if point in within(points, point.line, quantity, tolerance)
            }
            if line in best and one.judges(quantity, tolerance):
                least = min(best.values(), key=lambda point: point.fastest)
                found.append((best[line].fastest / least.fastest, one, best[line], least))
        for ratio, one, ours, least in sorted(found, key=lambda entry: -entry[0])[:2]:
            rows.append(
                [
                    f"{WORDS[quantity]}, {percent(tolerance)}",
                    f"{one.name}, {one.motion}",
                    f"{ratio:.1f}",
                    *done(ours, one.interval, quantity),
                    f"`{least.line}`",
                    *done(least, one.interval, quantity),
                ]
            )
            costs.append(ours.fastest / ours.iterations / (least.fastest / least.iterations))
            counts.append(ours.iterations / ours.steps / (least.iterations / least.steps))
    each = ["samples a step", "error", "solves a step", "us a solve"]
    heads = ["error within", "problem", "cost over least", *each, "cheapest", *each]
    if not rows:
        return ""
    return (
        f"Where an error of some percent will do, `{line}` costs most over the least on these "
        "problems. It takes "
        "forces at two times of a step and solves for displacements and velocities together: here "
        "a solve takes "
        f"{min(costs):.1f} to {max(costs):.1f} times as long as one of the cheapest method. "
        "Within a step it goes from "
        "one turn or kink of a story's force to the next, but for those that matter less than "
        "what the step errs by; "
        "smooth hysteresis (bouc-wen, fluid-dampers) turns in each story: a step has "
        f"{min(counts):.1f} to {max(counts):.1f} times as many solves. That keeps small errors "
        "small and is wasted on "
        "large ones: "
        f"{PARTS[0]:g} samples, the longest step here, may err far less.\n\n"
        f"{table(heads, rows)}"
    )


def failures(chart: FieldChart) -> str:
    """A row for each method, a column for each building: what it does not solve at the smallest
    tolerance."""
    buildings = list(dict.fromkeys(one.name for one in chart.measured))
    rows = []
    for line in chart.lines:
        cells = []
        for name in buildings:
            tried = [
                one.costs(quantity, TOLERANCES[-1])
                for one in chart.measured
                for quantity in PEAKS
                if one.name == name and one.judges(quantity, TOLERANCES[-1])
            ]
            costs = [costs_of_all[line] for costs_of_all in tried if line in costs_of_all]
            failed = sum(cost != cost for cost in costs)  # nan
            cells.append("-" if not costs else f"**{failed}**" if failed else "0")
        rows.append([f"`{line}`", *cells])
    return table(["method", *buildings], rows)


def problems(chart: FieldChart) -> str:
    """What the problems are, and how well their references are known."""
    rows = []
    for one in chart.measured:
        ductility = f"{one.ductility:.1f}" if one.ductility == one.ductility else "-"
        gaps = "/".join(f"{one.gap.of(name):.0e}" for name in PEAKS)
        rows.append([one.name, one.motion, str(one.stories), ductility, str(one.changes), gaps])
    reasons = "\n".join(
        f"- **{one.name}**: {one.reason}." for one in {m.name: m for m in chart.measured}.values()
    )
    heads = [
        "building",
        "motion",
        "stories",
        "ductility",
        "changes of branch",
        "reference known to",
    ]
    return f"{reasons}\n\n{table(heads, rows)}"


def chart_of(one: Measured, whole: FieldChart) -> Chart:
    """The points of one problem as `tdint chart` has them."""
    usual = next(
        p for p in one.points if p.line == "newmark-average" and abs(p.dt - one.interval) < 1e-9
    )
    reference = Reference("impulse4", one.interval / 32, one.confirmed_by, one.gap, NO_MOTION)  # type: ignore[arg-type]
    return Chart(one.stories, one.interval, True, one.points, reference, usual, whole.timing)


NO_MOTION = FloorMotion(1, *4 * (None,))  # type: ignore[arg-type]


def pictures(chart: FieldChart) -> list[tuple[str, str, Callable[[], object]]]:
    """Return file, description and drawing function of all figures of the page."""
    shown: list[tuple[str, str, Callable[[], object]]] = []
    for quantity in PEAKS:
        figure = partial(profile_picture, chart, target=quantity.replace("_", "-"))
        file = f"profile-{quantity.replace('_', '-')}.png"
        shown.append((file, f"Performance profiles, errors of {WORDS[quantity]}", figure))
    for name, motion in CHARTS:
        one = next(
            (one for one in chart.measured if (one.name, one.motion) == (name, motion)), None
        )
        if one is not None:
            title = f"{name}, {motion}"
            figure = partial(chart_picture, chart_of(one, chart), name=title, target="peak-drift")
            text = f"Time over error of the peak drifts: {title}"
            shown.append((f"chart-{name}.png", text, figure))
    return shown


def write(file: Path, figure: Callable[[], object]) -> None:
    """A picture of few bytes: 64 colors do."""
    from PIL import Image  # comes with matplotlib

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


def apart_said(chart: FieldChart) -> str:
    """Return a table of the lines that are not among the profiles, and the reason."""
    text = ""
    for line in profiles.APART:
        having = [one for one in chart.measured if any(p.line == line for p in one.points)]
        rows = []
        for quantity in PEAKS:
            cells = []
            for tolerance in TOLERANCES:
                sure = [one for one in having if one.judges(quantity, tolerance)]
                solved = sum(math.isfinite(one.costs(quantity, tolerance)[line]) for one in sure)
                unknown = sum(one.is_unknown(line, quantity, tolerance) for one in sure)
                cells.append(f"{solved}/{len(sure) - solved - unknown}/{unknown}")
            rows.append([quantity.replace("_", " "), *cells])
        if having:
            heads = ["solved/not solved/not run", *map(percent, TOLERANCES)]
            text += (
                f"`{line}` is not among the profiles, because it is not the method of this name. "
                f"{peers_module.ITERATED}.\n\n{table(heads, rows)}"
            )
    return text


def peers_said(chart: FieldChart) -> str:
    """What of other programs is on this page."""
    if chart.peers:
        named = "; ".join(f"{peer.name} {peer.version}: {peer.settings}" for peer in chart.peers)
        given = [
            one
            for one in chart.measured
            if any(profiles.PEER in point.line for point in one.points)
        ]
        motions = list(dict.fromkeys(one.motion for one in chart.measured))
        gap = {(one.name, one.motion): one.peer_gap for one in chart.measured}
        left_out = {
            one.name: one.peer_note.removeprefix("omitted: ")
            for one in chart.measured
            if one not in given
        }
        rows = [
            [
                name,
                *(f"{gap.get((name, motion), math.nan):.1e}" for motion in motions),
                left_out.get(name, "-"),
            ]
            for name in dict.fromkeys(one.name for one in chart.measured)
        ]
        gaps = table(["from the reference", *motions, "why left out"], rows).replace("|nan", "|-")
        late = sum(
            int(count) for one in given for count in re.findall(r"(\d+) of \d+ runs", one.peer_note)
        )
        return (
            f"OpenSees runs on {len(given)} of {len(chart.measured)} problems: those whose laws it "
            "has, shown by its average acceleration, extrapolated to dt 0: its histories of drift "
            "and absolute acceleration (L2) are those of the reference but for a fifth of the "
            f"smallest tolerance, {profiles._SURE * TOLERANCES[-1]:.0e}. Medians are of these "
            "problems alone. Its accelerations are those of equilibrium at the end of each step, "
            "as ours. Its costs are over the least of ours; it is timed once, and begins no "
            f"run after {profiles._SHARE * opensees_worker.SECONDS:g} s of processor time of a "
            "problem with an integrator, largest steps first, for which "
            f"{late} with small steps are not run. Its BoucWen errs with order 1. {named}.\n\n"
            f"{gaps}\n{apart_said(chart)}"
        )
    try:
        version("openseespy")
        why = "was left out (--no-peers), or does none of these problems"
    except PackageNotFoundError:
        why = "is not installed on this machine"
    return (
        f"No other program ran for this page: OpenSeesPy {why}, and no number of it is carried "
        "over.\n"
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


def page(
    entries: Sequence[Entry],
    whole: int,
    pictures: Sequence[tuple[str, str]],
    conditions: Conditions,
) -> str:
    """Return the page.

    Parameters
    ----------
    entries : sequence of Entry
        Results of the problems.
    whole : int
        Number of problems of the set.
    pictures : sequence of tuple of str
        File and description of each figure.
    conditions : Conditions
        Conditions of the measurement.
    """
    chart = whole_chart(entries, conditions)
    leaders = chart.leaders()
    ours = sum(map(profiles.of_steps, chart.lines))
    missing = f" {whole - len(entries)} of {whole} problems were not reached in the time given." * (
        whole > len(entries)
    )
    images = [f"![{text}]({file})\n" for file, text in pictures]
    sections = {
        "Performance profiles": PROFILES + "\n" + "\n".join(images[: len(PEAKS)]),
        "Tables": TABLES
        + "\n"
        + tables_of_profiles(chart)
        + f"### Where `impulse4` costs most\n\n{dearest(chart)}",
        "Cost of a tolerance": page_tables.cost_of_tolerances(chart),
        "Which method is cheapest": page_tables.cheapest_said(chart),
        "Time over error on three of them": "\n".join(images[len(PEAKS) :]),
        "Where methods fail": FAILURES + "\n" + failures(chart) + MATRIX,
        "Other programs": peers_said(chart) + page_tables.same_method_said(chart, SAME),
        "Adaptive solvers": adaptive_table(),
        "A plain loop and the cost of a call": page_tables.plain_loop_said(),
        "Loops for all laws": page_tables.loops_said(),
        "The problems": problems(chart),
        "A method or a problem of your own": OWN,
    }
    contents = "\n".join(f"- [{title}](#{anchor(title)})" for title in sections)
    body = "\n".join(f"## {title}\n\n{text.rstrip()}\n" for title, text in sections.items())
    return (
        f"{INTRODUCTION}\n{len(entries)} problems, {ours} methods.{missing} Best overall (most "
        "within "
        f"twice the least cost, all quantities and tolerances): `{leaders.overall}`; for errors "
        f"of {percent(COARSE)} "
        f"and more: `{leaders.coarse}`; safest (fails least): `{leaders.safest}`.\n\n"
        f"Measured with {machine(entries, chart, conditions)}; all methods in loops that are "
        "compiled for the laws of the building.\n\n"
        f"{contents}\n\n{body}"
    )


def anchor(title: str) -> str:
    """As GitHub makes it."""
    return "".join(c for c in title.lower().replace(" ", "-") if c.isalnum() or c == "-")


INTRODUCTION = """# Benchmark of methods

This page answers the question: how much processor time does each method need for a given error? Many buildings and
motions are integrated with many time steps. One command measures all points and writes the page, also on your machine.
If it is interrupted, the next call continues:

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
solve. The median refers to the problems that a method can be applied to; their number follows the name of the method if
it is not the number of all problems. The number of problems in parentheses at the top is smaller if a problem is
omitted: there, the errors of the second solution exceed a fifth of the tolerance. Times that differ by less than a tenth
count as equal. Lines `by tolerance` contain the time of the complete command `tdint run --tolerance`: the choice of the
time step and the error estimate. `python tests/benchmarks/run.py --tolerances` measures these lines separately and scales
their times by a run that both measurements contain. Their cell takes the cheapest run with a small enough error, for
whatever tolerance it was asked; see [Cost of a tolerance](#cost-of-a-tolerance) for the runs that were asked for each
tolerance. All numbers are in [points.csv](points.csv) with one row per run, [problems.csv](problems.csv) and
[conditions.csv](conditions.csv); `python tests/benchmarks/run.py --page` writes this page from these files.
"""  # noqa: E501

ADAPTIVE = """\
DOP853 and LSODA of SciPy (`solve_ivp`) with branch changes located as events, at which the solver is restarted, and a
compiled right-hand side: `python tests/benchmarks/adaptive.py`. The time includes the evaluation of peaks from the dense
output. The last column is this time over the time of `impulse4` with the longest step whose drift error is as small.
Bouc-Wen stories change their branch at each reversal and each zero of the hysteretic force. Drift rates of upper stories
are exactly zero at first, so branch changes of stories at rest are not located.
"""  # noqa: E501

FAILURES = """\
Number of cases (three quantities, each motion) in which no time step of a method has an error of at most 0.01 %; `-`: the
method cannot be applied to the building, for example `exact` to a nonlinear one.
"""  # noqa: E501

MATRIX = """
Twelve problems with known answers, on which methods lose or make energy, ring or blow up, are in
[the methods' README](../../src/tdint/methods/README.md#where-methods-fail):

![Matrix of methods and problems: who keeps energy, settles, stays stable](../../configs/failures.png)
"""  # noqa: E501

OWN = """\
Your own method is a Python file ([how to write it](../../src/tdint/methods/README.md#adding-a-method)), your own problems are
a YAML file like [the standard problems](../../src/tdint/analysis/chart/standard_problems.yaml):

```
$ tdint chart --problems standard --plugin verlet.py --method verlet,impulse4,newmark-average --plot profile.png
$ tdint chart --problems mine.yaml -o mine.csv --plot
$ tdint chart office.yaml tower.yaml a.mseed b.mseed
```

The lines of plug-ins are thick and in front; `--highlight NAME` highlights another line instead.
To add a problem to this page, add an entry to the file of standard problems; to add a method, add its name to `METHODS`
of [profiles.py](../../src/tdint/analysis/chart/profiles.py). Then run the command above.
"""  # noqa: E501


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--minutes", type=float, default=MINUTES, help="no problem is begun after so many (20)"
    )
    parser.add_argument(
        "--processes", type=int, default=min(2, system.processors()), help="at a time (2)"
    )
    parser.add_argument("--method", default=",".join(METHODS), help="methods, with commas")
    parser.add_argument(
        "--no-peers", action="store_true", help="without OpenSeesPy, which runs if it is installed"
    )
    parser.add_argument(
        "--page", action="store_true", help="measure nothing: write the page from the CSV files"
    )
    parser.add_argument(
        "--tolerances", action="store_true", help="measure only the lines by tolerance again"
    )
    asked = parser.parse_args()
    methods = asked.method.split(",")
    folder = journal(methods, not asked.no_peers)
    given = read_problems(STANDARD)
    files = {place(folder, problem): problem for problem in given}
    if not asked.page:
        todo = [
            partial(work, number, file, methods, not asked.no_peers)
            for number, (file, problem) in enumerate(files.items())
            if not file.exists()
        ]
        if asked.tolerances:
            todo = [
                partial(work_by_tolerance, number, file, methods)
                for number, file in enumerate(files)
                if file.exists()
            ]
        measure(todo, asked.processes, asked.minutes)
        entries = [Entry(*pickle.loads(file.read_bytes())) for file in files if file.exists()]
        if not entries:
            sys.exit("no problem is finished yet")
        raw_points.store(entries, conditions_of(entries))
    # The page is made from the stored files alone.
    entries, conditions = raw_points.load()
    shown = pictures(whole_chart(entries, conditions))
    for name, _, figure in shown:
        write(HERE / name, figure)
    text = page(entries, len(given), [one[:2] for one in shown], conditions)
    PAGE.write_text(text, encoding="utf-8")
    print(f"{PAGE.name}: {len(entries)} of {len(given)} problems")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (TdintError, RuntimeError) as error:
        sys.exit(f"{error}")
