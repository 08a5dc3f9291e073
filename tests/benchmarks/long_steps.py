"""Steps over several samples of a record, and peaks between the steps: python
tests/benchmarks/long_steps.py [TABLE]...

Tables: motion (L2 error and largest error of a peak drift at 1, 2, 4 and 8 samples a step, all
methods), peaks (peak floor accelerations, shears and drifts of 20 random bilinear buildings), speed
(processor time of long steps over that at the record's own), tolerance (campaigns that choose their
steps: how many runs are beyond it). All if none is named.
"""

import sys
import time
from dataclasses import replace
from functools import partial

import numpy as np
from common import ROOT, components, difference, largest, least
from moment4 import reference, table

from building_cases import FIVE_PERCENT, Law, model, story
from tdint import load_model, run
from tdint.analysis.arguments import model_record
from tdint.analysis.run.batch import Subject
from tdint.analysis.run.outcome import STORY_QUANTITIES
from tdint.analysis.run.prepared import Motions, PreparedBuilding
from tdint.analysis.time_steps import choose_steps
from tdint.campaign.batch import Batch, Run, RunSettings, building_step
from tdint.methods.catalogue import catalogue, parse

MODELS = {
    name: load_model(ROOT / "configs" / f"{name}.yaml")
    for name in ("ten-story", "ten-story-bilinear")
}
SAMPLES = (1, 2, 4, 8)
REPEATS = 25
PEAK_DRIFT = [one.name for one in STORY_QUANTITIES].index("peak_drift")
PEAKS = ("peak_absolute_acceleration", "peak_shear", "peak_velocity", "peak_drift")


def motion():
    """The two ten-story buildings with all methods."""
    for name, building in MODELS.items():
        truth, other = (reference(building, method, 64) for method in ("impulse4", "gauss4"))
        sure = difference(other[0], truth[0])
        print(
            f"{name}: L2 error / largest error of a peak drift; gauss4 at dt/64 differs by "
            f"{sure:.0e}"
        )
        methods = [
            text
            for text, method in catalogue().items()
            if name == "ten-story" or not method.family.linear_only
        ]
        table(building, methods, truth, SAMPLES)
        print()


def random_bilinear(rng):
    """A building of three to twelve stories that yield, 5 % damped."""
    n = int(rng.integers(3, 13))
    masses = 2e5 * rng.uniform(0.6, 1.5, n)
    springs = 3.5e8 * rng.uniform(0.5, 1.5, n) * np.linspace(1.3, 0.7, n)
    weights = np.cumsum(np.arange(1, n + 1)[::-1])[::-1] * 2.0 / (n * (n + 1))
    yields = rng.uniform(0.08, 0.25) * masses.sum() * 9.81 * weights * rng.uniform(0.85, 1.15, n)
    laws = (Law("bilinear", (float(force), rng.uniform(0.01, 0.1))) for force in yields)
    return model(
        [story(m, k, law) for m, k, law in zip(masses, springs, laws, strict=True)],
        damping=FIVE_PERCENT,
    )


def peaks():
    """Random bilinear buildings at steps of 0.01 and 0.02 s, the latter of a record at 0.01 and at
    0.02 s."""
    record = model_record(MODELS["ten-story"])
    coarse = replace(record, acceleration=record.acceleration[::2].copy(), dt=2.0 * record.dt)
    rng = np.random.default_rng(5)
    buildings = [random_bilinear(rng) for _ in range(20)]
    cases = ((record, 0.01), (record, 0.02), (coarse, 0.02))
    print("largest error of a peak in a building: median, largest of 20 buildings")
    print(f"{'method':18s}{'record':>8s}{'dt':>6s}" + "".join(f"{name[5:]:>20s}" for name in PEAKS))
    for method in ("impulse4", "moment4", "newmark-average"):
        for motion_of, dt in cases:
            errors = []
            for building in buildings:
                truth = _truth(building, motion_of)
                got = run(building, motion_of, method=method, dt=dt).stories
                errors.append([largest(getattr(got, name), truth[name]) for name in PEAKS])
            cells = (f"{np.median(one):.1e} {np.max(one):.1e}" for one in np.transpose(errors))
            print(
                f"{method:18s}{motion_of.dt:8.2f}{dt:6.2f}"
                + "".join(f"{cell:>20s}" for cell in cells)
            )


_TRUTHS: dict = {}


def _truth(building, record, parts=64):
    """Peaks of a fine run."""
    key = (id(building), record.dt)
    if key not in _TRUTHS:
        stories = run(building, record, method="impulse4", dt=record.dt / parts).stories
        _TRUTHS[key] = {name: getattr(stories, name) for name in PEAKS}
    return _TRUTHS[key]


def five_times(prepared, integrator, steps, ground):
    """Five marches: one takes a millisecond, which clocks do not tell well."""
    for _ in range(5):
        prepared.integrate(integrator, steps, ground)


def speed():
    """Processor time of the march."""
    print("processor time of a run over that at the record's own step, impulse4, and that, ms")
    for name, building in MODELS.items():
        record = model_record(building)
        prepared, integrator = PreparedBuilding.of(building), parse("impulse4")
        works = []
        for k in SAMPLES:
            steps = choose_steps(k * record.dt, None, record.dt, record.duration)
            works.append(
                partial(five_times, prepared, integrator, steps, record.acceleration.copy())
            )
        times = [seconds / 5 for seconds in least(works, REPEATS)]
        print(
            f"{name:20s}"
            + "".join(f"{each / times[0]:8.3f}" for each in times)
            + f"{1e3 * times[0]:10.3f}"
        )


def tolerance():
    """Campaigns of 12 random bilinear buildings under the shipped motions at four scales, with
    steps that are chosen under the strongest run without collapse alone, and under some that are
    spread."""
    records = dict(enumerate(components()))
    motions = Motions(records)
    runs = [Run(motion_of, scale) for motion_of in records for scale in (0.25, 0.5, 1.0, 1.5)]
    ranked = sorted(runs, key=lambda one: -one.scale * records[one.motion].pga)
    rng = np.random.default_rng(7)
    buildings = [random_bilinear(rng) for _ in range(12)]

    def drifts(building, method, step):
        batch = Batch(
            0, Subject(building, method), motions, dict.fromkeys(records), RunSettings(stories=True)
        )
        return np.array(
            [row.values[PEAK_DRIFT] for row in batch.results(runs, step).stories]
        ).reshape(len(runs), -1)

    truths = [drifts(building, "impulse4", 0.01 / 16) for building in buildings]
    print(
        "runs beyond the tolerance, % / largest error of a peak drift / processor time of choice "
        "and runs, s"
    )
    print(f"{'':30s}{'the strongest':>28s}{'spread':>28s}")
    for method in ("impulse4", "moment4", "newmark-average"):
        for within in (0.01, 0.001):
            cells = []
            for parts in ([[one] for one in ranked], [runs]):
                errors, choosing, running = [], 0.0, 0.0
                for building, truth in zip(buildings, truths, strict=True):
                    begin = time.process_time()
                    subject = Subject(building, method)
                    steps = (
                        building_step(subject, records, part, RunSettings(), within)
                        for part in parts
                    )
                    step = next(step for step in steps if step is not None)
                    chosen = time.process_time()
                    found = drifts(building, method, step)
                    choosing, running = (
                        choosing + chosen - begin,
                        running + time.process_time() - chosen,
                    )
                    errors += list(np.max(np.abs(found / truth - 1.0), axis=1))
                beyond = 100.0 * np.mean(np.array(errors) > within)
                cells.append(f"{beyond:.1f} / {max(errors):.1e} / {choosing:.1f} + {running:.1f}")
            print(
                f"{method:20s}{100.0 * within:8.1f} %" + "".join(f"{cell:>28s}" for cell in cells)
            )


TABLES = {one.__name__: one for one in (motion, peaks, speed, tolerance)}

if __name__ == "__main__":
    for name in sys.argv[1:] or TABLES:
        TABLES[name]()
        print()
