"""Properties of every method: modal superposition of linear buildings, convergence for yielding
buildings, and recovery from failed steps.

Order, stability, period error and numerical damping are tested in tests/response/assessment.
"""

import numpy as np
import pytest

from building_cases import ModalDamping, model, noise, ten_bilinear
from selection import every
from step_checks import RAYLEIGH, TOO_LARGE, SingleSteps, building, superposed
from tdint import run
from tdint.kernels import layout as rows
from tdint.methods.catalogue import catalogue

METHODS = [
    *catalogue(), "bathe:gamma=0.5", "bathe:rho_inf=0.5", "kr-alpha:rho_inf=0",
    "impulse4:rho_inf=0.5", "moment4:rho_inf=0.5",
]  # fmt: skip


@pytest.mark.parametrize("damping", every(2, ["rayleigh", "modal"]))
@pytest.mark.parametrize("method", METHODS)
def test_linear_building_equals_modal_superposition(method, damping):
    case, record = building(ModalDamping((0.07,))), noise(samples=201)
    if damping == "rayleigh":
        case = model(case.stories, damping=RAYLEIGH, displacement=case.initial.displacement)
    got = run(case, record, method=method, history=True, check=False).history.displacement
    ratio = (
        (lambda omega: 0.07) if damping == "modal" else (lambda omega: 0.4 / omega + 1e-3 * omega)
    )
    want = superposed(method, case, ratio, record)
    np.testing.assert_allclose(got, want, rtol=0.0, atol=1e-9 * np.max(np.abs(want)))


@pytest.fixture(scope="module")
def average_acceleration():
    """Return the peak drifts of ten yielding stories by average acceleration with a 64th of the
    record's step."""
    return run(ten_bilinear(), noise(), method="newmark-average", dt=0.01 / 64).stories.peak_drift


@pytest.mark.parametrize(
    ("method", "parts", "bound"),
    every(
        3,
        [
            *(
                (method, (2, 16), 1e-3)
                for method in ("bathe", "bathe:gamma=0.5", "bathe:rho_inf=0.5")
            ),
            *((method, (4, 32), 1e-3) for method in ("houbolt", "park")),
            ("noh-bathe", (2, 16), 1e-3),
            *((method, (2, 16), 2e-3) for method in ("chang", "cr", "kr-alpha")),
            *((method, (2, 32), 1e-5) for method in ("rk5", "gauss4")),
        ],
    ),
)
def test_yielding_building_converges_to_average_acceleration(
    average_acceleration, method, parts, bound
):
    """With an eighth of the step, the error is less than an eighth. Model-based methods need one
    solve per step."""
    runs = [run(ten_bilinear(), noise(), method=method, dt=0.01 / part) for part in parts]
    coarse, fine = (
        np.max(np.abs(response.stories.peak_drift / average_acceleration - 1.0))
        for response in runs
    )
    assert fine < bound
    assert fine < coarse / 8.0
    assert runs[0].stories.ductility.max() > 2.0
    assert abs(runs[1].energy.error) < 0.1 * bound**0.5
    if method in ("chang", "cr", "kr-alpha"):
        assert all(response.iterations == response.steps for response in runs)


@pytest.mark.parametrize(
    ("method", "done"),
    [*((name, i) for name in ("houbolt", "park") for i in range(3)), ("gauss4", 1), ("moment4", 1)],
)
def test_failed_step_leaves_state_unchanged(method, done):
    steps, untried = SingleSteps(method), SingleSteps(method)
    for s in range(done):
        assert steps.take(s, s + 1.0) > 0
        assert untried.take(s, s + 1.0) > 0
    before = steps.memory()
    assert steps.take(TOO_LARGE, TOO_LARGE) == rows.NOT_CONVERGED
    np.testing.assert_array_equal(steps.memory(), before)
    assert steps.take(done, done + 1.0) > 0
    assert untried.take(done, done + 1.0) > 0
    np.testing.assert_allclose(steps.memory(), untried.memory(), rtol=1e-9, atol=1e-12)
