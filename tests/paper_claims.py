"""Measured values and verdicts of the tables in methods/EQUATIONS.

`ROWS` has one entry for each row of the table, by its first cell. The values are measured on the
compiled methods; the equations of the paper come from `as_printed`.
"""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from as_printed import (
    BETA,
    ENTRIES,
    EQUATIONS,
    MISPRINTS,
    closed_form,
    corrected,
    evaluate,
    matrix,
    nonlinear_step,
)
from tdint import run
from tdint.assessment.examples.paper_examples import (
    DT,
    EQUAL_ERRORS,
    METHODS,
    examples,
    run_example,
)
from tdint.assessment.failures.failures import attempt, problems
from tdint.assessment.order.order import observed_order, order_problem
from tdint.assessment.stability.stability import STARTS, critical_step, overshoot, stability
from tdint.kernels import layout as rows
from tdint.methods.catalogue import parse
from tdint.model.building import assemble
from tdint.model.definition import Initial, simple_model
from tdint.model.story import simple_story
from tdint.model.story_laws import Law
from tdint.response.runs.measured_stability import amplification

ROUNDING = 1e-12  # differences below this are rounding
DAMPINGS = (0.0, 0.05, 0.2, 0.9, 1.0, 3.0)  # damping ratios xi
STEPS = (0.3, 2.0, 3.3, 5.0)  # W = omega dt, on both sides of the root of 12
DTS = (1.0, 0.5, 0.02)  # s; a wrong power of dt shows only where dt is not 1
# the number of the paper and another value, because the equations hold for any beta
BETAS = (BETA, 0.01)
ALL_STEPS = np.geomspace(1e-3, 1e4, 1500) / (2.0 * math.pi)  # dt/T


class Below(float):
    """Measured value for which the page states an upper bound."""


class Row(NamedTuple):
    """Measured values of a row and the claims that follow from them.

    Attributes
    ----------
    measure : callable
        Return the values in the order of the row's numbers.
    claims : callable
        Return for each statement of the paper in this row whether the values confirm it.
    verdict : str
        Verdict of a misprinted equation, empty for other rows. Its first claim is the printed form
        (None if its text is not known), the others are the corrected form.
    """

    measure: Callable[[], list[float]]
    claims: Callable[..., list[bool]]
    verdict: str = ""


def is_confirmed(row, verdict, claims):
    """Return True if a verdict fits the claims: all true, none, or some with a restriction."""
    if row.verdict:
        return verdict.startswith(row.verdict) and not claims[0] and all(claims[1:])
    if not any(claims):
        return verdict.startswith(("does not hold", "do not hold", "open"))
    if all(claims):
        return re.match("holds?($|[ ;,.])", verdict) is not None
    return bool(re.search(r"\b(first|second|last) holds|^holds? (if|for|but for|alone)", verdict))


def are_rounding(*values):
    return [abs(value) < ROUNDING for value in values]


# ---- The compiled step


def compiled_step(w, xi, h=1.0):
    """Return the compiled step of impulse on (u, v) for omega h = w."""
    return amplification(parse("impulse"), np.array([w / h]), np.array([xi]), h)[0]


@cache
def compiled_matrix(w, xi, dt, beta=BETA):
    """Return the compiled step of impulse on (u, v dt, a dt^2), with any acceleration at the start
    of the step."""
    integrator = parse(f"impulse:beta={beta!r}")
    memory = (rows.DISPLACEMENT, rows.VELOCITY, rows.ACCELERATION)
    family = replace(integrator.method.family, memory=memory)
    integrator = replace(integrator, method=replace(integrator.method, family=family))
    step = amplification(integrator, np.array([w / dt]), np.array([xi]), dt)[0]
    scale = dt ** np.arange(3.0)
    return step * scale[:, None] / scale[None, :]


def principal_minors(a):
    """Return the sum of the principal minors of order 2."""
    return sum(np.linalg.det(np.delete(np.delete(a, i, 0), i, 1)) for i in range(3))


# ---- Equations 31 to 35 and 57 to 65: closed forms and the compiled step


def compiled_value(number, w, xi, dt, beta=BETA):
    """Return what eqs. 33, 34 and 57 to 65 state, from the compiled step: half-trace, minors, or
    entry (in the scale of u, v dt, a dt^2)."""
    step = compiled_matrix(w, xi, dt, beta)
    if number == 33:
        return np.trace(step) / 2.0
    if number == 34:
        return principal_minors(step)
    return step[ENTRIES[number]]


def stated_value(number, text, w, xi, dt, beta=BETA):
    """Return the value of the text of an equation, in the same scale."""
    value = closed_form(text, w, xi, dt, beta)
    if number in ENTRIES:
        i, j = ENTRIES[number]
        value *= dt ** (i - j)
    return value


def deviation(number, text, beta=BETA, dampings=DAMPINGS, dts=DTS):
    """Return the largest deviation of an equation from the compiled step, over the larger of 1 and
    the entry."""
    largest = 0.0
    for xi, w, dt in product(dampings, STEPS, dts):
        expected = compiled_value(number, w, xi, dt, beta)
        error = abs(stated_value(number, text, w, xi, dt, beta) - expected)
        largest = max(largest, error / max(1.0, abs(expected)))
    return largest


def corrected_deviation(*numbers):
    """Return the largest deviation of corrected equations for the beta of the paper and another
    value."""
    return max(deviation(number, corrected(number), beta) for number in numbers for beta in BETAS)


def printed_deviation(number, **grid):
    return deviation(number, EQUATIONS[number], **grid)


def entry_row(number, *examples):
    """Return the row of a misprinted entry of the appendix.

    The values are the entry as printed and of the compiled step for each example (xi, W, dt), and
    the deviation of the corrected equation.
    """

    def measure():
        values = []
        for xi, w, dt in examples:
            values.append(stated_value(number, EQUATIONS[number], w, xi, dt))
            values.append(compiled_value(number, w, xi, dt))
        return [*values, Below(corrected_deviation(number))]

    return Row(
        measure,
        lambda *values: [printed_deviation(number) < ROUNDING, values[-1] < ROUNDING],
        "misprinted",
    )


def polynomial_residual():
    """Return the largest value of the polynomial of eq. 31 at the roots of the compiled step, with
    alpha_1 and alpha_2 from eqs. 33 (corrected) and 34, and alpha_3 = 0."""
    largest = 0.0
    for xi, w, dt in product(DAMPINGS, STEPS, DTS):
        half_trace = closed_form(corrected(33), w, xi, dt)
        minors = closed_form(corrected(34), w, xi, dt)
        roots = [0.0, *np.linalg.eigvals(compiled_step(w, xi, dt))]
        for root in roots:
            largest = max(largest, abs(root**3 - 2.0 * half_trace * root**2 + minors * root))
    return largest


def spurious_root():
    """Return the largest modulus of the third root of the compiled step with an acceleration of its
    own."""
    grid = product(DAMPINGS, STEPS, DTS)
    return max(min(abs(np.linalg.eigvals(compiled_matrix(w, xi, dt)))) for xi, w, dt in grid)


def denominator(w, xi):
    """Return the denominator of the step's matrix, times 3, for beta = 1/144."""
    return w**4 + 12.0 * xi * w**3 + (12.0 + 48.0 * xi**2) * w**2 + 144.0 * xi * w + 144.0


def determinant_deviation():
    """Return the deviation of the determinant of the compiled step from denominator(-xi) /
    denominator(xi)."""
    return max(
        abs(np.linalg.det(compiled_step(w, xi)) * denominator(w, xi) / denominator(w, -xi) - 1.0)
        for xi in DAMPINGS[:3]
        for w in (0.3, 2.0, 3.3, 5.0, 40.0)
    )


# ---- Linear and nonlinear step: eqs. 11 to 26 and 46 to 54


def kinematics_deviation(factor):
    """Return the deviation of eq. 12, a1 - a0 = 6 (v0 + v1) / h - factor du / h^2, from quartic
    displacements, relative to both accelerations."""
    largest = 0.0
    for coefficients in np.random.default_rng(12).standard_normal((50, 5)):
        u = np.polynomial.Polynomial(coefficients)
        h, v, a = 0.7, u.deriv(), u.deriv(2)
        residual = a(h) - a(0.0) - 6.0 * (v(0.0) + v(h)) / h + factor * (u(h) - u(0.0)) / h**2
        largest = max(largest, abs(residual) / (abs(a(0.0)) + abs(a(h))))
    return largest


def linear_deviation(steps=(*STEPS, 40.0)):
    """Return the largest difference of the linear step as printed and the compiled one."""
    largest = 0.0
    for xi, w in product(DAMPINGS, steps):
        printed = matrix(w, xi)
        reduced = printed[:2, :2] + np.outer(printed[:2, 2], [-w * w, -2.0 * xi * w])
        compiled = compiled_step(w, xi)
        error = np.max(np.abs(reduced - compiled) / np.maximum(1.0, np.abs(compiled)))
        largest = max(largest, error)
    return largest


def nonlinear_deviation(number, duration):
    """Return the largest difference of the displacements of impulse and the equations as printed
    in an example, m."""
    model, h = examples()[number].model, DT
    building = assemble(model)
    m, c, n = np.diag(building.mass), building.damping_matrix(), building.stories
    drifts = np.eye(n) - np.eye(n, k=-1)
    linear, square = np.array([story.law.parameters[:2] for story in model.stories]).T

    def law(u):
        d = drifts @ u
        tangent = drifts.T @ ((linear + 2.0 * square * d)[:, None] * drifts)
        return drifts.T @ (linear * d + square * d**2), tangent

    loads = np.zeros((round(duration / h) + 1, n))
    for force in model.excitation.forces:
        angle = force.omega * h * np.arange(len(loads))
        loads[:, force.floor - 1] += force.cosine * np.cos(angle) + force.sine * np.sin(angle)
    state = np.zeros(n), np.zeros(n), np.linalg.solve(m, loads[0])
    motion = [state[0]]
    for p0, p1 in pairwise(loads):
        state = nonlinear_step(m, c, law, h, state, 0.5 * h * (p0 + p1), p1)
        motion.append(state[0])
    history = run(model, method="impulse", dt=h, duration=duration, history=True).history
    return np.max(np.abs(np.array(motion) - history.displacement))


# ---- Roots and motion of an oscillator: eqs. 38 to 42, sections 3.1 and 3.2


def principal_root(method, dt_over_t, damping=0.0):
    """Return the principal root of the compiled step: positive imaginary part, or the larger
    modulus of real roots."""
    omega_h = np.array([2.0 * math.pi * dt_over_t])
    matrices = amplification(parse(method), omega_h, np.array([damping]), 1.0)
    roots = np.linalg.eigvals(matrices[0]).astype(complex)
    return max(roots, key=lambda root: (round(abs(root), 9), root.imag))


@cache
def motion_root(method, dt_over_t=0.1, steps=300):
    """Return modulus and angle of the root with which a computed free vibration continues.

    The displacements satisfy u(n + 1) = s u(n) - p u(n - 1); both numbers follow by least squares
    from the second half of a run, where spurious roots have decayed.
    """
    omega = 2.0 * math.pi
    story = simple_story(1.0, Law("linear", ()), stiffness=omega**2)
    model = replace(
        simple_model("oscillator", [story]), initial=Initial(displacement=(1.0,), velocity=(0.0,))
    )
    history = run(
        model, method=method, dt=dt_over_t, duration=steps * dt_over_t, history=True, check=False
    ).history
    u = history.displacement[steps // 2 :, 0]
    (s, minus_p), *_ = np.linalg.lstsq(np.column_stack([u[1:-1], u[:-2]]), u[2:], rcond=None)
    modulus = math.sqrt(-minus_p)
    return modulus, math.acos(s / (2.0 * modulus))


def at_a_tenth(method, quantity):
    """Return a quantity of `tdint stability` at dt/T = 0.1 without damping."""
    return float(getattr(stability(method, np.array([0.1])), quantity)[0])


def printed_damping():
    """Return the numerical damping of Wilson's method at dt/T = 0.1 by eq. 40 as printed."""
    modulus, angle = motion_root("wilson")
    return -math.log(modulus) / (2.0 * angle)


def decay_difference():
    """Return the amplitude decay of Wilson's method less eq. 41."""
    modulus, angle = motion_root("wilson")
    return at_a_tenth("wilson", "amplitude_decay") - 1.0 + modulus ** (2.0 * math.pi / angle)


def elongation_difference():
    """Return the period elongation of impulse less eq. 42."""
    _, angle = motion_root("impulse")
    return at_a_tenth("impulse", "period_error") - (0.2 * math.pi - angle) / angle


def pade_angle(w):
    """Return the angle of the (2,2) Pade approximation of exp(i w)."""
    return 2.0 * math.atan2(0.5 * w, 1.0 - w * w / 12.0)


def damping_by_eq_40(method, dt_over_t):
    """Return -ln(modulus) / angle of the principal root, which is also defined above a limit."""
    root = principal_root(method, dt_over_t)
    return -math.log(abs(root)) / abs(np.angle(root))


def largest_of(quantity, method="impulse"):
    """Return the largest value of a quantity of `tdint stability` up to dt/T = 0.5."""
    curve = getattr(stability(method, np.geomspace(1e-3, 0.5, 300)), quantity)
    return Below(np.max(np.abs(curve[np.isfinite(curve)])))


def radius_excess(*dampings):
    """Return the maximum excess of the spectral radius of impulse over 1 for all steps."""
    radii = [stability("impulse", ALL_STEPS, damping).spectral_radius for damping in dampings]
    return Below(max(0.0, float(np.max(radii)) - 1.0))


def damped_radii():
    """Return spectral radii at dt/T = 0.05 with a damping ratio of 5 %: the paper's five."""
    names = ("impulse", "newmark-average", "newmark-linear", "central-difference", "wilson")
    return [float(stability(name, np.array([0.05]), 0.05).spectral_radius[0]) for name in names]


def limits(*dampings):
    """Return the largest stable omega dt of central difference and linear acceleration."""
    methods = ("central-difference", "newmark-linear")
    return [critical_step(parse(method), ratio) for ratio in dampings for method in methods]


def lagging_limit(xi):
    """Return the limit of the central difference with the velocity (u(t) - u(t - h)) / h."""
    return 2.0 * (math.sqrt(1.0 + xi**2) - xi)


def cusp(damping):
    """Return dt/T of the minimum spectral radius of Wilson's method."""
    steps = np.linspace(2.0, 3.0, 1001)
    return float(steps[np.argmin(stability("wilson:theta=1.4", steps, damping).spectral_radius)])


def dispersion():
    """Return period errors at dt/T = 0.1."""
    others = ("newmark-average", "newmark-linear", "central-difference", "wilson:theta=1.4")
    return [at_a_tenth(name, "period_error") for name in ("impulse", *others)]


# ---- Order: section 3.3 and eq. 43


@cache
def observed(method, load, law="linear"):
    ratio = 0.5 if load == "harmonic" else math.nan
    return observed_order(parse(method), order_problem(load, law, ratio, 1))


def order_of(method, load, law="linear"):
    return observed(method, load, law).order("displacement")


def regression():
    """Return alpha and gamma of eq. 43 for impulse under a record, and the misfit of the three
    smallest errors in percent."""
    measured = observed("impulse", "record")
    clear = measured.displacement > 3e-12  # smaller errors are rounding
    steps, errors = measured.steps[clear][-3:], measured.displacement[clear][-3:]
    alpha, logarithm = np.polyfit(np.log(steps), np.log(errors), 1)  # the period is 1 s
    gamma = math.exp(logarithm)
    misfit = 100.0 * np.max(np.abs(errors / (gamma * steps**alpha) - 1.0))
    return [alpha, gamma, Below(misfit)]


# ---- Overshoot: section 3.4, eqs. 44 and 45

START_PAIRS = ((1.0, 0.0), (0.0, 1.0))  # u and dt v at the start


def free_step_deviation(expected, dampings):
    """Return the deviation of a formula for u1 and dt v1 from the compiled step, for an initial
    displacement and an initial velocity."""
    return max(
        np.max(np.abs(np.array(expected(w, xi, u, v)) - compiled_step(w, xi) @ np.array([u, v])))
        for xi in dampings
        for w in (1e-3, 0.3, 2.0, math.sqrt(12.0), 5.0, 40.0, 300.0)
        for u, v in START_PAIRS
    )


def critical_deviation(second, dt=0.5):
    """Return the deviation of eq. 44 and a text of eq. 45 from the compiled step at xi = 1."""

    def expected(w, xi, u, v):
        values = {"u": u, "v": v / dt, "W": w, "dt": dt}
        return evaluate(EQUATIONS[44], **values), dt * evaluate(second, **values)

    return free_step_deviation(expected, [1.0])


def step_for_any_damping(w, xi, u, v):
    """Return u1 and dt v1 from u and v = dt v0: eqs. 44 and 45 for any damping ratio."""
    even = (48.0 * xi**2 - 60.0) * w**2
    factor_u = w**4 - 12.0 * xi * w**3 + even + 144.0 * xi * w + 144.0
    factor_v = w**4 + 12.0 * xi * w**3 + even - 144.0 * xi * w + 144.0
    u1 = u * factor_u + 12.0 * v * (12.0 - w**2)
    v1 = 12.0 * u * w**2 * (w**2 - 12.0) + v * factor_v
    return u1 / denominator(w, xi), v1 / denominator(w, xi)


def distance_from_limit(w, xi):
    """Return the distance of u1 and dt v1 from their limits u and dt v + 12 u for large W."""
    return np.max(np.abs(compiled_step(w, xi) - np.array([[1.0, 0.0], [12.0, 1.0]])))


def approach(xi):
    """Return the power of W at which the compiled step approaches this limit."""
    near, far = (distance_from_limit(w, xi) for w in (1e4, 1e5))
    return math.log10(far / near)


def powers(method, damping=0.0):
    """Return powers of W in the first step: u and dt v from a displacement, then from a
    velocity."""
    motions = [overshoot(method, start, damping=damping) for start in STARTS]
    pairs = [(motion.displacement_power, motion.velocity_power) for motion in motions]
    return [power for pair in pairs for power in pair]


def nonlinear_overshoot():
    """Return the maximum velocity of average acceleration (hardening), its maximum displacement
    (softening), and the maximum displacement of moment4 (softening), relative to the exact
    values."""
    hardening = overshoot("newmark-average", "displacement", 0.3, law="hardening")
    softening = overshoot("newmark-average", "velocity", 10.0, law="softening")
    conserving = overshoot("moment4", "velocity", 10.0, law="softening")
    return [hardening.largest[1], softening.largest[0], conserving.largest[0]]


# ---- Examples and failures


@cache
def errors(number):
    """Return the runs of an example by method and variant."""
    methods = [parse(method) for method in (*METHODS, "impulse4")]
    runs = run_example(examples()[number], DT, methods)
    return {(run.method.partition(":")[0], run.variant): run for run in runs}


def example_error(number, method, variant="", reference="finer", norm="maximum", floor=None):
    """Return a norm of the error of the displacement in an example, m."""
    return errors(number)[method, variant].error("displacement", reference, norm, floor)


def relative_error(number):
    """Return the error of impulse relative to the solution that the paper calls exact, in percent
    of the maximum displacement."""
    result = errors(number)["impulse", ""]
    return 100.0 * result.error("displacement", "paper") / np.max(np.abs(result.paper.displacement))


def failure(method, name, dt):
    """Return the attempt of a method on a problem of `tdint failures`."""
    return next(trial for trial in attempt(parse(method), problems()[name]) if trial.dt == dt)


UNSTABLE_DT = (0.4, 0.6)  # dt/T above the limits of central difference and linear acceleration

ROWS = {
    "Conclusion 1": Row(lambda: [radius_excess(0.0)], are_rounding),
    "Section 3, beta": Row(
        lambda: [critical_step(parse(f"impulse:beta=1/{n}")) for n in (143, 145, 120)],
        lambda *steps: [math.isfinite(step) for step in steps],
    ),
    "Conclusion 2, impulse": Row(lambda: [radius_excess(0.05, 0.2, 1.0)], are_rounding),
    "Conclusion 2, limits": Row(
        lambda: [*limits(0.0), *limits(0.2), lagging_limit(0.2)],
        lambda *values: [values[2] > values[0] + 1e-6, values[3] > values[1] + 1e-6],
    ),
    "Section 3.1, damping": Row(
        lambda: [*damped_radii(), *limits(0.05)],
        lambda *values: [
            max(values[:5]) < 1.0,
            *(abs(values[5 + i] - limits(0.0)[i]) < 1e-6 for i in (0, 1)),
        ],
    ),
    "Section 3, limits": Row(
        lambda: [limit / (2.0 * math.pi) for limit in limits(0.0)],
        lambda *values: [abs(values[0] - 0.31) < 0.01, abs(values[1] - 0.55) < 0.01],
    ),
    "Section 3, Wilson": Row(
        lambda: [cusp(0.0), cusp(0.05)],
        lambda *values: [abs(values[0] - 2.3) < 0.05, abs(values[1] - 2.7) < 0.05],
    ),
    "Conclusion 3": Row(dispersion, lambda own, *others: [abs(own) < 0.1 * min(map(abs, others))]),
    "Section 3.2, damping": Row(
        lambda: [
            Below(
                max(
                    largest_of("numerical_damping", method)
                    for method in ("impulse", "newmark-average")
                )
            ),
            at_a_tenth("wilson", "numerical_damping"),
            *(
                damping_by_eq_40(method, dt_over_t)
                for method, dt_over_t in zip(
                    ("central-difference", "newmark-linear"), UNSTABLE_DT, strict=True
                )
            ),
            Below(
                max(
                    abs(damping_by_eq_40(method, 0.3))
                    for method in ("central-difference", "newmark-linear")
                )
            ),
        ],
        lambda none, wilson, central, linear, below_limits: [
            none < ROUNDING,
            wilson > 0.0,
            central < 0.0,
            abs(linear) > 0.01,
            below_limits < ROUNDING,
        ],
    ),
    "Conclusion 4": Row(lambda: [largest_of("numerical_damping")], are_rounding),
    "Conclusion 5": Row(lambda: [largest_of("amplitude_decay")], are_rounding),
    "Abstract, section 3.3": Row(
        lambda: [
            order_of("impulse", "record"),
            order_of("impulse", "harmonic"),
            order_of("impulse", "free", "polynomial"),
        ],
        lambda *orders: [abs(order - 4.0) < 0.05 for order in orders],
    ),
    "Eq. 43": Row(
        regression,
        lambda alpha, gamma, misfit: [
            abs(alpha - order_of("impulse", "record")) < ROUNDING,
            misfit < 0.1,
        ],
    ),
    "Conclusion 6": Row(
        lambda: [
            order_of(name, "harmonic")
            for name in ("impulse", "newmark-average", "central-difference", "wilson")
        ],
        lambda *orders: [
            abs(order - stated) < 0.05 for order, stated in zip(orders, (2, 2, 2, 1), strict=True)
        ],
    ),
    "Conclusion 7": Row(
        lambda: [*powers("impulse"), *powers("impulse", 1.0)],
        lambda *values: [power < 0.01 for power in values],
    ),
    "Section 3.4, linear": Row(
        lambda: powers("newmark-average"), lambda *values: [power < 0.01 for power in values]
    ),
    "Section 3.4, nonlinear": Row(
        nonlinear_overshoot,
        lambda velocity, displacement, conserving: [displacement < 1.01, velocity > 1.01],
    ),
    "Section 3.4, Wilson": Row(
        lambda: powers("wilson")[:2],
        lambda displacement, velocity: [abs(displacement - 2.0) < 0.01, abs(velocity - 2.0) < 0.01],
    ),
    "Section 3.4, criterion": Row(
        lambda: [approach(1.0), approach(0.2)], lambda *values: [power < 0.0 for power in values]
    ),
    "Conclusion 8": Row(
        lambda: [relative_error(number) for number in (1, 2, 3)],
        lambda *values: [value < 5.0 for value in values],
    ),
    "Further study": Row(
        lambda: [
            failure("impulse", "stiff-node", 0.2618).measure,
            failure("moment4:rho_inf=0", "stiff-node", 0.2618).measure,
        ],
        lambda impulse, moment4: [impulse < 1.0],
    ),
    "Eqs. 11, 12": Row(
        lambda: [Below(kinematics_deviation(12.0))],
        lambda mended: [kinematics_deviation(2.0) < ROUNDING, mended < ROUNDING],
        "misprinted",
    ),
    "Eqs. 13 to 26": Row(lambda: [Below(linear_deviation())], are_rounding),
    "Eqs. 15 to 23, division": Row(
        lambda: [math.sqrt(1.0 / 6.0 / (1.0 / 24.0 - 4.0 * BETA))],
        lambda pole: [linear_deviation([pole * (1.0 + 1e-9)]) < 1e-9],
    ),
    "Eq. 29": Row(
        lambda: [Below(determinant_deviation())],
        lambda mended: [None, mended < ROUNDING],
        "wrong powers",
    ),
    "Eqs. 31, 32": Row(lambda: [Below(polynomial_residual())], are_rounding),
    "Eq. 33": entry_row(33, (0.2, 2.0, 1.0), (0.0, 5.0, 0.5)),
    "Eq. 34": Row(lambda: [Below(corrected_deviation(34))], are_rounding),
    "Eq. 35": Row(lambda: [Below(spurious_root())], are_rounding),
    "Eqs. 36, 37": Row(
        lambda: [
            Below(
                max(
                    abs(np.trace(compiled_matrix(w, xi, 1.0)) - np.trace(compiled_step(w, xi)))
                    for xi, w in product(DAMPINGS, STEPS)
                )
            )
        ],
        lambda mended: [None, mended < ROUNDING],
        "misprinted",
    ),
    "Eqs. 38, 39": Row(
        lambda: [np.angle(principal_root("impulse", 0.1)) / (0.2 * math.pi)],
        lambda angle: are_rounding(
            angle - pade_angle(0.2 * math.pi) / (0.2 * math.pi),
            abs(principal_root("impulse", 0.1)) - 1.0,
        ),
    ),
    "Eq. 40": Row(
        lambda: [printed_damping(), at_a_tenth("wilson", "numerical_damping")],
        lambda printed, right: [
            abs(printed / right - 1.0) < 1e-3,
            abs(2.0 * printed / right - 1.0) < 1e-3,
        ],
        "half of the correct value",
    ),
    "Eq. 41": Row(
        lambda: [at_a_tenth("wilson", "amplitude_decay"), Below(abs(decay_difference()))],
        lambda decay, difference: are_rounding(difference),
    ),
    "Eq. 42": Row(
        lambda: [at_a_tenth("impulse", "period_error"), Below(abs(elongation_difference()))],
        lambda elongation, difference: are_rounding(difference),
    ),
    "Eqs. 44, 45": Row(
        lambda: [
            Below(critical_deviation(corrected(45))),
            critical_deviation(EQUATIONS[45]),
            Below(free_step_deviation(step_for_any_damping, DAMPINGS)),
            Below(max(distance_from_limit(1e6, xi) for xi in DAMPINGS)),
        ],
        lambda corrected, printed, for_any_beta, limit: are_rounding(
            corrected, printed, for_any_beta
        ),
    ),
    "Eqs. 46 to 54": Row(
        lambda: [Below(nonlinear_deviation(1, 5.0)), Below(nonlinear_deviation(3, 1.0))],
        lambda *mended: [None, *are_rounding(*mended)],
        "misprinted",
    ),
    "Eqs. 46 to 54, energy": Row(
        lambda: [
            failure(method, "hardening", 0.005).energy_ratio_min
            for method in ("impulse", "moment4")
        ],
        lambda energy, moment4_ratio: [abs(energy - 1.0) < 0.02],
    ),
    "Eq. 57 (A11)": entry_row(57, (0.2, 2.0, 1.0), (0.0, 2.0, 0.5)),
    "Eq. 58 (A12)": entry_row(58, (0.2, 2.0, 1.0)),
    "Eq. 59 (A13)": entry_row(59, (0.2, 2.0, 1.0), (0.2, 2.0, 0.5)),
    "Eq. 60 (A21)": entry_row(60, (0.0, 2.0, 1.0)),
    "Eq. 61 (A22)": entry_row(61, (0.0, 2.0, 1.0), (0.2, 2.0, 1.0)),
    "Eqs. 62 to 65 (A23, A31 to A33)": Row(
        lambda: [Below(corrected_deviation(62, 63, 64, 65))], are_rounding
    ),
    "Example 1": Row(
        lambda: [
            *(
                example_error(1, name)
                for name in ("impulse", "central-difference", "newmark-average", "impulse4")
            ),
            example_error(1, "central-difference", "start with u(-dt) = 0"),
            *(
                example_error(1, name, norm=norm)
                for norm in ("rms", "mean")
                for name in ("impulse", "central-difference")
            ),
        ],
        # Errors that differ by less than 5 % are equal.
        lambda least, central, average, *others: [
            (1.0 + EQUAL_ERRORS) * least < min(central, average),
            central > average,
        ],
    ),
    "Example 2": Row(
        lambda: [example_error(2, "rk5"), example_error(2, "rk5", "load constant in each step")],
        lambda rk5, held: [rk5 > example_error(2, "impulse")],
    ),
    "Example 3": Row(
        lambda: [2.0 * math.sqrt(10.0) * math.sin(math.pi / 602.0)],
        lambda omega: [abs(omega - 0.031) < 0.0005],
    ),
    "Example 3, ranking": Row(
        lambda: [
            example_error(3, name, floor=floor)
            for floor in (None, 1)
            for name in ("rk5", "newmark-average", "u0v0", "central-difference", "wilson")
        ],
        lambda rk5, average, u0v0, central, wilson, *first_mass: [
            rk5 < min(central, wilson),
            max(average, u0v0) < min(central, wilson),
        ],
    ),
}
"""Rows of the table by their first cell, in its order."""

assert set(MISPRINTS) <= set(EQUATIONS)
