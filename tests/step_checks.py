"""Measurements on compiled steps for tests of several method families, and dense matrices for
comparison."""

from dataclasses import replace

import numpy as np
from scipy.linalg import eigh

from building_cases import Force, Law, ModalDamping, RayleighCoefficients, model, oscillator, story
from tdint.kernels import layout as rows
from tdint.kernels.stepping import Scene
from tdint.kernels.stories.branches import enter
from tdint.methods.catalogue import parse
from tdint.methods.workspace import workspace
from tdint.model.building import assemble, variant
from tdint.response.runs.case import Case
from tdint.response.runs.outcome import FailedRun
from tdint.response.runs.run import run

RAYLEIGH = RayleighCoefficients(mass=0.8, stiffness=2e-3)
FORCE = Force(1, 3.0, 2.0, 5.0)


def building(damping=None, nonlinear=False, **more):
    """Return four unequal stories with P-delta, a dashpot and a floor force."""
    masses, springs = (2e5, 1.5e5, 1.8e5, 1e5), (3e8, 2.5e8, 2.5e8, 1.5e8)
    laws = (
        [Law("polynomial", (k, 0.0, 40.0 * k)) for k in springs]
        if nonlinear
        else [Law("linear", ())] * 4
    )
    stories = [
        story(m, k, law, height=3.0) for m, k, law in zip(masses, springs, laws, strict=True)
    ]
    if not isinstance(damping, ModalDamping):
        stories[2] = story(masses[2], springs[2], laws[2], height=3.0, dashpot=4e5)
        more |= {"p_delta": True, "forces": [Force(3, 2e5, -1e5, 9.0)]}
    return model(
        stories,
        damping=damping,
        displacement=(0.01, 0.0, 0.02, 0.03),
        velocity=(0.3, 0.1, 0.0, 0.5),
        **more,
    )


def matrices(model):
    """Return M, C and K of a linear building with Rayleigh damping; C does not depend on
    P-delta."""
    mass = np.array([s.mass for s in model.stories])
    drift = np.eye(mass.size) - np.eye(mass.size, k=-1)
    dashpots = drift.T @ np.diag([s.dashpot for s in model.stories]) @ drift
    springs = drift.T @ np.diag([s.stiffness for s in model.stories]) @ drift
    weight = 9.80665 * np.cumsum(mass[::-1])[::-1] / [s.height for s in model.stories]
    C = dashpots + model.damping.mass * np.diag(mass) + model.damping.stiffness * springs
    return np.diag(mass), C, springs - model.p_delta * drift.T @ np.diag(weight) @ drift


def restoring_of(case, nonlinear):
    """Return f(u) and its Jacobian of `building`, dense."""
    _, _, K = matrices(case)
    cubic = 40.0 * nonlinear * np.array([s.stiffness for s in case.stories])
    drift = np.eye(4) - np.eye(4, k=-1)
    return (
        lambda u: K @ u + drift.T @ (cubic * (drift @ u) ** 3),
        lambda u: K + drift.T @ np.diag(3.0 * cubic * (drift @ u) ** 2) @ drift,
    )


def load(model, record, t):
    """Return the load on the floors at time t, N."""
    ground = np.interp(t, record.dt * np.arange(record.acceleration.size), record.acceleration)
    p = -np.array([s.mass for s in model.stories]) * ground
    for f in model.excitation.forces:
        p[f.floor - 1] += f.cosine * np.cos(f.omega * t) + f.sine * np.sin(f.omega * t)
    return p


def superposed(method, model, ratio, record):
    """Return the displacements of a linear building, shape (steps + 1, n), by the same steps of its
    modes as oscillators. `ratio` is the damping ratio of a mode as a function of its omega."""
    M, _, K = matrices(replace(model, damping=RAYLEIGH))
    squares, shapes = eigh(K, M)
    total = 0.0
    for omega, shape in zip(np.sqrt(squares), shapes.T, strict=True):
        factor = shape @ M @ np.ones(shape.size)
        u0, v0 = (
            shape @ M @ np.array([model.initial.displacement, model.initial.velocity]).T
        ) / factor
        start = {"displacement": (u0,), "velocity": (v0,)}
        mode = run(
            oscillator(omega, ratio(omega), **start), record, method=method, history=True
        ).history
        total = total + factor * mode.displacement * shape
    return total


def at_samples(building, record, method, parts):
    """Return a run with `parts` steps per sampling interval, and its displacements at the
    samples."""
    response = run(
        building,
        record,
        method=method,
        dt=record.dt / parts,
        duration=record.duration,
        history=True,
    )
    return response, response.history.displacement[::parts]


def refined(building, record, parts, method="impulse4", size=lambda u: np.max(np.abs(u))):
    """Return runs with increasing numbers of steps per sampling interval, the displacements of the
    last run at the samples, and the relative differences of the other runs."""
    runs, displacements = zip(
        *(at_samples(building, record, method, part) for part in parts), strict=True
    )
    finest = displacements[-1]
    return runs, finest, [size(coarse - finest) / size(finest) for coarse in displacements[:-1]]


TOO_LARGE = -400.0
"""Ground acceleration that softening `SingleSteps` cannot bear at the end of a step, m/s^2."""


SOFTENING = Law("polynomial", (100.0, -100.0))
"""f = 100 d - 100 d^2, at most 25 N."""


class SingleSteps:
    """Single steps of 1 s from rest, for two stories of 100 N/m under floors of 1 kg."""

    def __init__(self, method, law=SOFTENING):
        self.integrator = parse(method)
        self.building = assemble(model([story(1.0, 100.0, law), story(1.0, 100.0, law)]))
        self.space = workspace(self.building, self.integrator)
        for i in range(2):
            enter(self.building.law_parameters, self.space.law_state, i)

    def take(self, ground_0, ground_1):
        """Compute one step of 1 s and return its code; a negative code means a failed step.

        `ground_0` and `ground_1` are the ground accelerations at the start and end, m/s^2.
        """
        no_forces = np.zeros((0, rows.FORCE_COLUMNS))
        building, space = self.building, self.space
        scene = Scene(
            building.linear_terms, building.modal, building.law_parameters, no_forces, space.flags
        )
        code = self.integrator.family.step.variant(variant(building))(
            self.integrator.coefficients(building, no_forces, 1.0),
            *scene,
            1.0,
            np.array([0.0, ground_0, ground_1]),
            *space.memory,
        )
        if code >= 0:
            self.space.step_status[rows.STEPS_DONE] += 1.0
        return code

    def memory(self):
        """Return the state and the committed drift laws."""
        return np.vstack([self.space.state, self.space.law_state[: rows.LAW_STATE_ROWS]])


def broken(threshold):
    """Return a replacement of `Case.integrate` that diverges for time steps below a threshold."""
    integrate = Case.integrate

    def fails(case, steps, history=False):
        if steps.h < threshold:
            raise FailedRun("broken", "diverged", case.method.label, steps.h)
        return integrate(case, steps, history)

    return fails
