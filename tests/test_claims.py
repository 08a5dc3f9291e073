"""Sentences of the READMEs with numbers, and the paper's claims one by one: each row of the table
in methods/README is measured here, and its numbers are read from the page as digests are."""

import math
import re
import subprocess
import sys
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import readmes
from as_printed import BETA, matrix, nonlinear_step
from tdint import read_horizontals, rotated_spectrum, run
from tdint.analysis.assessment.failures import attempt, problems
from tdint.analysis.assessment.order import observed_order, order_problem
from tdint.analysis.assessment.paper_examples import DT, examples, run_example
from tdint.analysis.assessment.stability import STARTS, critical_step, overshoot, stability
from tdint.analysis.run.workspace import amplification
from tdint.methods.catalogue import parse
from tdint.model.building import assemble

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?(?![\w])")
DAMPINGS = (0.0, 0.05, 0.2, 0.9, 1.0, 3.0)
WAVES = (1e-3, 0.3, 2.0, 3.3, 5.0, 40.0, 1e3)  # omega dt
WHOLE = np.geomspace(1e-3, 1e4, 1500) / (2.0 * math.pi)


class Below(float):
    """A measure of which the page gives a bound."""


def rows():
    """Of each row of the table: where in the paper, the words on what was measured, and the
    verdict."""
    table = [
        line.strip("| ") for line in readmes.digest("claims").splitlines() if line.startswith("| ")
    ]
    lines = [
        re.split(r" *\| *", line) for line in table[1:]
    ]  # the line of dashes has no blank behind its first bar
    return {cells[0]: (cells[2], cells[4]) for cells in lines}


# ---- What is measured


def pade(w, xi, h=1.0):
    """The compiled step of impulse on (u, v) for omega h = w."""
    return amplification(parse("impulse"), np.array([w / h]), np.array([xi]), h)[0]


def at_a_tenth(method, quantity):
    return float(getattr(stability(method, np.array([0.1])), quantity)[0])


def radius_above(damping):
    return max(0.0, float(np.max(stability("impulse", WHOLE, damping).spectral_radius)) - 1.0)


def lagging_limit(xi):
    """Of the central difference with (u(t) - u(t - h)) / h as velocity."""
    return 2.0 * (math.sqrt(1.0 + xi**2) - xi)


def order_of(method, load, law="linear"):
    return observed_order(
        parse(method), order_problem(load, law, 0.5 if load == "harmonic" else math.nan, 1)
    ).order("displacement")


@cache
def errors(number):
    """Of an example, over its largest displacement, against the finer reference: by method and
    variant."""
    methods = (
        "impulse",
        "newmark-average",
        "newmark-linear",
        "central-difference",
        "rk5",
        "impulse4",
    )
    done = run_example(
        examples()[number], DT, [parse(method) for method in methods[: 6 if number < 3 else 1]]
    )
    return {(one.method.partition(":")[0], one.variant): one for one in done}


def example_error(number, method, variant="", reference="finer"):
    return errors(number)[method, variant].error("displacement", reference)


def share(number):
    """Per cent of the largest displacement that impulse is off what the paper calls exact."""
    one = errors(number)["impulse", ""]
    return 100.0 * one.error("displacement", "paper") / np.max(np.abs(one.paper.displacement))


def printed_apart(number, duration):
    """Largest difference of the displacements of impulse and the equations as printed, m."""
    model, h = examples()[number].model, DT
    building = assemble(model)
    m, c, n = np.diag(building.mass), building.damping_matrix(), building.stories
    drifts = np.eye(n) - np.eye(n, k=-1)
    linear, square = np.array([story.law.parameters[:2] for story in model.stories]).T

    def law(u):
        d = drifts @ u
        return drifts.T @ (linear * d + square * d**2), drifts.T @ (
            (linear + 2.0 * square * d)[:, None] * drifts
        )

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


def linear_apart():
    """Largest difference of the linear step as printed and the compiled one, off the root of 12."""
    largest = 0.0
    for xi in DAMPINGS:
        for w in (0.3, 2.0, 3.3, 5.0, 40.0):
            printed = matrix(w, xi)
            reduced = printed[:2, :2] + np.outer(printed[:2, 2], [-w * w, -2.0 * xi * w])
            largest = max(
                largest,
                np.max(np.abs(reduced - pade(w, xi)) / np.maximum(1.0, np.abs(pade(w, xi)))),
            )
    return largest


def quartic_apart():
    """How far eq. 12, a1 - a0 = 6 (v0 + v1) / h - 12 du / h^2, is off quartic displacements, over
    both."""
    largest = 0.0
    for draw in np.random.default_rng(12).standard_normal((50, 5)):
        u = np.polynomial.Polynomial(draw)
        h, v, a = 0.7, u.deriv(), u.deriv(2)
        off = a(h) - a(0.0) - 6.0 * (v(0.0) + v(h)) / h + 12.0 * (u(h) - u(0.0)) / h**2
        largest = max(largest, abs(off) / (abs(a(0.0)) + abs(a(h))))
    return largest


def minors(xi, w):
    """alpha_1, alpha_2, alpha_3 of the amplification matrix of (u, v, a), from its entries."""
    a = matrix(w, xi)
    second = sum(np.linalg.det(np.delete(np.delete(a, i, 0), i, 1)) for i in range(3))
    return np.trace(a) / 2.0, second, np.linalg.det(a)


def polynomial_apart():
    """How far lambda^3 - 2 alpha_1 lambda^2 + alpha_2 lambda - alpha_3 is off the one of the
    eigenvalues."""
    pairs = [(xi, w) for xi in DAMPINGS for w in (0.3, 2.0, 5.0)]
    return max(
        np.max(np.abs(np.poly(matrix(w, xi)) - np.array([1.0, -2.0 * a1, a2, -a3])))
        for xi, w in pairs
        for a1, a2, a3 in [minors(xi, w)]
    )


def spurious_root():
    """The least root of the compiled step that remembers an acceleration as well, over damping
    ratios and steps."""
    return max(
        min(abs(np.linalg.eigvals(matrix(w, xi)))) for xi in DAMPINGS for w in (0.3, 2.0, 3.3, 5.0)
    )


def principal(method, dt_over_t):
    """ln of the modulus and the angle of the principal root without damping: eqs. 38 and 39."""
    omega_h = np.array([2.0 * math.pi * dt_over_t])
    roots = np.linalg.eigvals(amplification(parse(method), omega_h, np.zeros(1), 1.0)[0])
    root = max(roots, key=lambda value: value.imag)
    return math.log(abs(root)), math.atan2(root.imag, root.real)


def eq_44(w, u, dt_v):
    return (
        u
        - (24.0 * u * w**3 + (72.0 * u + 12.0 * dt_v) * w**2 - 144.0 * dt_v)
        / (w * w + 6.0 * w + 12.0) ** 2
    )


def eq_45(w, u, dt_v, printed):
    """dt v1."""
    of_w = (
        144.0 * u * w**3
        + (864.0 * u + 72.0 * dt_v) * w**2
        + (1728.0 * u + printed * dt_v) * w
        + 1728.0 * u
    )
    return 12.0 * u + dt_v - of_w / (w * w + 6.0 * w + 12.0) ** 2


def step_for_any_damping(w, xi, u, dt_v):
    """What stands in place of eqs. 44 and 45: u1 and dt v1."""
    d = w**4 + 12.0 * xi * w**3 + (12.0 + 48.0 * xi**2) * w**2 + 144.0 * xi * w + 144.0
    even = (48.0 * xi**2 - 60.0) * w**2
    u1 = u * (w**4 - 12.0 * xi * w**3 + even + 144.0 * xi * w + 144.0) + 12.0 * dt_v * (12.0 - w**2)
    v1 = 12.0 * u * w**2 * (w**2 - 12.0) + dt_v * (
        w**4 + 12.0 * xi * w**3 + even - 144.0 * xi * w + 144.0
    )
    return u1 / d, v1 / d


def free_step_apart(expected, dampings):
    """How far u1 and dt v1 are off the compiled step, from a displacement and from a velocity, over
    steps."""
    return max(
        np.max(np.abs(np.array(expected(w, xi, u, v)) - pade(w, xi) @ np.array([u, v])))
        for xi in dampings
        for w in (1e-3, 0.3, 2.0, math.sqrt(12.0), 5.0, 40.0, 300.0)
        for u, v in ((1.0, 0.0), (0.0, 1.0))
    )


def critical_apart(printed):
    return free_step_apart(lambda w, xi, u, v: (eq_44(w, u, v), eq_45(w, u, v, printed)), [1.0])


def far(xi):
    """How far u1 and dt v1 are off their limits u and dt v + 12 u, omega dt = 1e6."""
    return np.max(np.abs(pade(1e6, xi) - np.array([[1.0, 0.0], [12.0, 1.0]])))


def powers(method, damping=0.0):
    motions = [overshoot(method, start, damping=damping) for start in STARTS]
    return [
        power for motion in motions for power in (motion.displacement_power, motion.velocity_power)
    ]


def trial(method, name, dt):
    return next(trial for trial in attempt(parse(method), problems()[name]) if trial.dt == dt)


def limits(*damping):
    methods = ("central-difference", "newmark-linear")
    return [critical_step(parse(method), ratio) for ratio in damping for method in methods]


def dispersion():
    names = (
        "impulse",
        "newmark-average",
        "newmark-linear",
        "central-difference",
        "wilson:theta=1.4",
    )
    return [at_a_tenth(name, "period_error") for name in names]


def largest_of(quantity):
    curve = getattr(stability("impulse", np.geomspace(1e-3, 0.5, 300)), quantity)
    return Below(np.max(np.abs(curve[np.isfinite(curve)])))


def cusp(damping):
    steps = np.linspace(2.0, 3.0, 1001)
    return float(steps[np.argmin(stability("wilson:theta=1.4", steps, damping).spectral_radius)])


MEASURED = {
    "Abstract, section 3.3": lambda: [
        order_of("impulse", "record"),
        order_of("impulse", "harmonic"),
        order_of("impulse", "free", "polynomial"),
    ],
    "Section 3, beta": lambda: [
        critical_step(parse(f"impulse:beta=1/{n}")) for n in (143, 145, 120)
    ],
    "Section 3, limits": lambda: [limit / (2.0 * math.pi) for limit in limits(0.0)],
    "Section 3, Wilson": lambda: [cusp(0.0), cusp(0.05)],
    "Section 3.4": lambda: [
        overshoot("newmark-average", "displacement", 0.3, law="hardening").largest[1],
        overshoot("newmark-average", "velocity", 10.0, law="softening").largest[0],
        overshoot("moment4", "velocity", 10.0, law="softening").largest[0],
    ],
    "Eqs. 11, 12": lambda: [Below(quartic_apart())],
    "Eqs. 14 to 26": lambda: [Below(linear_apart())],
    "Eqs. 15 to 23, division": lambda: [math.sqrt(1.0 / 6.0 / (1.0 / 24.0 - 4.0 * BETA))],
    "Eq. 29, appendix": lambda: [
        Below(
            max(
                abs(np.linalg.det(pade(w, xi)) * denominator(w, xi) / denominator(w, -xi) - 1.0)
                for xi in DAMPINGS[:3]
                for w in WAVES[1:6]
            )
        )
    ],
    "Eqs. 31 to 34": lambda: [Below(polynomial_apart())],
    "Eq. 35": lambda: [Below(spurious_root())],
    "Eqs. 36, 37": lambda: [
        Below(
            max(
                abs(minors(xi, w)[0] - np.trace(pade(w, xi)) / 2.0)
                for xi in DAMPINGS
                for w in (0.3, 2.0, 5.0)
            )
        )
    ],
    "Eqs. 38, 39": lambda: [principal("impulse", 0.1)[1] / (0.2 * math.pi)],
    "Eq. 40": lambda: [
        -0.5 * principal("wilson", 0.1)[0] / principal("wilson", 0.1)[1],
        at_a_tenth("wilson", "numerical_damping"),
    ],
    "Eq. 41": lambda: [
        at_a_tenth("wilson", "amplitude_decay"),
        Below(
            abs(
                at_a_tenth("wilson", "amplitude_decay")
                - 1.0
                + math.exp(
                    2.0 * math.pi * principal("wilson", 0.1)[0] / principal("wilson", 0.1)[1]
                )
            )
        ),
    ],
    "Eq. 42": lambda: [
        at_a_tenth("impulse", "period_error"),
        Below(
            abs(
                at_a_tenth("impulse", "period_error")
                - 0.2 * math.pi / principal("impulse", 0.1)[1]
                + 1.0
            )
        ),
    ],
    "Eqs. 44, 45": lambda: [
        Below(critical_apart(288.0)),
        critical_apart(228.0),
        Below(free_step_apart(step_for_any_damping, DAMPINGS)),
        Below(max(far(xi) for xi in DAMPINGS)),
    ],
    "Eqs. 46 to 54": lambda: [Below(printed_apart(1, 5.0)), Below(printed_apart(3, 1.0))],
    "Eqs. 46 to 54, energy": lambda: [
        trial("impulse", "hardening", 0.005).energy_ratio_min,
        trial("moment4", "hardening", 0.005).energy_ratio_min,
    ],
    "Example 1": lambda: (
        [
            example_error(1, name)
            for name in ("impulse", "central-difference", "newmark-average", "impulse4")
        ]
        + [example_error(1, "central-difference", "start with u(-dt) = 0")]
    ),
    "Example 2": lambda: [
        example_error(2, "rk5"),
        example_error(2, "rk5", "load held over each step"),
    ],
    "Example 3": lambda: [2.0 * math.sqrt(10.0) * math.sin(math.pi / 602.0)],
    "Conclusion 1": lambda: [Below(radius_above(0.0))],
    "Conclusion 2, impulse": lambda: [
        Below(max(radius_above(ratio) for ratio in (0.05, 0.2, 1.0)))
    ],
    "Conclusion 2, limits": lambda: [*limits(0.0), *limits(0.2), lagging_limit(0.2)],
    "Conclusion 3": dispersion,
    "Conclusion 4": lambda: [largest_of("numerical_damping")],
    "Conclusion 5": lambda: [largest_of("amplitude_decay")],
    "Conclusion 6": lambda: [
        order_of(name, "harmonic")
        for name in ("impulse", "newmark-average", "central-difference", "wilson")
    ],
    "Conclusion 7": lambda: [*powers("impulse"), *powers("impulse", 1.0)],
    "Conclusion 8": lambda: [share(number) for number in (1, 2, 3)],
    "Further study": lambda: [
        trial("impulse", "stiff-node", 0.2618).measure,
        trial("moment4:rho_inf=0", "stiff-node", 0.2618).measure,
    ],
}
"""By the first cell of a row, what its numbers are, in their order."""


ROUNDING = 1e-12


def below(*values):
    return [value < ROUNDING for value in values]


HOLDS = {
    "Abstract, section 3.3": lambda *orders: [abs(order - 4.0) < 0.05 for order in orders],
    "Section 3, beta": lambda *limits: [math.isfinite(limit) for limit in limits],
    "Section 3, limits": lambda *limits: [
        abs(limit - said) < 0.01 for limit, said in zip(limits, (0.31, 0.55), strict=True)
    ],
    "Section 3, Wilson": lambda *cusps: [
        abs(cusp - said) < 0.05 for cusp, said in zip(cusps, (2.3, 2.7), strict=True)
    ],
    "Section 3.4": lambda *largest: [most < 1.01 for most in largest[:2]],
    "Eqs. 14 to 26": below,
    "Eqs. 15 to 23, division": lambda pole: [math.isinf(pole)],
    "Eqs. 31 to 34": below,
    "Eq. 35": below,
    "Eqs. 38, 39": lambda angle: [
        abs(angle * (1.0 + at_a_tenth("impulse", "period_error")) - 1.0) < ROUNDING
    ],
    "Eq. 41": lambda decay, apart: below(apart),
    "Eq. 42": lambda elongation, apart: below(apart),
    "Eqs. 44, 45": lambda mended, printed, of_any, limits: below(mended, printed, of_any),
    "Eqs. 46 to 54, energy": lambda energy, of_moment4: [abs(energy - 1.0) < 0.02],
    "Example 1": lambda least, central, average, *others: [
        least < min(central, average),
        central > average,
    ],
    "Example 2": lambda rk5, held: [rk5 > example_error(2, "impulse")],
    "Example 3": lambda omega: [abs(omega - 0.031) < 0.0005],
    "Conclusion 1": below,
    "Conclusion 2, impulse": below,
    "Conclusion 2, limits": lambda *limits: [
        limits[2] > limits[0] + 1e-6,
        limits[3] > limits[1] + 1e-6,
    ],
    "Conclusion 3": lambda own, *others: [abs(own) < 0.1 * min(map(abs, others))],
    "Conclusion 4": below,
    "Conclusion 5": below,
    "Conclusion 6": lambda *orders: [
        abs(order - said) < 0.05 for order, said in zip(orders, (2, 2, 2, 1), strict=True)
    ],
    "Conclusion 7": lambda *powers: [power < 0.01 for power in powers],
    "Conclusion 8": lambda *shares: [share < 5.0 for share in shares],
    "Further study": lambda impulse, moment4: [impulse < 1.0],
}
"""By the first cell of a row, of which of its numbers what the paper says is true."""

MISPRINTED = {
    "Eqs. 11, 12": ("misprinted", below),
    "Eq. 29, appendix": ("wrong powers", below),
    "Eqs. 36, 37": ("misprinted", below),
    "Eq. 40": ("half of the right one", lambda printed, right: [abs(printed / right - 0.5) < 1e-3]),
    "Eqs. 46 to 54": ("misprinted", below),
}
"""By the first cell of a row, its verdict, and whether the equation holds once its misprint is
mended."""


def verdict_fits(verdict, true):
    """Whether a verdict says what is true of all, none or some of the claims of a row."""
    if not any(true):
        return verdict.startswith(("does not hold", "do not hold", "open"))
    whole = verdict.startswith("hold")
    return (
        whole
        if all(true)
        else "first holds" in verdict or (whole and re.search(" (if|but for|alone)", verdict))
    )


def denominator(w, xi):
    """Of the step's matrix, W = omega dt."""
    return w**4 + 12.0 * xi * w**3 + (12.0 + 48.0 * xi**2) * w**2 + 144.0 * xi * w + 144.0


@pytest.mark.parametrize("where", rows())
def test_a_row_of_the_claims(where):
    """Its numbers, but those in back quotes and of equations, are what is measured to the digits
    given, or bounds; its verdict follows from them."""
    words, verdict = rows()[where]
    written = NUMBER.findall(re.sub("`[^`]*`|eqs?[.] [0-9]+", "", words))
    measured = MEASURED[where]() if where in MEASURED else []
    assert len(written) == len(measured), (written, measured)
    for text, value in zip(written, measured, strict=True):
        if isinstance(value, Below):
            assert 0.0 <= abs(value) < float(text), where
            continue
        digits, _, power = text.partition("e")
        last = 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))
        assert value == pytest.approx(float(text), abs=0.51 * last), (where, text)
    if where in MISPRINTED:
        word, mended = MISPRINTED[where]
        assert verdict == word and all(mended(*measured))
    elif measured:
        assert verdict_fits(verdict, HOLDS[where](*measured)), where


def test_every_measure_has_its_row():
    assert set(MEASURED) <= set(rows())
    told = " ".join(rows())
    for number in (1, 2, 3, 4, 5, 6, 7, 8):
        assert f"Conclusion {number}" in told


# ---- What one page says of the table of another one


def page(name):
    return " ".join((readmes.ROOT / name).read_text().split())


def table_row(name, *begin):
    """Numbers of the only row of a page's tables that begins so."""
    (row,) = re.findall(
        rf"\| {re.escape(' | '.join(begin))} \|([^\n]*)", (readmes.ROOT / name).read_text()
    )
    return [float(number) for number in re.findall(r"[\d.]+(?:e-\d+)?", row)]


def said(name, pattern):
    """Numbers that a sentence of a page says, in its order."""
    (sentence,) = re.finditer(pattern, page(name))
    return [float(number) for number in sentence.groups()]


def test_how_honest_told_errors_are_as_the_first_page_says():
    text = r"In random buildings, ([\d.]+) % of the estimated drift errors are less than half"
    assert (
        said("README.md", text) == table_row("tests/README.md", "random: beyond 2 / 10 times")[:1]
    )


def test_the_default_is_the_fastest_as_often_as_the_methods_page_says():
    text = (
        r"drifts in (\d+), (\d+) and (\d+), and takes ([\d.]+), ([\d.]+) and ([\d.]+) times "
        r"the fastest"
    )
    rows_of_table = [table_row("tests/README.md", limit) for limit in ("1 %", "0.1 %", "0.01 %")]
    means, counts = zip(*[row[:2] for row in rows_of_table], strict=True)
    assert said("src/tdint/methods/README.md", text) == [*counts, *means]
    assert all(sum(row[1::2]) <= 14 for row in rows_of_table)


def test_ratios_of_the_table_of_ten_yielding_stories():
    """How many times closer, and how the error falls per halving."""
    at_step, finer = (table_row("tests/README.md", "impulse4", dt) for dt in ("0.01", "0.0025"))
    average, fine_average = (
        table_row("tests/README.md", "newmark-average", dt) for dt in ("0.01", "0.0025")
    )
    assert said("tests/README.md", r"errs (\d+) times less than average") == [
        round(average[0] / at_step[0], -2)
    ]
    assert fine_average[1] / at_step[1] == pytest.approx(30.0, rel=0.05)  # "thirty times closer"
    assert at_step[-1] < 0.5 * 4.0 * fine_average[-1]  # "in less than half of the time"
    for method in ("impulse", "bathe", "gauss4", "newmark-average"):
        coarse, fine = (table_row("tests/README.md", method, dt)[0] for dt in ("0.01", "0.0025"))
        assert 1.85 <= math.log2(coarse / fine) / 2.0 <= 2.35
    assert math.log2(at_step[0] / finer[0]) / 2.0 > 3.7
    quarter, half, whole = said(
        "tests/README.md", r"\| moment4 \| (\S+) / \S+ \| (\S+) / \S+ \| (\S+) /"
    )
    fell = said(
        "src/tdint/methods/README.md",
        r"falls (\d+) and (\d+) times per halving, that of `impulse4` (\d+)",
    )
    assert fell == [
        round(whole / half),
        round(half / quarter),
        round((at_step[0] / finer[0]) ** 0.5),
    ]


def test_what_equal_accuracy_costs_as_the_joss_paper_says():
    row = re.findall(
        r"\(([\d.]+)\)",
        re.findall(r"\| 1e-5 \|(.*)", (readmes.ROOT / "tests/README.md").read_text())[0],
    )
    assert "a twentieth of the time of the average-acceleration method" in page(
        ".github/paper/paper.md"
    )
    assert "a four-hundredth of that of OpenSeesPy" in page(".github/paper/paper.md")
    assert (float(row[4]), round(float(row[5]), -2)) == (20, 400)


def test_safe_side_of_target_displacements():
    rows_of_table = [
        table_row("configs/README.md", f"`{name}`")
        for name in ("kaikoura-frame", "three-story-concrete", "ten-story-bilinear")
    ]
    over = [100.0 * (told / row[2] - 1.0) for row in rows_of_table for told in row[:2]]
    assert said("configs/README.md", r"safe side here, by (\d+) to (\d+) %") == [
        round(min(over)),
        round(max(over)),
    ]


def test_the_error_told_with_the_models_is_that_of_the_table():
    told = said("configs/README.md", r"peak drifts of `impulse4` are off by ([\d.]+) % at most")
    assert told == [pytest.approx(100.0 * table_row("tests/README.md", "impulse4", "0.01")[1])]


def test_what_samples_miss_of_rotd50():
    pair = read_horizontals(readmes.ROOT / "records/kaikoura/WTMC.mseed", units="m/s^2")
    least, whole = (
        rotated_spectrum(pair, np.array([0.04]), percentiles=(50,), maxima=maxima).psa
        for maxima in ("samples", None)
    )
    missed = 100.0 * (1.0 - np.squeeze(least) / np.squeeze(whole))
    text = r"`--maxima samples` would miss up to (\d+) % of RotD50"
    assert said("src/tdint/analysis/spectra/README.md", text) == [
        pytest.approx(float(missed), abs=0.5)
    ]


@pytest.mark.slow
def test_the_table_of_moment4_with_parts_that_no_step_resolves():
    """By its command, L2 alone."""
    command = [sys.executable, readmes.ROOT / "tests/benchmarks/moment4.py", "stiff"]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    section = (
        (readmes.ROOT / "tests/README.md")
        .read_text()
        .partition("(`stiff`), L2:")[2]
        .partition("## ")[0]
    )
    lines = re.findall(r"^\| ([a-z]\S+) \| (\S+e-.*) \|$", section, re.MULTILINE)
    assert len(lines) == 5
    for method, numbers in lines:
        (line,) = re.findall(rf"^{re.escape(method)} +(.*)$", printed, re.MULTILINE)
        made = [float(cell.partition("/")[0]) for cell in line.split()]
        assert made == pytest.approx(
            [float(number) for number in numbers.split(" | ")], rel=0.05
        ), method
