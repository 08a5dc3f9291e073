"""Measure the processor time per step of the compiled time loops.

    python tests/benchmarks/march.py           three tables of times in microseconds per step
    python tests/benchmarks/march.py guard     compare hysteretic laws before yielding

The first table contains the building configs/ten-story-bilinear.yaml with every method of the
catalogue. The times are compared with a plain loop (`newmark_loop.plain_loop`: average acceleration
with Newton's method for bilinear stories, which computes only peak drifts) that is compiled and
measured in the same run. The second table contains ten stories of each hysteretic law, with and
without locating branch changes. The third table contains `impulse4` with 1 to 1000 stories. All
runs are repeated alternately, and each time is the minimum of the repeats.

`guard` measures the laws that store their branch. As long as a story remains on its first branch,
it must take at most `MAX_RATIO` times as long as a bilinear story. Ten stories that are too strong
to yield are compared with ten bilinear stories, for one method of every family. The exit code is 1
if a ratio is larger. The environment variable TDINT_GUARD_METHODS=newmark-average,... selects the
methods.
"""

import os
import sys
from dataclasses import dataclass, fields, replace

import numpy as np
from common import ROOT
from newmark_loop import loop_arguments, plain_loop

from law_examples import example
from tdint import load_model, run, system
from tdint.assessment.chart.problem import stretched
from tdint.errors import TdintError
from tdint.kernels import layout as rows
from tdint.methods.catalogue import catalogue, parse
from tdint.model.building import Building, assemble
from tdint.model.story_laws import LAWS
from tdint.response.runs.prepared import PreparedBuilding
from tdint.response.runs.run import model_record
from tdint.response.time_steps import choose_steps

REPEATS = 15
"""Number of measurements of each run; the minimum counts."""
MAX_ROUNDS = 8
"""Maximum number of rounds of `REPEATS` measurements in `guard`. A run takes a few milliseconds, so
other work on the machine can change the ratio of a few measurements by 50 %. A round in which a
ratio is too large is therefore repeated."""
MAX_RATIO = 1.2
"""Maximum time of a law divided by the time of the bilinear law, if no story yields. A law with
stored branches reads its branch instead of evaluating a closed form; the margin also covers the
scatter of the clock. When all rows of a story were copied in each step, the ratio was 2 to 4."""
TOO_STRONG = 1e3
"""Factor on the yield forces of the model so that no story yields. With the original forces, the
stories reach up to 6 times their yield drift."""
MODEL = ROOT / "configs" / "ten-story-bilinear.yaml"
PLAIN_LOOP = "plain loop"
"""Key of the plain loop in the results of `fastest_times`."""


def time_plain_loop(model, record):
    """Return the processor time per step of one run of the plain loop, s."""
    ground = record.acceleration.copy()
    arguments = loop_arguments(assemble(model))
    peak = np.zeros(len(model.stories))
    start = system.seconds()
    plain_loop(*arguments, ground, record.dt, peak)
    return (system.seconds() - start) / (ground.size - 1)


def fastest_times(model, record, methods):
    """Return the minimum time per step of the plain loop and of each method, s.

    The result is a dictionary by method name, with the additional key `PLAIN_LOOP`. The time is
    infinite if a method cannot integrate the building.
    """
    fastest = dict.fromkeys([PLAIN_LOOP, *methods], np.inf)
    for _ in range(REPEATS):
        for name in fastest:
            try:
                if name == PLAIN_LOOP:
                    seconds = time_plain_loop(model, record)
                else:
                    response = run(model, record, method=name)
                    seconds = response.solver_time / response.steps
            except TdintError:
                continue
            fastest[name] = min(fastest[name], seconds)
    return fastest


class WithoutBranches(Building):
    """A building whose laws declare neither branches nor linear segments. `impulse4` therefore uses
    Newton's iteration instead of locating branch changes."""

    piecewise_linear = kinked = False


@dataclass
class TimedRun:
    """A run that is measured repeatedly.

    Attributes
    ----------
    building : Building
        Building without initial displacements or forces.
    method : str
        Name of the method.
    seconds : float
        Minimum processor time per step so far, s; nan if the last time integration failed.
    branch_changes : int
        Number of branch changes that the method located in the last repetition.
    solves : float
        Number of solved systems of equations per step in the last repetition.
    """

    building: Building
    method: str
    seconds: float = np.inf
    branch_changes: int = 0
    solves: float = 0.0

    def repeat(self, record):
        """Integrate once at the sampling interval of the record, and update the attributes."""
        integrator = parse(self.method)
        steps = choose_steps(None, None, record.dt, record.duration)
        result = PreparedBuilding(self.building).integrate(
            integrator, steps, record.acceleration.copy()
        )
        self.seconds = (
            min(self.seconds, result.seconds / steps.count) if result.code == 0 else np.nan
        )
        self.branch_changes = int(result.space.step_status[rows.BRANCH_CHANGES])
        self.solves = result.space.totals[rows.ITERATIONS] / steps.count


def time_laws(model, record):
    """Measure ten stories of each law that yield at the same force and drift as the model.

    Returns
    -------
    dict of str to tuple of TimedRun
        For each law: `newmark-average`, `impulse4`, and `impulse4` without locating branch changes.
    """
    runs = {}
    for name in LAWS:
        building = assemble(with_law(model, name))
        without_branches = WithoutBranches(
            **{field.name: getattr(building, field.name) for field in fields(building)}
        )
        runs[name] = (
            TimedRun(building, "newmark-average"),
            TimedRun(building, "impulse4"),
            TimedRun(without_branches, "impulse4"),
        )
    for _ in range(REPEATS):
        for runs_of_law in runs.values():
            for timed_run in runs_of_law:
                timed_run.repeat(record)
    return runs


def with_law(model, name, strength=1.0):
    """Return a model in which all stories have the law `name`.

    The first parameter of the law of each story of `model` must be its yield force. The stories of
    the new model have the same initial stiffness and yield at this force times `strength`.
    """
    stories = [
        replace(story, law=example(name, story.stiffness, strength * story.law.parameters[0]))
        for story in model.stories
    ]
    return replace(model, stories=tuple(stories))


def guard(model, record):
    """Print the times of laws on their first branch, divided by the time of the bilinear law.

    Returns True if all ratios are at most `MAX_RATIO`. Methods that cannot integrate the building
    have the ratio nan and are ignored.
    """
    # The laws that store their branch. Laws with `accumulate_dissipation` (bouc-wen) are omitted,
    # because they do not use `branch_following.branch_first`, whose cost is tested here.
    names = []
    for name, law in LAWS.items():
        functions = law.functions() if law.kinked else None
        if functions and functions.keep and not functions.accumulate_dissipation:
            names.append(name)
    # The first method of each family of the catalogue.
    families = {}
    for text in catalogue():
        families.setdefault(parse(text).family.name, text)
    selection = os.environ.get("TDINT_GUARD_METHODS", "").split(",")
    methods = [text for text in selection if text] or [
        text for text in families.values() if not parse(text).family.linear_only
    ]
    buildings = {name: assemble(with_law(model, name, TOO_STRONG)) for name in ("bilinear", *names)}
    worst = 0.0
    print(f"{'over bilinear stories':22s}" + "".join(f"{name:>22s}" for name in names))
    for text in methods:
        runs = {name: TimedRun(building, text) for name, building in buildings.items()}
        for _ in range(MAX_ROUNDS):
            for timed_run in REPEATS * [*runs.values()]:
                timed_run.repeat(record)
            ratios = [runs[name].seconds / runs["bilinear"].seconds for name in names]
            if not any(ratio > MAX_RATIO for ratio in ratios):
                break
        assert not any(timed_run.branch_changes for timed_run in runs.values())
        print(f"{text:22s}" + "".join(f"{ratio:22.2f}" for ratio in ratios), flush=True)
        worst = max(worst, *(ratio for ratio in ratios if np.isfinite(ratio)), 0.0)
    return worst <= MAX_RATIO


def print_laws(model, record):
    """Print the times of all laws; solves per step and branch changes are in parentheses."""
    print("ten stories of one law: us per step (solves per step, located branch changes)")
    print(
        f"{'':15s} {'newmark-average':>18s} {'impulse4':>25s} {'without events':>18s} "
        f"{'with/without':>13s}"
    )
    for name, (average, located, newton) in time_laws(model, record).items():
        print(
            f"{name:15s} {average.seconds * 1e6:9.3f} ({average.solves:4.2f}) "
            f"{located.seconds * 1e6:10.3f} ({located.solves:4.2f}, {located.branch_changes:5d}) "
            f"{newton.seconds * 1e6:9.3f} ({newton.solves:4.2f}) "
            f"{located.seconds / newton.seconds:11.2f}"
        )


def main():
    """Print the three tables; with the argument `guard`, only the comparison of laws."""
    model = load_model(MODEL)
    record = model_record(model)
    if sys.argv[1:] == ["guard"]:
        sys.exit(0 if guard(model, record) else 1)
    times = fastest_times(model, record, catalogue())
    for name, seconds in sorted(times.items(), key=lambda item: item[1]):
        if np.isfinite(seconds):
            ratio = seconds / times[PLAIN_LOOP]
            print(
                f"{name:22s} {seconds * 1e6:7.3f} us per step   {ratio:5.2f} times the plain loop"
            )
        else:
            print(f"{name:22s}       - cannot integrate this building with the sampling interval")
    print()
    print_laws(model, record)
    print()
    for count in (1, 3, 10, 30, 100, 300, 1000):
        seconds = fastest_times(stretched(model, count), record, ["impulse4"])["impulse4"]
        ratio = seconds / times["impulse4"]
        print(
            f"impulse4 {count:5d} stories {seconds * 1e6:9.3f} us per step   {ratio:7.2f} times "
            "ten stories"
        )


if __name__ == "__main__":
    main()
