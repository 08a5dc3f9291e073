"""Microseconds per step of the compiled march, by processor time: python tests/benchmarks/march.py
[guard]

Ten bilinear stories of configs/ten-story-bilinear.yaml with every method of the catalogue, beside a
plain loop (`newmark_loop.plain_loop`: average acceleration with Newton's method for bilinear
stories, peak drifts and nothing else) that is compiled and timed in the same run; then the cost of
each drift law, with its changes of branch located and without; then the cost over the number of
stories. All marches take turns, the fastest of the repeats counts.

`guard`: a law that knows its branch costs what the bilinear one does as long as stories stay on the
first one. Ten stories of each such law, too strong to yield, beside bilinear ones, with a method of
every family; exit code 1 where that is not so. TDINT_KERNELS=whole compiles less,
TDINT_GUARD_METHODS=newmark-average,... takes some methods.
"""

import os
import sys
from dataclasses import dataclass, fields, replace

import numpy as np
from common import ROOT
from newmark_loop import loop_arguments, plain_loop

from law_examples import example
from tdint import load_model, run, system
from tdint.analysis.chart.problem import stretched
from tdint.analysis.run.prepared import PreparedBuilding
from tdint.analysis.run.run import model_record
from tdint.analysis.time_steps import choose_steps
from tdint.errors import TdintError
from tdint.kernels import layout as rows
from tdint.methods.catalogue import catalogue, parse
from tdint.model.building import Building, assemble
from tdint.model.definition import LAWS

REPEATS = 15
ROUNDS = 8
"""Most rounds of so many repeats by the guard. A march takes some ms: other work moves the ratio of
few by a half, so that what fails is repeated."""
ALIKE = 1.2
"""What a law may cost over the bilinear one where neither yields: a look at the branch in place of
a closed form, and what clocks do not tell apart. A copy of all rows of a story made it 2 to 4."""
TOO_STRONG = (
    1e3  # times the yield forces of the model, whose stories yield up to 6 times their yield drift
)
MODEL = ROOT / "configs" / "ten-story-bilinear.yaml"


def timed_plain_loop(model, record):
    """Return the seconds per step of the plain loop."""
    ground = record.acceleration.copy()
    arguments = loop_arguments(assemble(model))
    peak = np.zeros(len(model.stories))
    begin = system.seconds()
    plain_loop(*arguments, ground, record.dt, peak)
    return (system.seconds() - begin) / (ground.size - 1)


def march_times(model, record, specifications):
    """Fastest seconds per step of the plain loop and of each method; None for a method that cannot
    do it."""
    times = {"plain loop": timed_plain_loop} | dict.fromkeys(specifications)
    fastest = dict.fromkeys(times, np.inf)
    for _ in range(REPEATS):
        for text, timer in times.items():
            try:
                if timer:
                    seconds = timer(model, record)
                else:
                    response = run(model, record, method=text)
                    seconds = response.solver_time / response.steps
            except TdintError:
                seconds = np.nan
            fastest[text] = min(fastest[text], seconds)
    return fastest


class Unbranched(Building):
    """A building that does not tell of the branches of its laws: impulse4 takes Newton's
    iteration."""

    piecewise_linear = kinked = False


@dataclass
class March:
    """The fastest march of a building with a method so far; nan seconds if it does not come to its
    end."""

    building: Building
    method: str
    seconds: float = np.inf  # per step
    events: int = 0
    solves: float = 0.0  # per step

    def repeat(self, record):
        """March once more."""
        integrator = parse(self.method)
        steps = choose_steps(None, None, record.dt, record.duration)
        marched = PreparedBuilding(self.building).integrate(
            integrator, steps, record.acceleration.copy()
        )
        self.seconds = (
            min(self.seconds, marched.seconds / steps.count) if marched.code == 0 else np.nan
        )
        self.events = int(marched.space.step_status[rows.BRANCH_CHANGES])
        self.solves = marched.space.totals[rows.ITERATIONS] / steps.count


def law_marches(model, record):
    """By law, ten stories of it that bend where those of the model yield: average acceleration,
    impulse4, and impulse4 that locates no changes of branch."""
    marches = {}
    for name in LAWS:
        building = assemble(with_law(model, name))
        unbranched = Unbranched(
            **{field.name: getattr(building, field.name) for field in fields(building)}
        )
        marches[name] = (
            March(building, "newmark-average"),
            March(building, "impulse4"),
            March(unbranched, "impulse4"),
        )
    for _ in range(REPEATS):
        for march in (march for group in marches.values() for march in group):
            march.repeat(record)
    return marches


def with_law(model, name, strength=1.0):
    """The building with all stories of one law, that many times as strong."""
    laws = (example(name, one.stiffness, strength * one.law.parameters[0]) for one in model.stories)
    stories = (replace(one, law=law) for one, law in zip(model.stories, laws, strict=True))
    return replace(model, stories=tuple(stories))


def guard(model, record):
    """Print what laws cost that keep to their first branch, over the bilinear one; returns whether
    all are alike."""
    names = [
        name
        for name, law in LAWS.items()
        if law.kinked and (own := law.functions()).keep and not own.accumulate_dissipation
    ]
    families = {}
    for text in catalogue():
        families.setdefault(parse(text).family.name, text)
    methods = os.environ.get("TDINT_GUARD_METHODS", "").split(",")
    methods = [text for text in methods if text] or [
        t for t in families.values() if not parse(t).family.linear_only
    ]
    buildings = {name: assemble(with_law(model, name, TOO_STRONG)) for name in ("bilinear", *names)}
    worst = 0.0
    print(f"{'over bilinear stories':22s}" + "".join(f"{name:>22s}" for name in names))
    for text in methods:
        marches = {name: March(building, text) for name, building in buildings.items()}
        for _ in range(ROUNDS):
            for march in REPEATS * [*marches.values()]:
                march.repeat(record)
            ratios = [marches[name].seconds / marches["bilinear"].seconds for name in names]
            if not any(ratio > ALIKE for ratio in ratios):
                break
        assert not any(march.events for march in marches.values())
        print(f"{text:22s}" + "".join(f"{ratio:22.2f}" for ratio in ratios), flush=True)
        worst = max(worst, *(ratio for ratio in ratios if np.isfinite(ratio)), 0.0)
    return worst <= ALIKE


def print_laws(model, record):
    """The table of laws."""
    print("ten stories of one law: us per step, solves per step, changes of branch")
    print(
        f"{'':15s} {'newmark-average':>18s} {'impulse4':>25s} {'without events':>18s} "
        f"{'with/without':>13s}"
    )
    for name, (average, events, newton) in law_marches(model, record).items():
        print(
            f"{name:15s} {average.seconds * 1e6:9.3f} ({average.solves:4.2f}) "
            f"{events.seconds * 1e6:10.3f} ({events.solves:4.2f}, {events.events:5d}) "
            f"{newton.seconds * 1e6:9.3f} ({newton.solves:4.2f}) "
            f"{events.seconds / newton.seconds:11.2f}"
        )


def main():
    """Print the tables."""
    model = load_model(MODEL)
    record = model_record(model)
    if sys.argv[1:] == ["guard"]:
        sys.exit(0 if guard(model, record) else 1)
    times = march_times(model, record, catalogue())
    for text, seconds in sorted(times.items(), key=lambda item: (np.isnan(item[1]), item[1])):
        if np.isfinite(seconds):
            ratio = seconds / times["plain loop"]
            print(f"{text:22s} {seconds * 1e6:7.3f} us per step   {ratio:5.2f} of the plain loop")
        else:
            print(f"{text:22s}       - does not integrate this building at the record's step")
    print()
    print_laws(model, record)
    print()
    for count in (1, 3, 10, 30, 100, 300, 1000):
        seconds = march_times(stretched(model, count), record, ["impulse4"])["impulse4"]
        ratio = seconds / times["impulse4"]
        print(
            f"impulse4 {count:5d} stories {seconds * 1e6:9.3f} us per step   {ratio:7.2f} of ten "
            "stories"
        )


if __name__ == "__main__":
    main()
