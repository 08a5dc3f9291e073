"""Equations of the paper of 2022 as printed, their misprints and the corrections.

The linear and the nonlinear step (eqs. 11 to 26, 46 to 54) are functions, in which the misprints
listed in methods/EQUATIONS are corrected. The closed forms (eqs. 33, 34, 44, 45 and 57 to 65) are
texts in the notation of the paper: `evaluate(EQUATIONS[33])` is the equation as printed, and
`evaluate(corrected(33))` has the corrections of `MISPRINTS`. No equation is taken from the program.

The unknowns of the step are the jerk j0 at the start, which is eliminated with a division by a1
(eq. 16), and u1 from k_x u1 = p_x.
"""

import re
from typing import NamedTuple

import numpy as np

BETA = 1.0 / 144.0


def step(m, c, k, h, start, impulse, end, beta=BETA):
    """Return u1, v1 and the acceleration at the end of a linear step from (u0, v0, a0) by eqs. 15
    to 23."""
    return nonlinear_step(m, c, lambda u: (k @ u, k), h, start, impulse, end, beta, iterations=1)


def nonlinear_step(m, c, law, h, start, impulse, end, beta=BETA, iterations=50):
    """Solve eqs. 46 to 54 by Newton's iteration for u1, with the tangent k_T at the end of the step
    instead of k.

    `law` gives the restoring force and its tangent at a displacement; the term k_T q of eq. 13 is
    f0 h + k_T (q - u0 h).
    """
    u0, v0, a0 = start
    force_0, _ = law(u0)
    u1 = u0
    for _ in range(iterations):
        force_1, k = law(u1)
        a1 = m * h**2 / 6.0 - k * h**4 / 24.0 + 4.0 * k * beta * h**4  # eq. 16; eq. 54 with k_T
        # Momentum equation: a1 j0 = by_u (u1 - u0) + other_terms - I, with the fourth derivative
        # from u1 (eq. 11).
        by_u = 4.0 * m / h + c + 24.0 * beta * h * k
        other_terms = (
            -m @ (4.0 * v0 + a0 * h)
            + force_0 * h
            + k @ (v0 * h**2 / 2.0 + a0 * h**3 / 6.0 - 24.0 * beta * h * (v0 * h + a0 * h**2 / 2.0))
        )
        jerk_by_u, known = np.linalg.solve(a1, by_u), np.linalg.solve(a1, other_terms - impulse)
        # Velocity and acceleration at the end: terms proportional to (u1 - u0), and other terms.
        v_u, v_known = (
            4.0 / h * np.eye(len(m)) - h**2 / 6.0 * jerk_by_u,
            -3.0 * v0 - a0 * h - h**2 / 6.0 * known,
        )
        a_u, a_known = (
            12.0 / h**2 * np.eye(len(m)) - h * jerk_by_u,
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
    """Return the amplification matrix of (u, v dt, a dt^2) of an oscillator with w = omega dt by
    eqs. 24 to 26."""
    identity = np.eye(1)
    columns = [
        step(
            identity,
            2.0 * xi * w * identity,
            w * w * identity,
            1.0,
            column[:, None],
            np.zeros(1),
            np.zeros(1),
            beta,
        )
        for column in np.eye(3)
    ]
    return np.array(columns)[:, :, 0].T


# ---- Closed forms, as texts

_D = (
    "dt^4 omega^4 - 96 beta dt^4 omega^4 + 8 dt^3 xi omega^3 - 576 beta dt^3 xi omega^3"
    " + 8 dt^2 omega^2 - 576 beta dt^2 omega^2 + 16 dt^2 xi^2 omega^2 + 48 dt xi omega + 48"
)

EQUATIONS = {
    33: "((dt^4 - 192 beta dt^4) omega^4 + (576 beta dt^2 + 16 dt^2 - 16 dt^2 xi^2) omega^2 - 48)"
    " / ((96 beta dt^3 - dt^4) omega^4 + (576 beta dt^3 xi - 8 dt^3 xi) omega^3"
    " + (576 beta dt^2 - 8 dt^2 - 16 dt^2 xi^2) omega^2 - ((-48) dt xi) omega - 48)",
    34: f"1 - xi (96 dt omega - dt^3 omega^3 (1152 beta - 16)) / ({_D})",
    44: "u - (24 u W^3 + (72 u + 12 dt v) W^2 - 144 dt v) / (W^2 + 6 W + 12)^2",
    45: "(12 u + dt v) / dt - (144 u W^3 + (864 u + 72 dt v) W^2 + (1728 u + 228 dt v) W + 1728 u)"
    " / (dt (W^2 + 6 W + 12)^2)",
    57: "-(576 beta xi dt^3 omega^3 + (-16 xi^2 + 576 beta xi dt^2 + 12) omega^2"
    " - 48 xi dt omega - 48)"
    " / (dt^4 omega^4 - 96 beta dt^4 omega^4 + 576 beta dt^3 xi omega^3"
    " - 576 beta dt^3 xi omega^3 + 8 dt^2 omega^2 - 576 beta dt^2 omega^2"
    " - 16 dt^2 xi^2 omega^2 + 48 dt xi omega + 48)",
    58: "-(xi (omega^3 (384 dt^4 - 2 dt^4) - dt^2 omega) - 48 dt + 576 beta dt^3 omega^2)"
    f" / ({_D})",
    59: "((2 dt^3 xi^2 - 2 dt^3 xi) omega^3 + (576 beta dt^4 - 3 dt^4) omega^2 - 12 dt^2)"
    " / ((288 beta dt^4 - 3 dt^4) omega^4 + (1728 beta dt^3 xi - 24 dt^3 xi) omega^3"
    " + (1728 beta dt^2 - 24 dt^2 - 48 dt^2 xi^2) omega^2 + (-144 dt xi) omega - 144)",
    60: f"8 dt omega^2 (36 beta dt^2 omega^2 - xi dt omega - 6) / (-({_D}))",
    61: "-((dt^4 - 192 beta dt^4) omega^4 + (576 beta dt^2 + 16 dt^2) omega^2 + 48 dt xi omega"
    " - 48)"
    " / ((96 beta dt^4 - dt^4) omega^4 + (576 beta dt^3 xi - 8 dt^3 xi) omega^3"
    " + (576 beta dt^2 - 8 dt^2 - 16 dt^2 xi^2) omega^2 - ((-48) dt xi) omega - 48)",
    62: "-dt^2 omega (24 xi + dt^3 omega^3 - 144 beta dt^3 omega^3 + 864 beta dt omega)"
    f" / (3 ({_D}))",
    63: "((-576 beta dt^2 - 12 dt^2) omega^4 + ((-48) dt xi) omega^3 + 48 omega^2)"
    " / ((96 beta dt^4 - dt^4) omega^4 + (576 beta dt^3 xi - 8 dt^3 xi) omega^3"
    " + (576 beta dt^2 - 8 dt^2 - 16 dt^2 xi^2) omega^2 + ((-48) dt xi) omega - 48)",
    64: "24 omega (4 dt xi^2 omega - 2 dt omega - 4 xi + 24 beta dt^3 omega^3 + dt^2 xi omega^2"
    f" + 48 beta dt^2 xi omega^2) / ({_D})",
    65: "dt^2 omega^2 (16 xi^2 - dt^2 omega^2 + 192 beta dt^2 omega^2 + 576 beta dt xi omega - 4)"
    f" / ({_D})",
}
"""Equations as printed, by number: 33 alpha_1 and 34 alpha_2 of the characteristic polynomial; 44
and 45 u1 and v1 in free vibration, W = omega dt; 57 to 65 the entries A11 to A33, row by row, of
the amplification matrix of (u, v, a)."""

ENTRIES = {57 + 3 * i + j: (i, j) for i in range(3) for j in range(3)}
"""Equations of the appendix: number -> row and column of the amplification matrix, from 0."""


class Misprint(NamedTuple):
    """Part of an equation as printed and as corrected.

    `description` describes the correction if the parts alone are unclear.
    """

    printed: str
    correct: str
    description: str = ""

    def correction(self):
        """Return the correction as methods/EQUATIONS and impulse.py list it."""
        return self.description or f"`{self.correct}` for `{self.printed}`"


_SIGN_OF_48 = Misprint("- ((-48) dt xi) omega", "+ ((-48) dt xi) omega")

MISPRINTS = {
    33: (Misprint("96 beta dt^3 - dt^4", "96 beta dt^4 - dt^4"), _SIGN_OF_48),
    45: (Misprint("228 dt v", "288 dt v"),),
    57: (
        Misprint("-16 xi^2 + 576 beta xi dt^2 + 12)", "-16 dt^2 xi^2 + 576 beta dt^2 + 12 dt^2)"),
        Misprint("+ 576 beta dt^3 xi omega^3", "+ 8 dt^3 xi omega^3"),
        Misprint("- 16 dt^2 xi^2 omega^2", "+ 16 dt^2 xi^2 omega^2"),
    ),
    58: (
        Misprint("384 dt^4 - 2 dt^4", "384 beta dt^4 - 2 dt^4"),
        Misprint("- dt^2 omega)", "- 8 dt^2 omega)"),
    ),
    59: (Misprint("2 dt^3 xi^2 - 2 dt^3 xi)", "288 beta dt^5 xi - 2 dt^5 xi)"),),
    60: (Misprint("/ (-(", "/ ((", "the opposite sign"),),
    61: (Misprint("-((dt^4 - 192", "((dt^4 - 192", "the opposite sign"), _SIGN_OF_48),
}
"""Misprints by the number of the equation; with the corrections the equations hold for any beta."""


def corrected(number):
    """Return the text of an equation with its misprints corrected."""
    text = EQUATIONS[number]
    for misprint in MISPRINTS.get(number, ()):
        assert text.count(misprint.printed) == 1, (number, misprint)
        text = text.replace(misprint.printed, misprint.correct)
    return text


def evaluate(text, **values):
    """Return the value of a text in the notation of the paper: ^ is a power, a blank between two
    factors a product."""
    product = re.sub(r"(?<=[\w)]) (?=[\w(])", " * ", text)
    return eval(product.replace("^", "**"), {"__builtins__": {}}, values)


def closed_form(text, w, xi, dt, beta=BETA):
    """Return an equation of a step dt of an oscillator, w = omega dt, from its text."""
    return evaluate(text, omega=w / dt, xi=xi, dt=dt, beta=beta)


def amplification_matrix(w, xi, dt, beta=BETA, text=corrected):
    """Return eqs. 57 to 65 for (u, v dt, a dt^2); `text` gives the text of an equation."""
    entries = np.empty((3, 3))
    for number, (i, j) in ENTRIES.items():
        entries[i, j] = closed_form(text(number), w, xi, dt, beta) * dt ** (i - j)
    return entries
