"""Measure the energy conservation and the errors of `moment4`.

    python tests/benchmarks/moment4.py [TABLE]...

Tables (default: all):

energy     conservative problems of `tdint failures` with their time steps and four times these
random     free vibration of random buildings
yielding   ten yielding stories, with time steps that are shorter and longer than the sampling
           interval
laws       errors for every hysteretic law
stiff      yielding stories combined with stiff stories
tolerance  time and energy balance for several tolerances of the residuals
"""

import sys
from dataclasses import replace

import numpy as np
from common import ROOT, l2_error
from march import with_law

from building_cases import story
from random_buildings import CONSERVATIVE, HYSTERETIC, random_building
from tdint import load_model, run
from tdint.assessment.chart.performance_profiles import STANDARD, read_problems
from tdint.assessment.failures.failures import problems
from tdint.methods import moment4
from tdint.methods.catalogue import parse
from tdint.model.story_laws import LAWS
from tdint.response.runs.case import Case
from tdint.response.runs.outcome import FailedRun
from tdint.response.runs.prepared import PreparedBuilding

MODEL = load_model(ROOT / "configs" / "ten-story-bilinear.yaml")
DT = 0.01  # s; sampling interval of the record
FINE = 16  # time steps per sampling interval of the reference
METHODS = ("moment4", "impulse4", "gauss4", "newmark-average")


def energy():
    """Print the changes of the energy of conservative problems."""
    print("energy / initial energy - 1: minimum, maximum; maximum increase in a step")
    for name in ("hardening", "softening"):
        problem = problems()[name]
        for dt, steps in problem.steps:
            for factor in (1, 4):
                for rho_inf in (1.0, 0.8, 0.5, 0.2, 0.0):
                    method = f"moment4:rho_inf={rho_inf}"
                    history = run(
                        problem.model,
                        method=method,
                        dt=factor * dt,
                        duration=steps * dt,
                        history=True,
                    ).history
                    ratio = problem.energy(history) / problem.energy_scale
                    rise = np.max(np.diff(ratio))
                    extremes = f"{np.min(ratio) - 1.0:9.1e} {np.max(ratio) - 1.0:9.1e}"
                    print(
                        f"{name:10s} dt {factor * dt:6.3f}  rho_inf {rho_inf:3.1f}  {extremes} "
                        f"{rise:9.1e}"
                    )


def _free_vibrations(laws, seed, cases=200):
    """Run random buildings in free vibration with moment4.

    Parameters
    ----------
    laws : sequence
        Laws for `random_building`.
    seed : int
        Seed of the random buildings.
    cases : int
        Number of buildings.

    Returns
    -------
    changes : dict of bool to list of float
        Maximum change of the energy divided by the initial energy, for buildings with (True) and
        without (False) tanh stories.
    rise : float
        Maximum increase of the energy in a step, divided by the initial energy.
    balance : float
        Maximum error of the energy balance.
    halved : int
        Number of runs with halved steps.
    """
    generator = np.random.default_rng(seed)
    changes = {True: [0.0], False: [0.0]}
    rises, balances, halved = [], [], 0
    for _ in range(cases):
        building, period = random_building(generator, laws)
        step = period * generator.uniform(0.005, 0.2)
        response = run(building, method="moment4", dt=step, duration=20.0 * period, history=True)
        terms = response.history.energy
        total = (terms.kinetic + terms.strain) / (terms.kinetic + terms.strain)[0]
        has_tanh = any(story.law.name == "tanh" for story in building.stories)
        changes[has_tanh].append(np.max(np.abs(total - 1.0)))
        rises.append(np.max(np.diff(total)))
        balances.append(np.max(np.abs(terms.error)))
        halved += response.substeps > 0
    return changes, max(rises), max(balances), halved


def random():
    """Print the energy errors of 200 conservative and 200 hysteretic random buildings in free
    vibration."""
    changes, _, _, halved = _free_vibrations(CONSERVATIVE, 0)
    print(
        f"conservative: change of the energy {max(changes[False]):.1e}, with tanh stories "
        f"{max(changes[True]):.1e}; {halved} runs with halved steps"
    )
    _, rise, balance, halved = _free_vibrations(HYSTERETIC, 1)
    print(
        f"hysteretic: maximum increase of the energy in a step {rise:.1e}, energy balance "
        f"{balance:.1e}; {halved} runs with halved steps"
    )


def errors(model, method, samples, reference):
    """Return the text L2 ERROR/MAXIMUM ERROR OF A PEAK DRIFT, or the status of a failed run.

    Parameters
    ----------
    model : Model
        Building under its record.
    method : str
        Name of the method.
    samples : float
        Samples per step; less than 1 for several steps per sample.
    reference : tuple
        Result of `reference`.
    """
    exact, peaks = reference
    try:
        response = run(model, method=method, dt=DT * samples, history=True)
    except FailedRun as failure:
        return f"{failure.status:>15s}"
    # Compare at the times that both the steps and the samples contain.
    steps_per_sample, samples_per_step = max(round(1 / samples), 1), max(round(samples), 1)
    displacement = response.history.displacement[::steps_per_sample]
    error = l2_error(displacement, exact[::samples_per_step])
    peak = np.max(np.abs(response.stories.peak_drift / peaks - 1.0))
    return f"{error:.1e}/{peak:.1e}"


def reference(model, method="impulse4", parts=FINE):
    """Return a reference solution with `parts` time steps per sample.

    Returns
    -------
    displacement : ndarray, shape (samples, stories)
        Displacements at the samples, m.
    peak_drift : ndarray, shape (stories,)
        Peak drifts, m.
    """
    fine = run(model, method=method, dt=DT / parts, history=True)
    return fine.history.displacement[::parts], fine.stories.peak_drift


def print_errors(model, methods, reference, all_samples):
    """Print a table of `errors`: a row for each method, a column for each number of samples per
    step."""
    print(f"{'':22s}" + "".join(f"{f'{samples:g} samples':>18s}" for samples in all_samples))
    for method in methods:
        cells = (errors(model, method, samples, reference) for samples in all_samples)
        print(f"{method:22s}" + "".join(f"{cell:>18s}" for cell in cells))


def yielding():
    """Print the errors for the ten bilinear stories of configs."""
    print("L2 error / maximum error of a peak drift, by samples of the record per step")
    print_errors(MODEL, METHODS, reference(MODEL), (0.25, 0.5, 1, 2, 4, 8))


def laws():
    """Print the errors for ten stories of every law, with the yield points of the bilinear
    stories."""
    models = {name: with_law(MODEL, name) for name in LAWS}
    for name, model in models.items():
        print(f"{name}: L2 error / maximum error of a peak drift")
        print_errors(
            model,
            METHODS,
            reference(model, "gauss4" if LAWS[name].curved else "impulse4"),
            (0.5, 1, 2, 4),
        )


def stiff():
    """Print the errors if every third story is linear and 1000 times as stiff.

    The time step does not resolve the high frequencies of these stories.
    """
    stories = tuple(
        story(original.mass, 1e3 * original.stiffness, height=original.height)
        if i % 3 == 2
        else original
        for i, original in enumerate(MODEL.stories)
    )
    model = replace(MODEL, stories=stories)
    print("L2 error / maximum error of a peak drift")
    dissipative = (
        "moment4:rho_inf=0.8",
        "moment4:rho_inf=0.5",
        "moment4:rho_inf=0",
        "impulse4:rho_inf=0.5",
    )
    print_errors(model, (*METHODS, *dissipative, "bathe"), reference(model), (0.5, 1, 2, 4))


def tolerance():
    """Print time, solves and energy balance of two elastic buildings for several tolerances of the
    residuals.

    The ground motion is near-fault, and the time step is one sampling interval.
    """
    print("tolerance: us per step, solves per step, error of the energy balance")
    original = parse("moment4")
    for problem in read_problems(STANDARD):
        if problem.motion != "near-fault" or problem.name not in ("tanh", "stiffening"):
            continue
        posed = problem.posed
        steps = posed.steps(posed.interval)
        for residual in (1e-13, 1e-11, 1e-9, 1e-7):
            coefficients = (*moment4.coefficients(1.0)[:-1], residual)
            method = replace(
                original.method, coefficients=lambda rho_inf, values=coefficients: values
            )
            integrator = replace(original, method=method)
            # Coefficients are stored by method name, so each tolerance needs a prepared building.
            prepared = PreparedBuilding.of(posed.model)
            case = Case(posed.model, prepared, posed.record, integrator)
            runs = [case.integrate(steps) for _ in range(15)]
            microseconds = 1e6 * min(response.solver_time for response in runs) / steps.count
            print(
                f"{problem.name:12s} {residual:.0e}: {microseconds:5.2f} "
                f"{runs[0].iterations / steps.count:5.2f} {abs(runs[0].energy.error):8.1e}"
            )


TABLES = {
    function.__name__: function for function in (energy, random, yielding, laws, stiff, tolerance)
}

if __name__ == "__main__":
    for name in sys.argv[1:] or TABLES:
        TABLES[name]()
        print()
