"""Drifts of stories with two-sided, falling and multilinear laws under El Centro, computed
separately by matrix exponentials with bisected branch changes, which two methods of different
families meet to their last digits."""

import math

import numpy as np
import pytest

from el_centro import el_centro
from selection import every
from tdint import run
from tdint.ground_motion.record import Record

UNITS = {"length": "m", "force": "kN", "mass": "t"}
MASS_DAMPING = 0.6324555320  # 1/s, 5 % of a story of 100 t and 4000 kN/m

THREE = [[0.02, 80], [0.04, 120], [0.10, 150]]
NEGATIVE = {"backbone": [[0.015, 60], [0.03, 90], [0.08, 115]]}
FIVE = [[0.01, 40], [0.02, 72], [0.04, 112], [0.08, 144], [0.12, 160]]


def bilinear(yield_force, hardening, negative=None):
    sides = {"negative": {"yield_force": negative}} if negative else {}
    return {"type": "bilinear", "yield_force": yield_force, "hardening": hardening, **sides}


def multilinear(rule, backbone, last_slope=200.0, **more):
    return {
        "type": "multilinear",
        "rule": rule,
        "backbone": backbone,
        "last_slope": last_slope,
        **more,
    }


# Law of a story of 100 t (4000 kN/m), maximum and minimum drift and drift at 15 s as printed, m
CASES = {
    "two sides": (bilinear(120, 0.03, 80), "0.0214877 -0.109892 -0.0814237"),
    "two sides, plastic": (bilinear(150, 0, 100), "0.0214877 -0.148242 -0.116487"),
    "falling": (bilinear(100, -0.03), "0.0214877 -0.105239 -0.0540013"),
    "steeply falling": (bilinear(120, -0.05), "0.0214877 -0.100690 -0.0536839"),
    "two falling sides": (bilinear(150, -0.02, 110), "0.0214877 -0.150065 -0.118267"),
    "kinematic": (multilinear("kinematic", THREE), "0.0652940 -0.0784456 0.0233064"),
    "kinematic, 5 points": (multilinear("kinematic", FIVE), "0.0658532 -0.0719657 0.0169197"),
    "kinematic, two sides": (
        multilinear("kinematic", THREE, negative=NEGATIVE),
        "0.0324014 -0.0910160 -0.0067283",
    ),
    "isotropic": (multilinear("isotropic", THREE), "0.0433577 -0.0911406 0.0076326"),
    "isotropic, two sides": (
        multilinear("isotropic", THREE, negative=NEGATIVE),
        "0.0215071 -0.0996394 -0.0534465",
    ),
    "origin": (multilinear("origin", THREE), "0.0871582 -0.0769341 0.0003891"),
    "origin, two sides": (
        multilinear("origin", THREE, negative=NEGATIVE),
        "0.0774754 -0.0714701 -0.0018431",
    ),
    "elastic": (multilinear("elastic", [[0.03, 120]], 24000.0), "0.0602824 -0.0686203 -0.0108843"),
}


def story(law):
    stiffness = {"stiffness": 4000} if law["type"] == "bilinear" else {}
    return {
        "units": UNITS,
        "stories": [{"mass": 100, **stiffness, "law": law}],
        "damping": {"rayleigh": {"mass": MASS_DAMPING, "stiffness": 0}},
    }


def extremes(history):
    """Return maximum and minimum drift of a story on the ground, between the steps, too: of the
    cubics with the drifts and rates at both ends of the steps."""
    h = np.diff(history.time)
    d0, d1 = history.drift[:-1, 0], history.drift[1:, 0]
    v0, v1 = h * history.velocity[:-1, 0], h * history.velocity[1:, 0]
    turning = np.flatnonzero(v0 * v1 < 0.0)
    drifts = [*history.drift[:, 0]]
    for i in turning:
        cubic = np.polynomial.Polynomial(
            [
                d0[i],
                v0[i],
                3 * (d1[i] - d0[i]) - 2 * v0[i] - v1[i],
                2 * (d0[i] - d1[i]) + v0[i] + v1[i],
            ]
        )
        roots = cubic.deriv().roots()
        drifts += [
            cubic(root.real) for root in roots if abs(root.imag) < 1e-9 and 0 <= root.real <= 1
        ]
    return max(drifts), min(drifts)


def assert_printed(values, printed):
    """Compare values with printed numbers: the difference is at most 0.6 of their last digit."""
    for value, text in zip(values, printed.split(), strict=True):
        last_digit = 10.0 ** -len(text.split(".")[1])
        assert value == pytest.approx(float(text), abs=0.6 * last_digit)


@pytest.mark.parametrize("method", every(2, ["moment4", "impulse4"]))
@pytest.mark.parametrize("name", CASES)
def test_drifts_have_the_printed_digits(name, method):
    law, printed = CASES[name]
    record = el_centro()
    response = run(story(law), record, method=method, dt=record.dt / 16, check=False, history=True)
    history = response.history
    assert_printed((*extremes(history), history.drift[-1, 0]), printed)
    assert response.stories.peak_drift[0] == pytest.approx(
        max(abs(float(text)) for text in printed.split()[:2]), rel=5e-6
    )


def test_newmark_average_meets_the_same_drifts():
    """A third family; its error falls in proportion to h^2."""
    record = el_centro()
    for name in ("two sides", "kinematic", "isotropic", "origin"):
        law, printed = CASES[name]
        response = run(story(law), record, method="newmark-average", dt=record.dt / 64, check=False)
        peak = max(abs(float(text)) for text in printed.split()[:2])
        assert response.stories.peak_drift[0] == pytest.approx(peak, rel=2e-5)


@pytest.mark.parametrize("method", ["impulse4", "moment4"])
def test_collapse_has_the_published_time(method):
    """The line of yielding has no force at 0.275 m, which the story reaches at 5.531 s."""
    record = el_centro()
    law = bilinear(100, -0.10)
    response = run(story(law), record, method=method, dt=record.dt / 64, check=False)
    assert response.status == "failed-story"
    assert response.collapse.time == pytest.approx(5.531, abs=6e-4)
    assert response.stories.peak_drift[0] == pytest.approx(0.275, abs=2e-3)


@pytest.mark.parametrize("method", ["impulse4", "moment4"])
def test_asymmetric_yield_strengths_under_a_triangular_pulse(method):
    """A published case in in and kip: 10.00835 in and 3.216049 in after 1 s."""
    samples = [0.0, -1.0, -2.0, -3.0, -2.0, -1.0, 0.0, 0.9, 1.8, 0.9, 0.0]
    inch = 0.0254
    record = Record(200.0 / 3.0 * inch * np.array(samples), 0.1, "", "XX.TEST..HN1", "HN1", "test")
    building = {
        "units": {"length": "in", "force": "kip", "mass": "kip*s^2/in"},
        "stories": [{"mass": 0.5, "stiffness": 20, "law": bilinear(60, 0, 35)}],
        "damping": {"modal": 0.02},
    }
    dt = 0.1 / 64 if method == "impulse4" else 0.1 / 128
    response = run(building, record, method=method, dt=dt, duration=1.0, check=False, history=True)
    drifts = (*extremes(response.history), response.history.drift[-1, 0])
    assert_printed([drift / inch for drift in drifts], "10.00835 0.0 3.216049")


@pytest.mark.parametrize("method", ["impulse4", "moment4", "gauss4"])
def test_free_vibration_with_a_damper_and_its_brace(method):
    building = {
        "stories": [{"mass": 1, "stiffness": 100, "dashpot": {"coefficient": 5, "brace": 300}}],
        "damping": "none",
        "initial": {"displacement": [1.0], "velocity": [0.0]},
    }
    history = run(
        building, method=method, dt=0.0025, duration=2.0, check=False, history=True
    ).history
    assert history.displacement[-1, 0] == pytest.approx(0.00213483, abs=6e-9)
    assert history.velocity[-1, 0] == pytest.approx(-0.0528891, abs=6e-8)
    assert history.damper_force[-1, 0] == pytest.approx(-0.260006, abs=6e-7)
    assert math.isclose(history.time[-1], 2.0)
