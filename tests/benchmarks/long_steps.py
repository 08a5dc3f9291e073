"""Measure the errors and the time of time steps that are longer than the sampling interval.

    python tests/benchmarks/long_steps.py [TABLE]...

Tables (default: all):

motion     L2 error and maximum error of a peak drift with 1, 2, 4 and 8 samples per step, for all
           methods
peaks      errors of peak accelerations, shears, velocities and drifts of 20 random bilinear
           buildings
speed      processor time with long steps divided by the time with the sampling interval
tolerance  campaigns that choose their time step for a tolerance: runs that exceed the tolerance
"""

import sys
import time
from dataclasses import replace
from functools import partial

import numpy as np
from common import ROOT, components, l2_error, max_relative_error, minimum_times
from moment4 import print_errors, reference

from building_cases import FIVE_PERCENT, Law, model, story
from tdint import load_model, run
from tdint.methods.catalogue import catalogue, parse
from tdint.response.arguments import model_record
from tdint.response.pairs import Run
from tdint.response.runs.batch import Subject
from tdint.response.runs.outcome import STORY_QUANTITIES
from tdint.response.runs.prepared import PreparedBuilding
from tdint.response.time_steps import choose_steps
from tdint.studies.campaign.chunks import Batch, CampaignSettings, building_step

MODELS = {
    name: load_model(ROOT / "configs" / f"{name}.yaml")
    for name in ("ten-story", "ten-story-bilinear")
}
SAMPLES = (1, 2, 4, 8)
REPEATS = 25
PEAK_DRIFT = [quantity.name for quantity in STORY_QUANTITIES].index("peak_drift")
"""Column of the peak drift in the results of a campaign."""
PEAKS = ("peak_absolute_acceleration", "peak_shear", "peak_velocity", "peak_drift")


def motion():
    """Print the errors of all methods for the two ten-story buildings."""
    for name, building in MODELS.items():
        exact, second = (reference(building, method, 64) for method in ("impulse4", "gauss4"))
        difference = l2_error(second[0], exact[0])
        print(
            f"{name}: L2 error / maximum error of a peak drift; gauss4 with dt/64 differs from the "
            f"reference by {difference:.0e}"
        )
        methods = [
            text
            for text, method in catalogue().items()
            if name == "ten-story" or not method.family.linear_only
        ]
        print_errors(building, methods, exact, SAMPLES)
        print()


def random_bilinear(rng):
    """Return a random building with three to twelve bilinear stories and 5 % damping.

    The base yields at 0.08 to 0.25 of the weight. `rng` is a generator of NumPy.
    """
    n = int(rng.integers(3, 13))
    masses = 2e5 * rng.uniform(0.6, 1.5, n)
    springs = 3.5e8 * rng.uniform(0.5, 1.5, n) * np.linspace(1.3, 0.7, n)
    # Share of the base shear in each story, for forces that increase linearly with the height.
    shares = np.cumsum(np.arange(1, n + 1)[::-1])[::-1] * 2.0 / (n * (n + 1))
    yields = rng.uniform(0.08, 0.25) * masses.sum() * 9.81 * shares * rng.uniform(0.85, 1.15, n)
    laws = (Law("bilinear", (float(force), rng.uniform(0.01, 0.1))) for force in yields)
    return model(
        [story(m, k, law) for m, k, law in zip(masses, springs, laws, strict=True)],
        damping=FIVE_PERCENT,
    )


def peaks():
    """Print the errors of the peaks of random bilinear buildings.

    The time steps are 0.01 s, and 0.02 s with sampling intervals of 0.01 and 0.02 s.
    """
    record = model_record(MODELS["ten-story"])
    coarse = replace(record, acceleration=record.acceleration[::2].copy(), dt=2.0 * record.dt)
    rng = np.random.default_rng(5)
    buildings = [random_bilinear(rng) for _ in range(20)]
    cases = ((record, 0.01), (record, 0.02), (coarse, 0.02))
    print("maximum error of a peak in a building: median and maximum of 20 buildings")
    print(f"{'method':18s}{'record':>8s}{'dt':>6s}" + "".join(f"{name[5:]:>20s}" for name in PEAKS))
    for method in ("impulse4", "moment4", "newmark-average"):
        for ground_motion, dt in cases:
            errors = []
            for building in buildings:
                exact = _exact_peaks(building, ground_motion)
                stories = run(building, ground_motion, method=method, dt=dt).stories
                errors.append(
                    [max_relative_error(getattr(stories, name), exact[name]) for name in PEAKS]
                )
            cells = (
                f"{np.median(column):.1e} {np.max(column):.1e}" for column in np.transpose(errors)
            )
            print(
                f"{method:18s}{ground_motion.dt:8.2f}{dt:6.2f}"
                + "".join(f"{cell:>20s}" for cell in cells)
            )


_STORED_PEAKS: dict = {}


def _exact_peaks(building, record, parts=64):
    """Return the peaks of `PEAKS` by name from a run of impulse4 with `parts` steps per sample.

    The results are stored in `_STORED_PEAKS` by building and sampling interval.
    """
    key = (id(building), record.dt)
    if key not in _STORED_PEAKS:
        stories = run(building, record, method="impulse4", dt=record.dt / parts).stories
        _STORED_PEAKS[key] = {name: getattr(stories, name) for name in PEAKS}
    return _STORED_PEAKS[key]


def integrate_five_times(prepared, integrator, steps, ground):
    """Integrate a building five times, because one run of a millisecond is too short for the
    clock."""
    for _ in range(5):
        prepared.integrate(integrator, steps, ground)


def speed():
    """Print the processor times of impulse4 with long steps."""
    print(
        f"processor time of impulse4 with {', '.join(map(str, SAMPLES))} samples per step, divided "
        "by the time with one sample per step; this time, ms"
    )
    for name, building in MODELS.items():
        record = model_record(building)
        prepared, integrator = PreparedBuilding.of(building), parse("impulse4")
        calls = []
        for k in SAMPLES:
            steps = choose_steps(k * record.dt, None, record.dt, record.duration)
            calls.append(
                partial(
                    integrate_five_times, prepared, integrator, steps, record.acceleration.copy()
                )
            )
        times = [seconds / 5 for seconds in minimum_times(calls, REPEATS)]
        print(
            f"{name:20s}"
            + "".join(f"{seconds / times[0]:8.3f}" for seconds in times)
            + f"{1e3 * times[0]:10.3f}"
        )


def tolerance():
    """Print the results of campaigns that choose the time step of a building for a tolerance.

    12 random bilinear buildings are analyzed under six ground motions with four scale factors. The
    time step is chosen by the strongest run without collapse, or by several runs of different
    strength.
    """
    records = dict(enumerate(components()))
    runs = [Run(number, scale) for number in records for scale in (0.25, 0.5, 1.0, 1.5)]
    # From the strongest to the weakest run.
    ranked = sorted(runs, key=lambda run: -run.scale * records[run.motion].pga)
    rng = np.random.default_rng(7)
    buildings = [random_bilinear(rng) for _ in range(12)]

    def peak_drifts(building, method, step):
        """Return the peak drifts of all runs with a time step in s, shape (runs, stories), in m."""
        batch = Batch(
            0,
            Subject(building, method),
            records,
            dict.fromkeys(records),
            CampaignSettings(stories=True),
        )
        return np.array(
            [row.values[PEAK_DRIFT] for row in batch.results(runs, step).stories]
        ).reshape(len(runs), -1)

    exact_drifts = [peak_drifts(building, "impulse4", 0.01 / 16) for building in buildings]
    print(
        "runs that exceed the tolerance, % / maximum error of a peak drift / processor time of the "
        "choice + of the runs, s"
    )
    print(f"{'':30s}{'strongest run':>28s}{'several runs':>28s}")
    for method in ("impulse4", "moment4", "newmark-average"):
        for within in (0.01, 0.001):
            cells = []
            # `building_step` returns None if all runs of a group collapse. In this case the next
            # group is used.
            for groups in ([[strongest] for strongest in ranked], [runs]):
                errors, choice_time, run_time = [], 0.0, 0.0
                for building, exact in zip(buildings, exact_drifts, strict=True):
                    start = time.process_time()
                    subject = Subject(building, method)
                    steps = (
                        building_step(subject, records, group, CampaignSettings(), within)
                        for group in groups
                    )
                    step = next(step for step in steps if step is not None)
                    end_of_choice = time.process_time()
                    drifts = peak_drifts(building, method, step)
                    choice_time += end_of_choice - start
                    run_time += time.process_time() - end_of_choice
                    errors += list(np.max(np.abs(drifts / exact - 1.0), axis=1))
                exceeding = 100.0 * np.mean(np.array(errors) > within)
                cells.append(
                    f"{exceeding:.1f} / {max(errors):.1e} / {choice_time:.1f} + {run_time:.1f}"
                )
            print(
                f"{method:20s}{100.0 * within:8.1f} %" + "".join(f"{cell:>28s}" for cell in cells)
            )


TABLES = {function.__name__: function for function in (motion, peaks, speed, tolerance)}

if __name__ == "__main__":
    for name in sys.argv[1:] or TABLES:
        TABLES[name]()
        print()
