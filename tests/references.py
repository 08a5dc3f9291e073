"""References that share no code with tdint: matrix exponentials for linear systems, and DOP853 for
smooth laws."""

from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import minimize_scalar

from tdint.model.building import assemble


def matrices(model):
    """Return dense M (vector), C and K of the initial state of a model."""
    building = assemble(model)
    return building.mass, building.damping_matrix(), building.stiffness_matrix()


def exact_linear(model, record):
    """Return the displacements at the samples, shape (samples, n), by the dense exponential of the
    motion with a linear ground acceleration."""
    m, c, k = matrices(model)
    n = m.size
    h = record.dt
    a = np.zeros((2 * n + 2, 2 * n + 2))
    a[:n, n : 2 * n] = np.eye(n)
    a[n : 2 * n, :n] = -k / m[:, None]
    a[n : 2 * n, n : 2 * n] = -c / m[:, None]
    a[n : 2 * n, 2 * n] = -1.0
    a[2 * n, 2 * n + 1] = 1.0
    step = expm(a * h)
    x = np.zeros(2 * n + 2)
    result = np.zeros((record.acceleration.size, n))
    ground = record.acceleration
    for j in range(ground.size - 1):
        x[2 * n : 2 * n + 2] = ground[j], (ground[j + 1] - ground[j]) / h
        x = step @ x
        result[j + 1] = x[:n]
    return result


def finer(record, parts):
    """Return the same motion with additional samples on the lines between its samples."""
    samples = record.acceleration.size
    times = np.arange((samples - 1) * parts + 1) / parts
    return replace(
        record,
        acceleration=np.interp(times, np.arange(samples), record.acceleration),
        dt=record.dt / parts,
    )


class OscillatorResponse:
    """Exact response of an oscillator to a motion that is linear between its samples, at any time.

    Only matrix exponentials are used: for the complete sampling interval, and for any part of it
    from its start.
    """

    def __init__(self, record, omega, xi):
        self.h, self.omega, self.xi = record.dt, omega, xi
        self.matrix = np.array(
            [
                [0.0, 1.0, 0.0, 0.0],
                [-(omega**2), -2.0 * xi * omega, -1.0, 0.0],
                [0, 0, 0, 1.0],
                [0, 0, 0, 0],
            ]
        )
        ground = record.acceleration
        step = expm(self.matrix * self.h)
        self.states = np.zeros(
            (ground.size - 1, 4)
        )  # u, v, ground and its slope at the start of each interval
        self.states[:, 2], self.states[:, 3] = ground[:-1], np.diff(ground) / self.h
        forced = self.states[:, 2:] @ step[:2, 2:].T
        x = np.zeros(2)
        for i, push in enumerate(forced):
            self.states[i, :2] = x
            x = step[:2, :2] @ x + push
        self.end = np.array([[*x, ground[-1], 0.0]])

    def at(self, part):
        """Return relative displacement, relative velocity and absolute acceleration after this part
        of each interval, shape (3, n)."""
        return self._quantities(self.states @ expm(self.matrix * (part * self.h)).T)

    def sampled(self, parts):
        """Return the maximum absolute values of the three quantities, shape (3,), at the ends of
        `parts` parts of each interval."""
        values = [np.max(np.abs(self.at(k / parts)), axis=1) for k in range(parts)]
        return np.max([*values, np.abs(self._quantities(self.end))[:, 0]], axis=0)

    def largest(self, parts=50):
        """Return the largest absolute values at any time, shape (3,), by Brent's method at the
        highest of the sampled peaks."""
        fine = np.stack(
            [np.abs(self.at(k / parts)) for k in range(parts)], axis=2
        )  # quantity, interval, part
        fine = np.append(fine.reshape(3, -1), np.abs(self._quantities(self.end)), axis=1)
        result = np.empty(3)
        for q, values in enumerate(fine):
            around = np.pad(
                values, 1, constant_values=-1.0
            )  # the first and the last interval may have an adjacent peak
            tops = np.flatnonzero((values >= around[:-2]) & (values >= around[2:]))
            tops = tops[values[tops] > 0.99 * np.max(values)]
            result[q] = max(
                [np.max(values), *(self._refined(q, top / parts, 1.0 / parts) for top in tops)]
            )
        return result

    def _refined(self, quantity, position, width):
        """Return the maximum absolute value of a quantity near a position.

        Parameters
        ----------
        quantity : int
            Row of `_quantities`.
        position, width : float
            Center and half width of the searched range, sampling intervals from the first sample.
        """

        def negative(x):
            """Return the negative absolute value after x sampling intervals."""
            i = min(int(x), len(self.states) - 1)
            state = expm(self.matrix * ((x - i) * self.h)) @ self.states[i]
            return -abs(self._quantities(state[None])[quantity, 0])

        bounds = (max(position - width, 0.0), min(position + width, len(self.states)))
        minimum = minimize_scalar(
            negative, bounds=bounds, method="bounded", options={"xatol": 1e-9}
        )
        return -minimum.fun

    def _quantities(self, states):
        """Return displacement, velocity and absolute acceleration of states, shape (3, n)."""
        u, v = states[:, 0], states[:, 1]
        return np.array([u, v, self.omega**2 * u + 2.0 * self.xi * self.omega * v])


def smooth(acceleration, u0, v0, times, rtol=1e-13, max_step=0.02):
    """Integrate u'' = acceleration(t, u, v) with DOP853.

    Parameters
    ----------
    acceleration : callable
        Function of time, displacement and velocity.
    u0, v0 : float
        Displacement and velocity at the first time.
    times : ndarray
        Times of the results, s.
    rtol, max_step : float
        Relative tolerance and maximum time step, s.

    Returns
    -------
    ndarray, shape (2, times)
        Displacement and velocity.
    """
    tolerances = {"rtol": rtol, "atol": 1e-2 * rtol, "max_step": max_step}

    def rate(t, y):
        return [y[1], acceleration(t, y[0], y[1])]

    solution = solve_ivp(
        rate, (times[0], times[-1]), [u0, v0], method="DOP853", t_eval=times, **tolerances
    )
    assert solution.success
    return solution.y


def orders(errors):
    """Return the observed orders from errors at halved steps."""
    errors = np.asarray(errors)
    return np.log2(errors[:-1] / errors[1:])


def drifts(displacement):
    """Return story drifts from floor displacements, shape (times, n)."""
    return np.diff(displacement, axis=1, prepend=0.0)
