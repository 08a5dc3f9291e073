"""What moment4 keeps and how far it is off: python tests/benchmarks/moment4.py [TABLE]...

Tables: energy (the conservative problems of `tdint failures` at their own steps and four times
these), random (free vibration of random buildings), yielding (ten stories at parts and multiples of
the record's step), laws (errors for every drift law), stiff (yielding stories with stiff parts),
tolerance (time and energy balance by the tolerance of the residuals). All if none is named.
"""

import sys
from dataclasses import replace

import numpy as np
from common import ROOT, difference
from march import with_law

from building_cases import story
from random_buildings import CONSERVATIVE, HYSTERETIC, random_building
from tdint import load_model, run
from tdint.analysis.assessment.failures import problems
from tdint.analysis.chart.profiles import STANDARD, read_problems
from tdint.analysis.run.case import Case
from tdint.analysis.run.outcome import FailedRun
from tdint.analysis.run.prepared import PreparedBuilding
from tdint.methods import moment4
from tdint.methods.catalogue import parse
from tdint.model.definition import LAWS

MODEL = load_model(ROOT / "configs" / "ten-story-bilinear.yaml")
DT = 0.01
FINE = 16
METHODS = ("moment4", "impulse4", "gauss4", "newmark-average")


def energy():
    """Energy of conservative motions."""
    print("energy over that at the start, less 1: least, largest; largest rise in a step")
    for name in ("hardening", "softening"):
        problem = problems()[name]
        for dt, steps in problem.steps:
            for times in (1, 4):
                for rho_inf in (1.0, 0.8, 0.5, 0.2, 0.0):
                    method = f"moment4:rho_inf={rho_inf}"
                    history = run(
                        problem.model,
                        method=method,
                        dt=times * dt,
                        duration=steps * dt,
                        history=True,
                    ).history
                    ratio = problem.energy(history) / problem.energy_scale
                    rise = np.max(np.diff(ratio))
                    span = f"{np.min(ratio) - 1.0:9.1e} {np.max(ratio) - 1.0:9.1e}"
                    print(
                        f"{name:10s} dt {times * dt:6.3f}  rho_inf {rho_inf:3.1f}  {span} "
                        f"{rise:9.1e}"
                    )


def _study(laws, seed, cases=200):
    generator = np.random.default_rng(seed)
    drifts = {True: [0.0], False: [0.0]}
    rises, balances, halved = [], [], 0
    for _ in range(cases):
        building, period = random_building(generator, laws)
        step = period * generator.uniform(0.005, 0.2)
        response = run(building, method="moment4", dt=step, duration=20.0 * period, history=True)
        parts = response.history.energy
        total = (parts.kinetic + parts.strain) / (parts.kinetic + parts.strain)[0]
        drifts[any(one.law.name == "tanh" for one in building.stories)].append(
            np.max(np.abs(total - 1.0))
        )
        rises.append(np.max(np.diff(total)))
        balances.append(np.max(np.abs(parts.error)))
        halved += response.substeps > 0
    return drifts, max(rises), max(balances), halved


def random():
    """Free vibration of 200 random buildings of either kind."""
    drifts, rise, _, halved = _study(CONSERVATIVE, 0)
    print(
        f"conservative: drift {max(drifts[False]):.1e}, with tanh stories {max(drifts[True]):.1e}; "
        f"{halved} halved"
    )
    _, rise, balance, halved = _study(HYSTERETIC, 1)
    print(
        f"hysteretic: largest rise in a step {rise:.1e}, balance {balance:.1e}; {halved} with a "
        "halved step"
    )


def errors(model, method, samples, reference):
    """L2 error and largest error of a peak drift; samples per step."""
    exact, peaks = reference
    try:
        response = run(model, method=method, dt=DT * samples, history=True)
    except FailedRun as failure:
        return f"{failure.status:>15s}"
    parts, stride = max(round(1 / samples), 1), max(round(samples), 1)
    error = difference(response.history.displacement[::parts], exact[::stride])
    peak = np.max(np.abs(response.stories.peak_drift / peaks - 1.0))
    return f"{error:.1e}/{peak:.1e}"


def reference(model, method="impulse4", parts=FINE):
    """Displacements at the samples and peak drifts, with so many steps in a sample."""
    fine = run(model, method=method, dt=DT / parts, history=True)
    return fine.history.displacement[::parts], fine.stories.peak_drift


def table(model, methods, reference, all_samples):
    """A row a method, a column a number of samples in a step."""
    print(f"{'':22s}" + "".join(f"{f'{one:g} samples':>18s}" for one in all_samples))
    for method in methods:
        cells = (errors(model, method, samples, reference) for samples in all_samples)
        print(f"{method:22s}" + "".join(f"{cell:>18s}" for cell in cells))


def yielding():
    """The ten stories of the configuration."""
    print("L2 error / largest error of a peak drift, by samples of the record in a step")
    table(MODEL, METHODS, reference(MODEL), (0.25, 0.5, 1, 2, 4, 8))


def laws():
    """Ten stories of every law, bending where those of the model yield."""
    models = {name: with_law(MODEL, name) for name in LAWS}
    for name, model in models.items():
        print(f"{name}: L2 error / largest error of a peak drift")
        table(
            model,
            METHODS,
            reference(model, "gauss4" if LAWS[name].curved else "impulse4"),
            (0.5, 1, 2, 4),
        )


def stiff():
    """The ten stories with every third one 1000 times as stiff and elastic: the step does not
    resolve these."""
    stories = tuple(
        story(one.mass, 1e3 * one.stiffness, height=one.height) if i % 3 == 2 else one
        for i, one in enumerate(MODEL.stories)
    )
    model = replace(MODEL, stories=stories)
    print("L2 error / largest error of a peak drift")
    dissipative = (
        "moment4:rho_inf=0.8",
        "moment4:rho_inf=0.5",
        "moment4:rho_inf=0",
        "impulse4:rho_inf=0.5",
    )
    table(model, (*METHODS, *dissipative, "bathe"), reference(model), (0.5, 1, 2, 4))


def tolerance():
    """Time, solves and energy balance of two elastic buildings by the tolerance of the residuals.

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
            time = 1e6 * min(one.solver_time for one in runs) / steps.count
            print(
                f"{problem.name:12s} {residual:.0e}: {time:5.2f} "
                f"{runs[0].iterations / steps.count:5.2f} {abs(runs[0].energy.error):8.1e}"
            )


TABLES = {one.__name__: one for one in (energy, random, yielding, laws, stiff, tolerance)}

if __name__ == "__main__":
    for name in sys.argv[1:] or TABLES:
        TABLES[name]()
        print()
