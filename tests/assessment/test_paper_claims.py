"""Claims of the paper of 2022 on limits, cusps and frequencies compared with measured values (rows
in methods/README)."""

import math

import numpy as np
import pytest

from tdint.assessment.examples.paper_examples import examples
from tdint.assessment.stability.stability import critical_step, stability
from tdint.methods.catalogue import parse
from tdint.model.building import assemble

DAMPINGS = (0.0, 0.02, 0.05, 0.2)


@pytest.mark.parametrize("damping", DAMPINGS)
def test_lagging_damping_lowers_limit_of_central_difference(damping):
    """For the velocity (u(t) - u(t - h)) / h, the recurrence gives the limit 2 (sqrt(1 + xi^2) -
    xi)."""
    limit = 2.0 * (math.sqrt(1.0 + damping**2) - damping)

    def radius(w):
        # u(t + h) = (2 - w^2 - 2 xi w) u(t) - (1 - 2 xi w) u(t - h)
        return np.max(
            np.abs(np.roots([1.0, w * w + 2.0 * damping * w - 2.0, 1.0 - 2.0 * damping * w]))
        )

    assert radius(limit * 0.999) <= 1.0 + 1e-12
    assert radius(limit * 1.001) > 1.0
    assert limit <= 2.0


@pytest.mark.parametrize("damping", DAMPINGS)
def test_damping_raises_limit_of_newmark_with_gamma_above_one_half(damping):
    """The conclusion would hold for beta = 0 and gamma = 0.6 (closed form of Hughes, 1987, sect.
    9.1)."""
    gamma = 0.6
    lead = damping * (gamma - 0.5)
    limit = (lead + math.sqrt(0.5 * gamma + lead**2)) / (0.5 * gamma)
    assert critical_step(parse(f"newmark:beta=0:gamma={gamma}"), damping) == pytest.approx(
        limit, rel=1e-6
    )


@pytest.mark.parametrize(("damping", "cusp"), [(0.0, 2.29), (0.05, 2.69)])
def test_cusp_of_spectral_radius_of_wilson(damping, cusp):
    """The minimum spectral radius is at the bifurcation of the complex conjugate roots; the paper
    states dt/T = 2.3 to 2.7."""
    dt_over_t = np.linspace(0.5, 5.0, 4501)
    radius = stability("wilson:theta=1.4", dt_over_t, damping).spectral_radius
    lowest = int(np.argmin(radius))
    assert dt_over_t[lowest] == pytest.approx(cusp, abs=0.005)
    slopes = np.diff(radius) / np.diff(dt_over_t)
    assert slopes[lowest - 1] < 0.0 < slopes[lowest]
    assert slopes[lowest] - slopes[lowest - 1] > 50.0 * np.max(
        np.abs(np.diff(slopes[: lowest - 1]))
    )


def test_first_frequency_of_example_3():
    """The paper states 0.031 rad/s. The first frequency of a chain of n masses with one fixed end
    is 2 sqrt(k / m) sin(pi / (2 (2 n + 1)))."""
    exact = 2.0 * math.sqrt(500.0 / 50.0) * math.sin(math.pi / 602.0)
    building = assemble(examples()[3].model)
    measured = math.sqrt(np.linalg.eigvalsh(building.stiffness_matrix() / building.mass[0])[0])
    assert measured == pytest.approx(exact, rel=1e-9)
    assert exact == pytest.approx(0.0330, abs=5e-5)
