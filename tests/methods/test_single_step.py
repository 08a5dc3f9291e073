"""Tests of the roots at infinity of the single-step methods. The output of `tdint methods` must not
depend on the computation of the roots."""

import numpy as np
import pytest

from tdint.methods import single_step
from tdint.methods.catalogue import parse
from tdint.methods.single_step import collocation, collocation_theta, u0


@pytest.fixture(
    params=[
        "as installed",
        "always complex",
        "roots that meet parted off the axis",
        "along the axis",
    ]
)
def eigenvalues(request, monkeypatch):
    """Return the roots of numpy's eigvals in the orders of several versions of numpy and LAPACK."""
    original = np.linalg.eigvals

    def eigvals(matrix):
        roots = np.asarray(original(matrix))
        if request.param == "always complex":
            return roots.astype(np.complex128)
        if request.param != "as installed":
            roots = roots.astype(np.complex128)
            gaps = [(abs(roots[i] - roots[j]), i, j) for i in range(3) for j in range(i)]
            gap, i, j = min(gaps)
            if gap < 1e-6:
                step = 2e-8j if "off" in request.param else 2e-8
                middle = 0.5 * (roots[i] + roots[j])
                roots[i], roots[j] = middle + step, middle - step
        return roots

    monkeypatch.setattr(np.linalg, "eigvals", eigvals)


@pytest.mark.parametrize(
    ("beta", "theta"), [(0.24, 1.021712), (0.20, 1.159772), (1 / 6, 1.420815), (0.25, 1.0)]
)
def test_theta_of_optimal_collocation(eigenvalues, beta, theta):
    """Hilber and Hughes (1978) state the values for beta = 0.24 and 0.20; for beta = 1/4, the roots
    coincide at theta = 1."""
    assert collocation_theta(beta) == pytest.approx(theta, abs=5e-7)


def test_collocation_uses_optimal_theta(eigenvalues):
    method = parse("collocation")
    assert format(method.values[1], ".12g") == "1.02171163635"
    assert method.stability_limit == np.inf


@pytest.mark.parametrize("beta", [0.17, 0.2, 0.22, 0.24, 0.2499])
def test_roots_coincide_at_optimal_theta(beta):
    """The roots are real just below this theta and complex conjugate just above it."""
    theta = collocation_theta(beta)
    for factor, meet in ((1.0 - 1e-6, False), (1.0 + 1e-6, True)):
        matrix = single_step._amplification_at_infinity(collocation(beta, theta * factor))
        assert (np.max(np.abs(np.linalg.eigvals(matrix).imag)) > 1e-9) == meet


@pytest.mark.parametrize(
    ("method", "rho_inf"),
    [
        ("newmark", 1.0),
        ("newmark-average", 1.0),
        ("collocation", 0.995811763376115),
        ("wilson", 0.778442220092468),
    ],
)
def test_spectral_radius_at_infinity(eigenvalues, method, rho_inf):
    assert parse(method).rho_inf == pytest.approx(rho_inf, rel=1e-13)


@pytest.mark.parametrize("r", [0.0, 0.3, 0.99, 0.9999, 0.99999, 0.999999, 1.0])
def test_spectral_radius_of_u0v0_is_exactly_1(r):
    """The eigenvalues at infinite frequency are -1, -r and -r. The coefficients of the
    characteristic polynomial confirm them; unlike computed eigenvalues, they are accurate if all
    eigenvalues are nearly equal."""
    assert parse(f"u0v0:r={r!r}").rho_inf == 1.0
    matrix = single_step._amplification_at_infinity(u0(1.0, r, r))
    sum_of_minors = 0.5 * (np.trace(matrix) ** 2 - np.trace(matrix @ matrix))
    assert np.trace(matrix) == pytest.approx(-(1.0 + 2.0 * r), abs=1e-14)
    assert sum_of_minors == pytest.approx(r * r + 2.0 * r, abs=1e-13)
    assert np.linalg.det(matrix) == pytest.approx(-r * r, abs=1e-14)
