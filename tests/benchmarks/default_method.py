"""Which method errs least for its time: python tests/benchmarks/default_method.py [RANDOM BUILDINGS]

Prints a table in Markdown: of the scenes that come with tdint and of 40 random buildings under its records the time in
which moment4 (with the error that it carries along), impulse4 and, where the building is linear, exact come below an
error of the peak drifts, the largest of all stories, over that of the fastest of them: the geometric mean, and of how
many buildings a method is the fastest. A step is the largest of 8, 4, 2, 1, 1/2, ... 1/32 sampling intervals from which
on all err less. The truth is another method at a 64th of the interval (impulse4 for moment4, else moment4); where both
differ by more than a tenth of an error it is not asked for. `corrected` is moment4 by its corrected peaks, where its
rule allows them. Times are processor time of the compiled loop, least of several, all methods and steps taking turns.
"""

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[1]))
from common import ROOT, components

from building_cases import LINEAR, Law, RayleighCoefficients, model, story
from tdint import load_model, prepare
from tdint.analysis.run.outcome import FailedRun
from tdint.analysis.run.run import model_record
from tdint.model.building import assemble

SCENES = ("ten-story", "hazus-c1", "ten-story-bilinear", "kaikoura-frame", "base-isolated", "three-story-concrete")
LIMITS = (1e-2, 1e-3, 1e-4)
PARTS = (1 / 8, 1 / 4, 1 / 2, 1, 2, 4, 8, 16, 32)
FINE = 64
REPEATS = 3
SECONDS = 20.0
MOMENT4, CORRECTED, IMPULSE4, EXACT = "moment4", "moment4, corrected", "impulse4", "exact"

time.perf_counter = time.thread_time  # `Response.march_time`: the machine may be at other work


def shipped():
    """The scenes under their own records."""
    for name in SCENES:
        building = load_model(ROOT / "configs" / f"{name}.yaml")
        yield building, model_record(building)


def drawn(count):
    """Buildings of 2 to 15 stories, T1 of 0.05 to 0.16 s a story, 2 to 5 % damping, a third linear, under parts of the
    records; the others yield at 0.1 to 0.4 g."""
    records = components()
    for seed in range(count):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 16))
        masses, share = 2e5 * rng.uniform(0.7, 1.3, n), np.linspace(1.0, rng.uniform(0.4, 1.0), n)
        bare = assemble(model([story(m, 1e8 * s) for m, s in zip(masses, share, strict=True)]))
        stiffness = 1e8 * share * (bare.modes().omega[0] * n * rng.uniform(0.05, 0.16) / (2.0 * np.pi)) ** -2
        strength = 9.81 * rng.uniform(0.1, 0.4) * np.cumsum(masses[::-1])[::-1]
        laws = {
            0: lambda force: LINEAR,
            1: lambda force: Law("bilinear", (force, 0.03)),
            2: lambda force: Law("peak-oriented", (force, 0.03, 0.3)),
        }
        stories = [story(m, k, laws[seed % 3](f)) for m, k, f in zip(masses, stiffness, strength, strict=True)]
        omega = assemble(model(stories)).modes().omega[[0, 1]]
        ratio = rng.uniform(0.02, 0.05)
        damping = RayleighCoefficients(*(2.0 * ratio / np.sum(omega) * np.array([np.prod(omega), 1.0])))
        record = records[seed % len(records)]
        yield (
            model(stories, damping=damping),
            replace(record, acceleration=record.acceleration[: round(SECONDS / record.dt)]),
        )


def marched(case, dt):
    """The response, None where there is none."""
    try:
        return case.march(case.steps(dt))
    except FailedRun:
        return None


def times(building, record):
    """Of each method the least time, s, by limit; and the limits that the truths are good for."""
    building = replace(building, collapse_drift=1e9)
    cases = {name: prepare(building, record, method=name) for name in (MOMENT4, IMPULSE4, EXACT)}
    if not cases[EXACT].building.linear:
        del cases[EXACT]
    truths = {name: marched(cases[name], record.dt / FINE).stories.peak_drift for name in (MOMENT4, IMPULSE4)}
    gap = np.max(np.abs(truths[MOMENT4] / truths[IMPULSE4] - 1.0))
    cases[MOMENT4], _ = cases[MOMENT4].carrying_error()
    errors, seconds = {}, {}
    for repeat in range(REPEATS):
        for parts in PARTS:
            for name, case in cases.items():
                response = marched(case, record.dt / parts)
                key = name, parts
                if response is None or response.collapse:
                    errors[key] = np.inf
                    continue
                seconds[key] = min(seconds.get(key, np.inf), response.march_time)
                if repeat:
                    continue
                truth = truths[MOMENT4 if name != MOMENT4 else IMPULSE4]
                errors[key] = np.max(np.abs(response.stories.peak_drift / truth - 1.0))
                if name == MOMENT4:
                    told = response.check.drift_error <= 1e-2
                    corrected = response.check.corrected.peak_drift if told else response.stories.peak_drift
                    errors[CORRECTED, parts] = np.max(np.abs(corrected / truth - 1.0))
    seconds |= {(CORRECTED, parts): seconds.get((MOMENT4, parts), np.inf) for parts in PARTS}
    names = [*cases, CORRECTED]
    limits = [limit for limit in LIMITS if gap <= 0.1 * limit]
    return {limit: {name: least(limit, name, errors, seconds) for name in names} for limit in limits}


def least(limit, name, errors, seconds):
    """The time with the largest step from which on all err less than a limit; inf if none does."""
    found = np.inf
    for parts in reversed(PARTS):
        if not errors[name, parts] <= limit:
            return found
        found = seconds[name, parts]
    return found


def main():
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    rows = {}
    for kind, source in (("scenes", shipped()), ("random", drawn(count))):
        for building, record in source:
            linear = assemble(building).linear
            for limit, found in times(building, record).items():
                rows.setdefault((f"{kind}, {'linear' if linear else 'yielding'}", limit), []).append(found)
    names = (MOMENT4, CORRECTED, IMPULSE4, EXACT)
    print("| buildings | error | " + " | ".join(names) + " |")
    print("|---" * (len(names) + 2) + "|")
    for (kind, limit), cases in rows.items():
        cells = []
        for name in names:
            own = [found[name] / min(found[other] for other in found if other != CORRECTED) for found in cases
                   if name in found]  # fmt: skip
            known = [one for one in own if one < np.inf]
            text = f"{np.exp(np.mean(np.log(known))):.2f}, {sum(one <= 1.0 for one in known)}" if known else ""
            cells.append(text + (f" ({len(own) - len(known)} not)" if len(known) < len(own) else ""))
        print(f"| {kind} ({len(cases)}) | {100.0 * limit:g} % | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
