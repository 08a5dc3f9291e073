"""Examples 1 to 3 of the paper of 2022: published and recomputed errors, and independent
calculations of the same runs.

The values of example 1 were measured with another implementation of the same formulas against
DOP853 with a tolerance of 1e-13.
"""

import math
from decimal import Decimal
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import readmes
from references import smooth
from selection import every
from tdint import load_model, run
from tdint.assessment.examples import paper_examples
from tdint.assessment.examples.paper_examples import (
    DT,
    EXACT,
    METHODS,
    exact_steps,
    examples,
    gap,
    reference,
    run_example,
)
from tdint.ground_motion.record import Record
from tdint.methods.catalogue import parse
from tdint.model.definition import simple_model

CONFIGS = Path(__file__).parents[2] / "configs"
FILES = {1: "sdof-polynomial", 2: "two-story-polynomial", 3: "chain-150"}
OURS = ("impulse4", "moment4")


@cache
def runs(number, dt):
    """Return the usual runs and the runs of our own methods by method and variant. Variants are run
    only with the time step of the paper."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paper_examples, "VARIANTS", paper_examples.VARIANTS if dt == DT else {})
        done = run_example(examples()[number], dt, [*map(parse, (*METHODS, *OURS))])
        return {(result.method, result.variant): result for result in done}


def error(number, dt, method, variant="", reference="finer"):
    return runs(number, dt)[parse(method).label, variant].error("displacement", reference)


@pytest.mark.parametrize(("number", "file"), FILES.items())
def test_model_files_define_the_examples(number, file):
    example, model = examples()[number], load_model(CONFIGS / f"{file}.yaml")
    assert model.stories == example.model.stories
    assert model.excitation == example.model.excitation
    assert model.initial == example.model.initial
    assert model.damping is None
    assert model.analysis.duration == example.duration
    assert model.analysis.dt == DT


# ---- Published values


@pytest.mark.parametrize(
    ("number", "dt"), [(1, 0.001), (2, 0.001), pytest.param(3, 0.002, marks=pytest.mark.slow)]
)
@pytest.mark.long
def test_error_of_reference_of_paper(number, dt):
    """Linear acceleration with a time step of 0.001 s or 0.002 s equals a run of this method and
    differs from the exact solution by at most 5e-5 m."""
    example = examples()[number]
    history = run(
        example.model, method="newmark-linear", dt=dt, duration=example.duration, history=True
    ).history
    paper = runs(number, 0.02)["rk5", ""].paper
    assert np.array_equal(paper.displacement, history.displacement[:: round(0.02 / dt)])
    assert 1e-5 < gap(example, 0.02, EXACT, exact_steps(example, 0.02)) < 5e-5


@pytest.mark.parametrize(
    "number",
    every(2, [pytest.param(name, marks=[pytest.mark.long] * (name == 3)) for name in FILES]),
)
def test_errors_against_both_references(number):
    """The errors differ at most by the difference of the references. RK5 is closer to the exact
    solution than the reference of the paper."""
    rk5 = runs(number, 0.02)["rk5", ""]
    apart = np.max(np.abs(rk5.paper.displacement - rk5.finer.displacement))
    for method, variant in runs(number, 0.02):
        both = [error(number, 0.02, method, variant, reference) for reference in ("paper", "finer")]
        assert abs(both[0] - both[1]) <= apart
    assert error(number, 0.02, "rk5") < 0.2 * error(number, 0.02, "rk5", reference="paper")


def test_exact_steps_per_time_step_are_rounded_up():
    assert exact_steps(examples()[1], 0.02) == 20
    assert exact_steps(examples()[3], 0.02) == 10
    assert exact_steps(examples()[3], 0.0203) == 11


# ---- The reference


def test_reference_of_example_1_agrees_with_dop853():
    motion = reference(examples()[1], 0.02)

    def acceleration(t, u, v):
        return (
            500 * math.cos(25 * t) - 200 * math.sin(10 * t) - 5 * v - 200 * u - 3 * u * u
        ) / 10.0

    u, v = smooth(acceleration, 0.0, 0.0, motion.time)
    assert motion.displacement[:, 0] == pytest.approx(u, abs=5e-12)
    assert motion.velocity[:, 0] == pytest.approx(v, abs=5e-11)
    assert np.max(np.abs(motion.displacement)) == pytest.approx(0.773, abs=1e-3)


@pytest.mark.parametrize("number", FILES)
@pytest.mark.long
def test_gauss4_confirms_reference(number):
    """The implicit method gauss4 of order 4 with 1/8 of the time step has 1/4096 of its error."""
    assert gap(examples()[number], 0.02, "gauss4") < 2e-8


# ---- Errors

PUBLISHED = {
    "newmark-average": (3.35e-2, 8.88e-3, 2.23e-3), "newmark-linear": (1.92e-2, 5.04e-3, 1.27e-3),
    "central-difference": (1.98e-2, 4.81e-3, 1.20e-3), "wilson": (3.26e-2, 8.42e-3, 2.11e-3),
    "impulse": (1.77e-2, 4.72e-3, 1.19e-3), "impulse4": (2.3e-4, 1.4e-5, 8.8e-7),
    "moment4": (1.95e-5, 1.23e-6, 7.7e-8),
}  # fmt: skip


@pytest.mark.parametrize(("method", "errors"), PUBLISHED.items())
def test_errors_of_example_1(method, errors):
    digits = 0.02 if method in ("impulse4", "moment4") else 0.004
    for dt, expected in zip((0.04, 0.02, 0.01), errors, strict=True):
        assert error(1, dt, method) == pytest.approx(expected, rel=digits)


def test_errors_of_rk5_by_load_interpolation():
    """The error is 4.0e-8 with the exact load, 4.76e-3 with a load that is linear between steps,
    and 0.13 with a load that is constant in each step."""
    assert error(1, 0.02, "rk5") == pytest.approx(4.0e-8, rel=0.01)
    assert error(1, 0.02, "rk5", "load linear between the steps") == pytest.approx(
        4.76e-3, rel=1e-3
    )
    assert error(1, 0.02, "rk5", "load constant in each step") == pytest.approx(0.13, abs=0.005)


# ---- README


def digest():
    """Return method, variant and the error texts of the three examples for each row of the table in
    the methods README."""
    lines = [
        line.strip("| ").split("|")
        for line in readmes.digest("examples").splitlines()
        if "`" in line
    ]
    rows = []
    for head, *cells in lines:
        method, _, variant = head.replace("`", "").strip().partition(", ")
        rows.append((method, variant, [cell.split("/") for cell in cells]))
    return rows


@pytest.mark.long
@pytest.mark.parametrize(("method", "variant", "errors"), every(4, digest()))
def test_readme_table_agrees_with_runs(method, variant, errors):
    """The errors agree to the printed digits, so that the smallest and the largest error of each
    example are correct."""
    for number, texts in enumerate(errors, start=1):
        for text, against in zip(texts, ("paper", "finer"), strict=True):
            half_a_digit = 0.51 * 10.0 ** Decimal(text.strip()).as_tuple().exponent
            measured = error(number, 0.02, method, variant, against)
            assert measured == pytest.approx(float(text), abs=half_a_digit), (number, against)


def test_readme_table_lists_every_run():
    assert len(digest()) == len(runs(1, 0.02))


@pytest.mark.long
def test_errors_of_example_3_over_all_masses_and_of_mass_1():
    """The maximum error of all masses and the error of mass 1, which the paper draws. The values
    are from another implementation of Newmark's method, against DOP853 with a tolerance of
    1e-11."""
    expected = {
        "newmark-average": (5.351843e-3, 4.272969e-3),
        "newmark-linear": (4.321329e-3, 2.899372e-3),
        "central-difference": (4.346657e-3, 2.970660e-3),
    }
    for method, errors in expected.items():
        result = runs(3, 0.02)[method, ""]
        measured = [result.error("displacement", "finer", floor=floor) for floor in (None, 1)]
        assert measured == pytest.approx(errors, rel=1e-5), method


# ---- The variants by other routes


def test_load_linear_between_steps_equals_ground_motion():
    """A load p(t) on one mass m equals the ground motion -p / m, which every run interpolates
    linearly between samples."""
    result = runs(1, 0.02)["rk5", "load linear between the steps"]
    t = result.motion.time
    record = Record(-(500 * np.cos(25 * t) - 200 * np.sin(10 * t)) / 10.0, 0.02, "", "", "", "load")
    still = simple_model("without forces", examples()[1].model.stories)
    history = run(still, record, method="rk5", history=True).history
    assert result.motion.displacement == pytest.approx(history.displacement, abs=1e-11)
    assert result.motion.velocity == pytest.approx(history.velocity, abs=1e-10)


def test_held_load_is_constant_in_each_step():
    """The response agrees with DOP853, restarted at each step. The error of RK5 itself is 4e-8."""
    result = runs(1, 0.02)["rk5", "load constant in each step"]

    def acceleration(j):
        load = 500 * math.cos(0.5 * j) - 200 * math.sin(0.2 * j)
        return lambda t, u, v: (load - 5 * v - 200 * u - 3 * u * u) / 10.0

    u = v = 0.0
    for j in range(50):
        (_, u), (_, v) = smooth(acceleration(j), u, v, [0.0, 0.02])
        assert result.motion.displacement[j + 1, 0] == pytest.approx(u, abs=1e-7)


def test_wrong_start_is_recursion_from_two_zeros():
    """The response satisfies (m + c h/2) u1 = h^2 (p0 - f(u0)) + 2 m u0 - (m - c h/2) u(-h), with
    u(-h) = u0 = 0."""
    result = runs(1, 0.02)["central-difference", "start with u(-dt) = 0"]
    h, before, u = 0.02, 0.0, 0.0
    for t, expected in zip(result.motion.time, result.motion.displacement[:, 0], strict=True):
        assert expected == pytest.approx(u, abs=1e-11)
        load = 500 * math.cos(25 * t) - 200 * math.sin(10 * t) - 200 * u - 3 * u * u
        before, u = u, (h * h * load + 20 * u - (10 - 2.5 * h) * before) / (10 + 2.5 * h)


# ---- Runs without an end


@pytest.mark.parametrize(
    ("method", "outcome"), every(3, [("central-difference", "unstable-step"), ("exact", "refused")])
)
def test_failed_runs_have_outcome_without_error(method, outcome):
    (result, *_) = run_example(examples()[1], 0.5, [parse(method)])
    assert result.outcome == outcome
    assert math.isnan(result.error("displacement"))
