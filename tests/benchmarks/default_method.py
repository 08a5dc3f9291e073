"""Compare the time that each method needs for a given error of the peak drifts.

    python tests/benchmarks/default_method.py [RANDOM BUILDINGS]

The problems are the models of configs with a record (including dampers and isolators) and
random buildings (default 20). For each problem and each error limit, the program prints a row of a
Markdown table: the fastest method, its time in ms, and the times of `impulse4` and of all other
methods divided by this time. Finally it prints, for each limit and method, the geometric mean of
these ratios over the yielding buildings and the number of buildings for which the method is the
fastest.

The time of a method for a limit is the time with the longest step that meets the limit, if all
shorter steps also meet it. The steps are 8, 4, 2, 1, 1/2, ... 1/16 sampling intervals. The error is
the maximum relative error of the peak drifts over the stories. The reference solution is `impulse4`
with a 64th of the sampling interval. A limit is omitted if `moment4` with this step differs from
the reference by more than a tenth of the limit. Times are processor times of the compiled loop, the
minimum of `REPEATS` runs; all methods and steps are repeated alternately.
"""

import sys
import time
from dataclasses import replace

import numpy as np
from common import ROOT, components

from building_cases import LINEAR, Law, RayleighCoefficients, model, story
from tdint import load_model, prepare
from tdint.assessment.chart.performance_profiles import METHODS
from tdint.errors import TdintError
from tdint.model.building import assemble
from tdint.response.runs.run import model_record

LIMITS = (1e-2, 1e-3, 1e-4)
"""Limits of the relative error of the peak drifts."""
STEPS_PER_SAMPLE = (1 / 8, 1 / 4, 1 / 2, 1, 2, 4, 8, 16)
"""Number of time steps per sampling interval, from the longest to the shortest step."""
STEPS_OF_REFERENCE = 64
"""Number of time steps per sampling interval of the reference solution."""
REPEATS = 3
DURATION = 20.0
"""Duration of the ground motions of random buildings, s."""

# On systems where `Response.solver_time` is wall time, measure the processor time of the thread
# instead, because the machine may do other work at the same time.
time.perf_counter = time.thread_time


def models_of_configs():
    """Yield name, model and record of each model of configs with a record, except for models with
    `collapse` in their file name, which demonstrate collapse."""
    for file in sorted((ROOT / "configs").glob("*.yaml")):
        building = load_model(file)
        if building.excitation.record is not None and "collapse" not in file.stem:
            yield file.stem, building, model_record(building)


def random_models(count):
    """Yield name, model and record of random buildings.

    The buildings have 2 to 15 stories, a first period of 0.05 to 0.16 s per story, and damping
    ratios of 2 to 5 % in the first two modes. A third of the buildings is linear, a third bilinear
    and a third peak-oriented; the base yields at 0.1 to 0.4 of the weight. The number of a building
    is its seed.
    """
    records = components()
    for seed in range(count):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 16))
        masses = 2e5 * rng.uniform(0.7, 1.3, n)  # kg
        # Stiffness of each story divided by the stiffness of the lowest story.
        stiffness_ratios = np.linspace(1.0, rng.uniform(0.4, 1.0), n)
        # Scale a building with 1e8 N/m in the lowest story to a random first period.
        unscaled = assemble(
            model(
                [story(m, 1e8 * ratio) for m, ratio in zip(masses, stiffness_ratios, strict=True)]
            )
        )
        period = n * rng.uniform(0.05, 0.16)  # s
        period_ratio = unscaled.modes().omega[0] * period / (2.0 * np.pi)
        stiffness = 1e8 * stiffness_ratios * period_ratio**-2
        # Yield force of a story: a fraction of the weight of the floors above.
        strength = 9.81 * rng.uniform(0.1, 0.4) * np.cumsum(masses[::-1])[::-1]
        law_factories = (
            lambda force: LINEAR,
            lambda force: Law("bilinear", (force, 0.03)),
            lambda force: Law("peak-oriented", (force, 0.03, 0.3)),
        )
        stories = [
            story(m, k, law_factories[seed % 3](force))
            for m, k, force in zip(masses, stiffness, strength, strict=True)
        ]
        # Rayleigh coefficients for the same damping ratio in the first two modes:
        # a0 = 2 ratio w1 w2 / (w1 + w2), a1 = 2 ratio / (w1 + w2).
        omega = assemble(model(stories)).modes().omega[[0, 1]]
        ratio = rng.uniform(0.02, 0.05)
        damping = RayleighCoefficients(
            *(2.0 * ratio / np.sum(omega) * np.array([np.prod(omega), 1.0]))
        )
        record = records[seed % len(records)]
        shortened = replace(record, acceleration=record.acceleration[: round(DURATION / record.dt)])
        yield f"random {seed}", model(stories, damping=damping), shortened


def integrate(case, dt):
    """Return the response of a prepared case with the time step dt, or None if the run fails."""
    try:
        return case.integrate(case.steps(dt))
    except TdintError:
        return None


def times_by_limit(building, record):
    """Return the time that each method needs for each limit of the error.

    Parameters
    ----------
    building : Model
        Model of the building. Its collapse criterion is disabled.
    record : Record
        Ground motion.

    Returns
    -------
    dict of float to dict of str to float
        Processor time in s by limit and method; inf if no time step meets the limit. Limits for
        which the reference solution is not accurate enough are omitted, as are methods that do not
        support the building.
    """
    building = replace(building, collapse_drift=1e9)
    is_linear = assemble(building).linear
    cases = {}
    for name in METHODS:
        try:
            case = prepare(building, record, method=name)
        except TdintError:  # the method does not support the dampers or laws
            continue
        if is_linear or name != "exact":
            cases[name] = case
    reference, second = (
        integrate(cases[name], record.dt / STEPS_OF_REFERENCE).stories.peak_drift
        for name in ("impulse4", "moment4")
    )
    reference_error = np.max(np.abs(second / reference - 1.0))
    # By method and number of steps per sample.
    errors, seconds = {}, {}
    for repeat in range(REPEATS):
        for steps_per_sample in STEPS_PER_SAMPLE:
            for name, case in cases.items():
                key = name, steps_per_sample
                # A run that failed in the first repeat is not repeated.
                if errors.get(key) == np.inf:
                    continue
                response = integrate(case, record.dt / steps_per_sample)
                if response is None or response.collapse:
                    errors[key] = np.inf
                    continue
                seconds[key] = min(seconds.get(key, np.inf), response.solver_time)
                if repeat == 0:
                    drifts = response.stories.peak_drift
                    errors[key] = np.max(np.abs(drifts / reference - 1.0))
    return {
        limit: {name: time_for_limit(limit, name, errors, seconds) for name in cases}
        for limit in LIMITS
        if reference_error <= 0.1 * limit
    }


def time_for_limit(limit, name, errors, seconds):
    """Return the time of a method with the longest step for which it meets a limit, s.

    All shorter steps must also meet the limit. The time is inf if the shortest step does not.

    Parameters
    ----------
    limit : float
        Limit of the error.
    name : str
        Name of the method.
    errors, seconds : dict
        Error and time in s by (method, steps per sample); see `STEPS_PER_SAMPLE`.
    """
    time_of_longest_step = np.inf
    for steps_per_sample in reversed(STEPS_PER_SAMPLE):
        # The negation also stops at an error of nan.
        if not errors[name, steps_per_sample] <= limit:
            break
        time_of_longest_step = seconds[name, steps_per_sample]
    return time_of_longest_step


def main():
    """Print a row for each building and limit, and the means over the yielding buildings."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    # By limit: for each yielding building, the time of each method divided by the minimum time.
    ratios_of_yielding = {}
    print(
        "| building | error | fastest | ms | impulse4 / fastest | other methods / fastest "
        "|\n|---|---|---|---|---|---|"
    )
    for problems in (models_of_configs(), random_models(count)):
        for name, building, record in problems:
            for limit, times in times_by_limit(building, record).items():
                fastest = min(times, key=times.get)
                ratios = {method: times[method] / times[fastest] for method in times}
                if not assemble(building).linear:
                    ratios_of_yielding.setdefault(limit, []).append(ratios)
                other_methods = sorted(
                    (method for method in ratios if method not in (fastest, "impulse4")),
                    key=ratios.get,
                )
                row = (
                    name,
                    f"{100.0 * limit:g} %",
                    fastest,
                    f"{1e3 * times[fastest]:.2f}",
                    f"{ratios['impulse4']:.2f}",
                    ", ".join(f"{m} {ratios[m]:.2f}" for m in other_methods if ratios[m] < np.inf),
                )
                print("| " + " | ".join(row) + " |", flush=True)
    for limit, buildings in ratios_of_yielding.items():
        print(
            f"\n{len(buildings)} yielding buildings, error {100.0 * limit:g} %: geometric mean of "
            "the time divided by the minimum time, number of buildings for which the method is "
            "the fastest, number of buildings for which no time step meets the error"
        )
        for method in METHODS[:-1]:  # without `exact`, which is for linear buildings
            ratios = np.array([building.get(method, np.inf) for building in buildings])
            solved = ratios[ratios < np.inf]
            mean = np.exp(np.mean(np.log(solved))) if solved.size else np.inf
            print(f"  {method}: {mean:.2f}, {np.sum(ratios <= 1.0)}, {np.sum(ratios == np.inf)}")


if __name__ == "__main__":
    main()
