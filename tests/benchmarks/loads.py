"""Accuracy and cost of the methods under wind and a blast: python tests/benchmarks/loads.py

The buildings are the example models wind-tower and blast-frame, which have forces on floors and no
ground motion. The results are stored in loads.csv, from which `run.py --page` writes a section of
the page. They are not part of the performance profiles. `--table` writes wind-tower.csv instead,
and `--cost` prints the time of fifty loaded floors, divided by that under a ground motion.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from tdint.assessment.chart.performance_profiles import (
    METHODS,
    PEAKS,
    Measured,
    crossed,
    measure_problem,
)
from tdint.assessment.chart.problem import pose
from tdint.ground_motion.record import Record
from tdint.methods.catalogue import chosen, parse
from tdint.response.arguments import model_of

HERE = Path(__file__).parent
CONFIGS = HERE.parents[1] / "configs"
RESULTS = HERE / "loads.csv"
MODELS = ("wind-tower", "blast-frame")
QUANTITIES = (PEAKS[0], PEAKS[1])
"""Peaks of the table of the page: drift and absolute acceleration."""
TOLERANCES = (0.03, 0.003, 0.0001)
COLUMNS = (
    "problem", "quantity", "tolerance", "method", "dt_s", "error", "time_s", "interval_s", "gap",
)  # fmt: skip

DRAG = 0.5 * 1.25 * 1.3 * 105.0 / 1000.0
"""Force on a floor per square of the wind speed, kN s^2/m^2."""
SPEEDS = {"low": 29.0, "middle": 36.0, "high": 40.0}
"""Mean wind speed of a third of the height, m/s."""
TURBULENCE, LENGTH, COMMON = 5.0, 100.0, 0.6
"""Standard deviation of the speed (m/s), integral length (m), share of the common variance."""
DURATION, INTERVAL, RAMP = 120.0, 0.25, 10.0
"""Duration of the table, its interval, and the time in which the wind rises and falls, s."""


def wind() -> np.ndarray:
    """Return the times (s) and the forces on a floor of each third of the height (kN), by column.

    The turbulence is a sum of cosines with random phases, whose amplitudes follow from the spectrum
    4 s^2 (L/U) / (1 + 6 f L/U)^(5/3) of Kaimal.
    """
    times = np.arange(0.0, DURATION + 0.5 * INTERVAL, INTERVAL)
    frequencies = np.arange(1.0, 2.0 * DURATION) / DURATION  # to the Nyquist frequency, 2 Hz
    random = np.random.default_rng(20)
    phases = 2.0 * np.pi * random.random((1 + len(SPEEDS), len(frequencies)))
    shape = np.minimum(1.0, np.minimum(times, DURATION - times) / RAMP)
    columns = [times]
    for own, speed in enumerate(SPEEDS.values(), start=1):
        scale = LENGTH / speed
        density = 4.0 * TURBULENCE**2 * scale / (1.0 + 6.0 * frequencies * scale) ** (5.0 / 3.0)
        amplitudes = np.sqrt(2.0 * density / DURATION)
        u = sum(
            np.sqrt(share) * np.cos(np.outer(times, 2.0 * np.pi * frequencies) + phase) @ amplitudes
            for share, phase in ((COMMON, phases[0]), (1.0 - COMMON, phases[own]))
        )
        columns.append(DRAG * shape * (speed + u) ** 2)
    return np.column_stack(columns)


def write_wind(file: Path) -> None:
    """Write the forces of the wind as a table with a column for each third of the height."""
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["time_s", *(f"{name}_kN" for name in SPEEDS)])
        writer.writerows([f"{row[0]:g}", *(f"{force:.2f}" for force in row[1:])] for row in wind())


def cheapest(name: str, measured: Measured) -> list[list[str]]:
    """Return the rows of loads.csv: the cheapest time step of each method for each tolerance.

    Times have the clock of the thread.
    """
    rows = []
    for quantity in QUANTITIES:
        for tolerance in TOLERANCES:
            costs = measured.costs(quantity, tolerance)
            for line, cost in costs.items():
                point = next(
                    (p for p in measured.points if p.line == line and p.fastest == cost), None
                )
                numbers = (
                    [f"{point.dt:.4g}", f"{point.error(quantity):.2g}", f"{cost:.4g}"]
                    if point
                    else ["", "", ""]
                )
                rows.append(
                    [
                        name,
                        quantity,
                        f"{tolerance:g}",
                        line,
                        *numbers,
                        f"{measured.interval:.4g}",
                        f"{measured.gap.of(quantity):.1g}",
                    ]
                )
    return rows


def cost(
    methods: Sequence[str], duration: float = 600.0, dt: float = 0.01, repeats: int = 9
) -> None:
    """Print the time of fifty linear floors under different forces, divided by the time of the same
    building under a ground motion; both have points at the time steps and are run alternately.

    Parameters
    ----------
    methods : sequence of str
        Names of the methods.
    duration, dt : float
        Duration of the runs and interval of the points, s.
    repeats : int
        Number of pairs of runs; the minimum times are compared.
    """
    random = np.random.default_rng(1)
    times = np.arange(0.0, duration + 0.5 * dt, dt)
    story = {"repeat": 50, "mass": 2e5, "height": 3.5, "stiffness": 3.5e8}
    rayleigh = {"rayleigh": {"ratio": 0.05, "modes": [1, 3]}}
    model = {"stories": [story], "damping": rayleigh, "analysis": {"dt": dt}}
    with TemporaryDirectory() as directory:
        file = Path(directory) / "wind.csv"
        forces = 1e4 + 30.0 * np.cumsum(random.normal(size=(len(times), 50)), axis=0)
        header = ",".join(["time_s", *(f"floor_{floor}_N" for floor in range(1, 51))])
        data = np.column_stack([times, forces])
        np.savetxt(file, data, fmt="%.7g", delimiter=",", header=header, comments="")
        floors = {floor: f"floor_{floor}_N" for floor in range(1, 51)}
        loaded = {**model, "excitation": {"forces": [{"file": str(file), "floors": floors}]}}
        motion = Record(0.5 * random.normal(size=len(times)), dt, "", "", "", "noise")
        problems = (
            pose(model_of(loaded), duration=duration),
            pose(model_of(model), motion, duration=duration),
        )
    for method in methods:
        cases = [(problem.case(parse(method)), problem.steps(dt)) for problem in problems]
        pairs = [
            [case.integrate(steps).solver_time for case, steps in cases] for _ in range(repeats)
        ]
        wind_time, ground_time = np.min(pairs, axis=0)
        print(f"{method}: {wind_time / ground_time:.2f}", flush=True)


def main() -> None:
    """Measure both problems, or write the table of the wind."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", action="store_true", help="write wind-tower.csv")
    parser.add_argument("--cost", action="store_true", help="print the cost of fifty forces")
    arguments = parser.parse_args()
    if arguments.table:
        write_wind(CONFIGS / "wind-tower.csv")
        return
    if arguments.cost:
        cost(("impulse4", "newmark-average", "moment4", "gauss4"))
        return
    rows = []
    for name in MODELS:
        (problem,) = crossed([CONFIGS / f"{name}.yaml"], ())
        measured = measure_problem(problem, chosen(METHODS))
        rows += cheapest(name, measured)
        print(f"{name}: reference confirmed by {measured.confirmed_by}, {measured.gap}")
    with RESULTS.open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream, lineterminator="\n").writerows([COLUMNS, *rows])


if __name__ == "__main__":
    main()
