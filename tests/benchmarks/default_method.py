"""Which method errs least for its time: python tests/benchmarks/default_method.py [RANDOM
BUILDINGS]

Prints a table in Markdown: of the scenes of configs that have a record, dampers and isolators among
them, and of random buildings (none where the number is 0, else 20) the time in which each method of
the benchmark comes below an error of the peak drifts, the worst story, over that of the fastest:
the fastest, its time in ms, and those of the others over it; at the end the geometric mean of each
over the yielding buildings and of how many it is the fastest. A step is the largest of 8, 4, 2, 1,
1/2, ... 1/16 sampling intervals from which on all err less. The truth is impulse4 at a 64th of the
interval; where moment4 there differs from it by more than a tenth of an error it is not asked for.
Times are processor time of the compiled loop, least of several, all methods and steps taking turns.
"""

import sys
import time
from dataclasses import replace

import numpy as np
from common import ROOT, components

from building_cases import LINEAR, Law, RayleighCoefficients, model, story
from tdint import load_model, prepare
from tdint.analysis.chart.profiles import METHODS
from tdint.analysis.run.run import model_record
from tdint.errors import TdintError
from tdint.model.building import assemble

LIMITS = (1e-2, 1e-3, 1e-4)
PARTS = (1 / 8, 1 / 4, 1 / 2, 1, 2, 4, 8, 16)
FINE = 64
REPEATS = 3
SECONDS = 20.0

time.perf_counter = time.thread_time  # `Response.solver_time`: the machine may be at other work


def shipped():
    """The scenes under their own records; all but those whose collapse is their purpose."""
    for file in sorted((ROOT / "configs").glob("*.yaml")):
        building = load_model(file)
        if building.excitation.record is not None and "collapse" not in file.stem:
            yield file.stem, building, model_record(building)


def drawn(count):
    """Buildings of 2 to 15 stories, T1 of 0.05 to 0.16 s a story, 2 to 5 % damping, a third linear,
    under parts of the records; the others yield at 0.1 to 0.4 g."""
    records = components()
    for seed in range(count):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 16))
        masses, share = 2e5 * rng.uniform(0.7, 1.3, n), np.linspace(1.0, rng.uniform(0.4, 1.0), n)
        bare = assemble(model([story(m, 1e8 * s) for m, s in zip(masses, share, strict=True)]))
        stiffness = (
            1e8
            * share
            * (bare.modes().omega[0] * n * rng.uniform(0.05, 0.16) / (2.0 * np.pi)) ** -2
        )
        strength = 9.81 * rng.uniform(0.1, 0.4) * np.cumsum(masses[::-1])[::-1]
        laws = {
            0: lambda force: LINEAR,
            1: lambda force: Law("bilinear", (force, 0.03)),
            2: lambda force: Law("peak-oriented", (force, 0.03, 0.3)),
        }
        stories = [
            story(m, k, laws[seed % 3](f))
            for m, k, f in zip(masses, stiffness, strength, strict=True)
        ]
        omega = assemble(model(stories)).modes().omega[[0, 1]]
        ratio = rng.uniform(0.02, 0.05)
        damping = RayleighCoefficients(
            *(2.0 * ratio / np.sum(omega) * np.array([np.prod(omega), 1.0]))
        )
        record = records[seed % len(records)]
        part = replace(record, acceleration=record.acceleration[: round(SECONDS / record.dt)])
        yield f"random {seed}", model(stories, damping=damping), part


def marched(case, dt):
    """The response, None where there is none."""
    try:
        return case.integrate(case.steps(dt))
    except TdintError:
        return None


def times(building, record):
    """Of each method the least time, s, by limit; for the limits that the truth is good for."""
    building = replace(building, collapse_drift=1e9)
    linear = assemble(building).linear
    cases = {}
    for name in METHODS:
        try:
            cases[name] = prepare(building, record, method=name)
        except TdintError:  # not for such dampers or laws
            continue
    cases = {name: case for name, case in cases.items() if linear or name != "exact"}
    truth, other = (
        marched(cases[name], record.dt / FINE).stories.peak_drift
        for name in ("impulse4", "moment4")
    )
    gap = np.max(np.abs(other / truth - 1.0))
    errors, seconds = {}, {}
    for repeat in range(REPEATS):
        for parts in PARTS:
            for name, case in cases.items():
                key = name, parts
                response = None if errors.get(key) == np.inf else marched(case, record.dt / parts)
                if response is None or response.collapse:
                    errors[key] = np.inf
                    continue
                seconds[key] = min(seconds.get(key, np.inf), response.solver_time)
                if not repeat:
                    errors[key] = np.max(np.abs(response.stories.peak_drift / truth - 1.0))
    limits = [limit for limit in LIMITS if gap <= 0.1 * limit]
    return {
        limit: {name: least(limit, name, errors, seconds) for name in cases} for limit in limits
    }


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
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    yielding = {}
    print(
        "| building | error | fastest | ms | impulse4 over it | the others over it "
        "|\n|---|---|---|---|---|---|"
    )
    for source in (shipped(), drawn(count)):
        for name, building, record in source:
            for limit, found in times(building, record).items():
                best = min(found, key=found.get)
                over = {method: value / found[best] for method, value in found.items()}
                if not assemble(building).linear:
                    yielding.setdefault(limit, []).append(over)
                others = sorted((m for m in over if m not in (best, "impulse4")), key=over.get)
                cells = ", ".join(f"{m} {over[m]:.2f}" for m in others if over[m] < np.inf)
                row = (
                    name,
                    f"{100.0 * limit:g} %",
                    best,
                    f"{1e3 * found[best]:.2f}",
                    f"{over['impulse4']:.2f}",
                    cells,
                )
                print("| " + " | ".join(row) + " |", flush=True)
    for limit, cases in yielding.items():
        print(
            f"\nYielding, {100.0 * limit:g} %, {len(cases)} buildings: geometric mean over the "
            "fastest, fastest of"
        )
        for method in METHODS[:-1]:
            own = np.array([over.get(method, np.inf) for over in cases])
            solved = own[own < np.inf]
            mean = np.exp(np.mean(np.log(solved))) if solved.size else np.inf
            print(
                f"  {method}: {mean:.2f}, {np.sum(own <= 1.0)}, not within any step "
                f"{np.sum(own == np.inf)}"
            )


if __name__ == "__main__":
    main()
