"""Calibration of a recorded building: posterior distributions of stiffness, strength and damping
from the motion of the roof, by Markov chains."""

import emcee
import numpy as np
from scipy.optimize import least_squares

import tdint

# Recorded motion: in this example, the frame with other parameters and added noise represents the
# building.
ground = tdint.read_record("records/kaikoura/WTMC.mseed", component="HN1", units="m/s^2")
ground = tdint.process(ground, trim=(45.0, 75.0))
frame = tdint.load_model("configs/ten-story-bilinear.yaml")
truth = {"stiffness_factor": 1.15, "strength_factor": 0.9, "damping": 0.03}
chance = np.random.default_rng(1)


def roof(**numbers):
    """Return the roof displacements, m, with a row for each sample."""
    runs = tdint.run_many(
        frame, ground, vary=numbers, history="displacement", every=10, method="impulse4"
    )
    return runs.history["displacement"][:, :, -1]


(recorded,) = roof(**{name: [value] for name, value in truth.items()})
noise = 0.05 * recorded.std()
recorded = recorded + noise * chance.standard_normal(recorded.size)

LOWEST, HIGHEST = np.array([0.5, 0.3, 0.005]), np.array([2.0, 3.0, 0.15])


def log_probability(points):
    """Return the log posterior densities of all walkers in one call: flat within the bounds, with
    the misfit of the roof relative to the noise."""
    inside = np.all((points > LOWEST) & (points < HIGHEST), axis=1)
    log_values = np.full(len(points), -np.inf)
    if inside.any():
        motions = roof(**dict(zip(truth, points[inside].T, strict=True)))
        log_values[inside] = (
            -0.5 * np.sum((np.nan_to_num(motions, nan=1e3) - recorded) ** 2, axis=1) / noise**2
        )
    return log_values


def slopes(point):
    """Return the derivatives of the roof's motion over the noise, with a column for each number."""
    numbers = {name: [value] for name, value in zip(truth, point, strict=True)}
    runs = tdint.run_many(
        frame, ground, vary=numbers, history="displacement", every=10, gradient=list(truth)
    )
    return runs.gradient.history["displacement"][0][:, :, -1].T / noise


def misfit(point):
    return (roof(**dict(zip(truth, point[:, None], strict=True)))[0] - recorded) / noise


# The mode follows from least squares; the walkers start around it with the covariance at the mode.
mode = least_squares(
    misfit, [1.0, 1.0, 0.05], jac=slopes, bounds=(LOWEST, HIGHEST), x_scale=[1.0, 1.0, 0.05]
)
start = chance.multivariate_normal(mode.x, np.linalg.inv(mode.jac.T @ mode.jac), 16)
print(f"mode by {mode.nfev} motions and {mode.njev} derivatives")
sampler = emcee.EnsembleSampler(16, 3, log_probability, vectorize=True)
sampler.random_state = np.random.RandomState(1).get_state()
sampler.run_mcmc(start, 60)
chain = sampler.get_chain(discard=40, flat=True)
for name, values in zip(truth, chain.T, strict=True):
    print(f"{name}: {values.mean():.3f} +- {values.std():.3f}, true {truth[name]}")
