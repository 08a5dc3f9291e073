"""Update rows of points.csv after a change of the code of some methods.

    python tests/benchmarks/update_times.py FORMER METHODS PROBLEMS [ROUNDS]

FORMER is a checkout of the former version. METHODS and PROBLEMS are names separated by commas, for
example `gauss4 tanh,stiffening`. Both versions run alternately, each in its own process, with loops
for the laws of the building. Times are multiplied by the ratio of the present to the former minimum
processor time of the same run. The machine may therefore be busier than in the measurement of the
page. Iterations and errors are measured with the present version; the reference solution is
computed with the former version. `python tests/benchmarks/run.py --page` then writes the page.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import astuple
from functools import partial
from pathlib import Path
from statistics import median
from types import SimpleNamespace

import numpy as np
import raw_points
from common import ROOT

from tdint.assessment.chart.performance_profiles import (
    PARTS,
    PEAKS,
    STANDARD,
    TOLERANCES,
    PeakErrors,
    _peak_errors,
    read_problems,
)
from tdint.assessment.chart.problem import ending_together
from tdint.assessment.chart.work_precision import CHOOSING, DONE, by_tolerance
from tdint.methods.catalogue import parse
from tdint.response.runs.error_estimate import attempt

ROUNDS = 3
REPEATS = 3  # runs of each point in a process
FINE = 32  # steps of the reference per sampling interval

Results = dict[str, tuple[float, int | None, list[float]]]
"""Minimum time (s), iterations and errors by problem, motion, method and number of steps."""


def measure(methods: Sequence[str], names: Sequence[str], folder: Path) -> Results:
    """Return the results of all runs with the imported version.

    Parameters
    ----------
    methods, names : sequence of str
        Names of the methods and of the problems.
    folder : Path
        Directory with the peaks of the references. Missing references are computed and stored.
    """
    results: Results = {}
    for problem in read_problems(STANDARD):
        if problem.name not in names:
            continue
        posed = ending_together(problem.posed, [problem.posed.interval * part for part in PARTS])
        file = folder / f"{problem.name}-{problem.motion}.json"
        integrators = [parse(name) for name in methods]
        needs_impulse4 = not file.exists() or not set(CHOOSING).isdisjoint(methods)
        needed = [*integrators, *([parse("impulse4")] if needs_impulse4 else [])]
        posed.prepared.compile(needed)
        if not file.exists():
            reference = posed.case(parse("impulse4")).integrate(posed.steps(posed.interval / FINE))
            peaks = {name: getattr(reference.stories, name).tolist() for name in PEAKS}
            file.write_text(json.dumps(peaks), encoding="utf-8")
        peaks = json.loads(file.read_text(encoding="utf-8"))
        true_peaks = SimpleNamespace(**{name: np.array(value) for name, value in peaks.items()})
        for integrator in integrators:
            key = f"{problem.name}|{problem.motion}|{integrator.label}"
            for part in PARTS:
                steps = posed.steps(posed.interval * part)
                runs = [attempt(posed.case(integrator), steps) for _ in range(REPEATS)]
                if runs[0].status == DONE:
                    errors = PeakErrors.between(runs[0].stories, true_peaks)
                    seconds = min(run.solver_time for run in runs)
                    results[f"{key}|{steps.count}"] = (
                        seconds,
                        int(runs[0].iterations),
                        list(astuple(errors)),
                    )
            if integrator.label in CHOOSING:
                judge = partial(_peak_errors, true_peaks)
                for point in by_tolerance(posed, integrator, TOLERANCES, judge, REPEATS):
                    key = f"{problem.name}|{problem.motion}|{point.method}|"
                    if point.errors:
                        results[key] = point.fastest, None, list(astuple(point.errors))
    return results


def measure_alternately(former: Path, arguments: Sequence[str], rounds: int) -> list[Results]:
    """Return the results of the former and of the present version, with the minimum times.

    Parameters
    ----------
    former : Path
        Checkout of the former version.
    arguments : sequence of str
        Methods and problems, each separated by commas.
    rounds : int
        Number of processes of each version.
    """
    results_by_version: list[Results] = [{}, {}]  # former, present
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(rounds):
            for results, root in zip(results_by_version, (former, ROOT), strict=True):
                path = os.pathsep.join([str(root / "src"), str(root / "cli")])
                output = subprocess.run(
                    [sys.executable, __file__, "--worker", folder, *arguments],
                    env={**os.environ, "PYTHONPATH": path},
                    stdout=subprocess.PIPE,
                    check=True,
                ).stdout
                for key, (seconds, *others) in json.loads(output).items():
                    former_minimum = results[key][0] if key in results else math.inf
                    results[key] = (min(seconds, former_minimum), *others)
    return results_by_version


def main(arguments: Sequence[str]) -> None:
    """Measure both versions and replace the rows; print the ratios of the times."""
    former, methods, names, *rounds = arguments
    before, after = measure_alternately(
        Path(former).resolve(), [methods, names], int(rounds[0]) if rounds else ROUNDS
    )
    rows = raw_points.read(raw_points.POINTS)
    ratios: dict[str, list[float]] = {}
    for row in rows:
        key = "|".join(row[name] for name in ("problem", "motion", "method", "steps"))
        if key in before and key in after and row["status"] == DONE:
            seconds, iterations, errors = after[key]
            ratio = seconds / before[key][0]
            ratios.setdefault(f"{row['problem']}, {row['line']}", []).append(ratio)
            row["time_min_s"] = raw_points.number(ratio * float(row["time_min_s"]))
            row["iterations"] = "" if iterations is None else str(iterations)
            for name, error in zip(PEAKS, errors, strict=True):
                row[f"{name}_error"] = raw_points.number(error)
    raw_points.write(raw_points.POINTS, raw_points.POINT_COLUMNS, [[*row.values()] for row in rows])
    for line, values in ratios.items():
        print(
            f"{line}: {len(values)} rows, present over former time "
            f"{min(values):.2f} to {max(values):.2f}, median {median(values):.2f}"
        )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--worker"]:
        folder, methods, names = sys.argv[2:]
        print(json.dumps(measure(methods.split(","), names.split(","), Path(folder))))
    else:
        main(sys.argv[1:])
