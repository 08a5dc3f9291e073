"""The step of the paper of 2022 coded as its equations stand, but for the misprints that
methods/README lists.

Unknowns as there: the jerk j0 at the start, eliminated with a division by a1 (eq. 16), then k_x u1
= p_x. Written from eqs. 11 to 14 with a matrix for each of m, c, k; nothing is taken from the
program.
"""

import numpy as np

BETA = 1.0 / 144.0


def step(m, c, k, h, start, impulse, end, beta=BETA):
    """Eqs. 15 to 23: u1, v1 and the acceleration at the end of a linear step from (u0, v0, a0)."""
    return nonlinear_step(m, c, lambda u: (k @ u, k), h, start, impulse, end, beta, iterations=1)


def nonlinear_step(m, c, law, h, start, impulse, end, beta=BETA, iterations=50):
    """Eqs. 46 to 54: Newton's iteration for u1, with the tangent k_T at the step's end in place of
    k.

    `law` gives the restoring force and its tangent at a displacement; k_T q of eq. 13 is f0 h + k_T
    (q - u0 h).
    """
    u0, v0, a0 = start
    force_0, _ = law(u0)
    u1 = u0
    for _ in range(iterations):
        force_1, k = law(u1)
        a1 = m * h**2 / 6.0 - k * h**4 / 24.0 + 4.0 * k * beta * h**4  # eq. 16; eq. 54 with k_T
        # The momentum's row: a1 j0 = by_u (u1 - u0) + rest - I, with the fourth derivative from u1
        # (eq. 11).
        by_u = 4.0 * m / h + c + 24.0 * beta * h * k
        rest = (
            -m @ (4.0 * v0 + a0 * h)
            + force_0 * h
            + k @ (v0 * h**2 / 2.0 + a0 * h**3 / 6.0 - 24.0 * beta * h * (v0 * h + a0 * h**2 / 2.0))
        )
        of_u, known = np.linalg.solve(a1, by_u), np.linalg.solve(a1, rest - impulse)
        # Velocity and acceleration at the end: parts in (u1 - u0), and the others.
        v_u, v_known = (
            4.0 / h * np.eye(len(m)) - h**2 / 6.0 * of_u,
            -3.0 * v0 - a0 * h - h**2 / 6.0 * known,
        )
        a_u, a_known = (
            12.0 / h**2 * np.eye(len(m)) - h * of_u,
            -12.0 / h * v0 - 5.0 * a0 - h * known,
        )
        k_x = m @ a_u + c @ v_u + k
        p_x = end - m @ a_known - c @ v_known - (force_1 - k @ (u1 - u0))
        new = u0 + np.linalg.solve(k_x, p_x)
        done = np.max(np.abs(new - u1)) <= 1e-15 * np.max(np.abs(new))
        u1 = new
        if done:
            break
    return u1, v_u @ (u1 - u0) + v_known, a_u @ (u1 - u0) + a_known


def matrix(w, xi, beta=BETA):
    """Eqs. 24 to 26: the amplification matrix of (u, v dt, a dt^2) of an oscillator, w = omega
    dt."""
    one = np.eye(1)
    columns = [
        step(
            one,
            2.0 * xi * w * one,
            w * w * one,
            1.0,
            column[:, None],
            np.zeros(1),
            np.zeros(1),
            beta,
        )
        for column in np.eye(3)
    ]
    return np.array(columns)[:, :, 0].T
