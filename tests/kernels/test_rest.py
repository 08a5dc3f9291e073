"""Laws that remember reversals start at rest: noise before the first movement changes no force."""

import numpy as np
import pytest

from tdint import load_model, make_record, run
from tdint.model.building import assemble
from tdint.model.story_laws import LAWS
from tdint.response.static.cyclic import follow_path

K, DY = 4.0e6, 0.02  # N/m, m
FY = K * DY
CURVE = {"backbone": [[DY, FY], [3 * DY, 1.4 * FY]]}
STEEPER = {"backbone": [[DY, FY], [2 * DY, 4 * FY], [4 * DY, 5 * FY]]}
SLACK = {"backbone": [[0.2 * DY, 0.0], [DY, FY]]}
WEAKER = {"negative": {"backbone": [[0.5 * DY, 0.5 * FY], [DY, 0.7 * FY]]}}
PINCHING = {"pinching": {"drift": 0.5, "force": 0.3}}
TAUT = {"pinching": {"drift": 1.0, "force": 0.0}}
DAMAGE = {"damage": {"drift": 0.05, "work": 0.05}}
ISOTROPIC = {"isotropic": {"a1": 0.15, "a2": 1.0, "a3": 0.15, "a4": 1.0}}
DEGRADATION = {
    "degradation": {
        "capacity": 40.0,
        "stiffness": {"peak": 0.3, "work": 0.2, "limit": 0.5},
        "drift": {"peak": 0.2, "limit": 0.5},
        "strength": {"work": 0.1, "limit": 0.5},
    }
}
YIELD = {"yield_force": FY, "hardening": 0.05}
IMK = {
    "yield_force": FY,
    "plastic_drift": 3 * DY,
    "post_capping_drift": 9 * DY,
    "capping_ratio": 1.2,
    "residual_ratio": 0.2,
    "ultimate_drift": 40 * DY,
    "deterioration": 60 * DY,
}
POINTS = {"backbone": [[DY, FY], [3 * DY, 1.4 * FY], [8 * DY, 1.1 * FY]]}
REGAINING = {"pinching": {"drift": 0.5, "force": 0.25, "unloading": 0.05}}
LAW_CASES = [
    ("linear", {}),
    ("polynomial", {"coefficients": [K, 0.0, K / DY**2]}),
    ("tanh", {"strength": FY}),
    ("gap", {"gap": DY, "stop_stiffness": 3 * K}),
    ("bilinear", YIELD),
    ("peak-oriented", {**YIELD, "unloading": 0.4}),
    ("bouc-wen", {**YIELD, "exponent": 1.5, "beta": 0.6}),
    (
        "bouc-wen",
        {
            **YIELD,
            "exponent": 2.0,
            "beta": 0.6,
            "asymmetry": 0.2,
            "degradation": {"amplitude": 1e-4, "strength": 1e-4, "stiffness": 1e-4},
            "pinching": {"slip": 0.8, "rate": 1e-4, "size": 0.2, "severity": 0.3},
        },
    ),
    (
        "trilinear-pinching",
        {
            "yield_force": FY,
            "ultimate_force": 1.5 * FY,
            "ultimate_drift": 5 * DY,
            "pinching": 0.4,
            "unloading": 0.3,
        },
    ),
    ("imk", IMK),
    ("imk", {**IMK, "pinching": {"force": 0.3, "drift": 0.4}}),
    ("multilinear-pinching", {**POINTS, **REGAINING}),
    ("multilinear-pinching", {**POINTS, **REGAINING, **DEGRADATION}),
    ("multilinear-pinching", {**STEEPER, **REGAINING, **DEGRADATION}),
    ("multilinear", {"rule": "kinematic", **CURVE}),
    ("multilinear", {"rule": "isotropic", **CURVE}),
    ("multilinear", {"rule": "origin", **CURVE}),
    ("multilinear", {"rule": "origin", **STEEPER}),
    ("multilinear", {"rule": "elastic", **STEEPER}),
    ("multilinear", {"rule": "flag", **CURVE, "return": [[0.4 * DY, 0.4 * FY]]}),
    *(
        ("multilinear", {"rule": "peak", **curve, **keys})
        for curve in (CURVE, STEEPER, SLACK)
        for keys in (
            {},
            {"unloading": 0.4, "reloading": 0.3},
            PINCHING,
            TAUT,
            DAMAGE,
            {**PINCHING, **DAMAGE, "unloading": 0.3},
            {**TAUT, **DAMAGE},
        )
    ),
    *(
        ("multilinear", {"rule": "peak", **curve, **PINCHING, **DAMAGE, **WEAKER})
        for curve in (CURVE, STEEPER)
    ),
    *(
        ("multilinear", {"rule": "peak", "sides": side, **curve, **PINCHING})
        for side in ("positive", "negative")
        for curve in (CURVE, STEEPER, SLACK)
    ),
    ("ramberg-osgood", {"yield_force": FY, "alpha": 0.6, "exponent": 5.0}),
    ("hertz", {"gap": DY, "stop_stiffness": FY / DY**1.5}),
    ("steel", YIELD),
    ("steel", {**YIELD, **ISOTROPIC}),
    ("steel", {**YIELD, "isotropic": {**ISOTROPIC["isotropic"], "a3": 0.0}}),
]
# Multiples of the noise; the last one has the sign of the movement or the other sign.
NOISE = np.array([1.0, -0.6, 0.9, -1.0, 0.2, -0.9, 1.0])
SWINGS = np.array([4.0, -5.0, 6.0, -2.0, 8.0, 0.0]) * DY
SWINGS = np.concatenate(
    [np.linspace(a, b, 7)[1:] for a, b in zip([0.0, *SWINGS], SWINGS, strict=False)]
)
NAMES = [f"{law}-{k}" for k, (law, _) in enumerate(LAW_CASES)]


def forces(law, keys, drifts):
    """Return the forces of a story along a path of drifts, N."""
    story = {"mass": 1.0, "law": {"type": law, **keys}}
    if law not in ("polynomial", "multilinear", "multilinear-pinching"):
        story["stiffness"] = K
    building = assemble(load_model({"stories": [story]}))
    return follow_path(building, 1, drifts).shear


def test_every_law_with_memory_starts_at_rest_here():
    """An elastic law without branches has no reversals to remember."""
    with_memory = {
        name
        for name, law in LAWS.items()
        if law.kinked
        or law.functions().hysteretic_energy is not None
        or law.functions().accumulate_dissipation is not None
    }
    assert len(with_memory) >= 10
    assert with_memory <= {law for law, _ in LAW_CASES} <= set(LAWS)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("law", "keys"), LAW_CASES, ids=NAMES)
def test_noise_at_rest_changes_no_force(law, keys, side):
    expected = forces(law, keys, side * SWINGS)
    for size in (1e-12, 1e-6, 1e-5):
        for sign in (1.0, -1.0):
            noisy = forces(law, keys, np.append(sign * size * DY * NOISE, side * SWINGS))
            change = np.abs(noisy[NOISE.size :] - expected)
            # Energies of degrading laws contain the work of the noise.
            assert np.max(change) <= (1e-9 + 10.0 * size**2) * FY, (size, sign)


YIELD_FORCES = (8.0e5, 6.8e5, 5.6e5, 4.4e5, 3.2e5)  # N
STEEL = {
    "type": "steel",
    "hardening": 0.02,
    "transition": {"R0": 15.0, "cR1": 0.925, "cR2": 0.15},
    **ISOTROPIC,
}
# Peak drifts (m) of the separate solver of the grid (tests/grid/solver.py)
STEEL_DRIFTS = (0.1363312, 0.10582977, 0.07105473, 0.08485879, 0.0042235)
DAMAGE_DRIFTS = (0.14828247, 0.11184566, 0.07837294, 0.02118341, 0.00308077)
STIFFENING_DRIFTS = (0.10051285, 0.09572411, 0.08304871, 0.06053594, 0.02559395)


def steel(force, k):
    """Return a story of steel with isotropic hardening."""
    return {"stiffness": k, "law": {**STEEL, "yield_force": force}}


def damaged(force, k):
    """Return a story whose reversals increase the farthest drifts."""
    d = force / k
    points = {"backbone": [[d, force], [4 * d, 1.3 * force]], "last_slope": 0.02 * k}
    law = {"type": "multilinear", "rule": "peak", **points, "damage": {"drift": 0.01, "work": 0.01}}
    return {"law": law}


def stiffening(force, k):
    """Return a story with a steeper second segment, which unloads with this slope from rest on."""
    force, d = 0.5 * force, 0.5 * force / k
    points = {"backbone": [[d, force], [3 * d, 5 * force], [8 * d, 7 * force]]}
    law = {"type": "multilinear", "rule": "peak", **points, "last_slope": 0.2 * k, **PINCHING}
    return {"law": law}


@pytest.mark.parametrize("method", ["impulse4", "moment4", "gauss4"])
@pytest.mark.parametrize(
    ("story", "drifts"),
    [(steel, STEEL_DRIFTS), (damaged, DAMAGE_DRIFTS), (stiffening, STIFFENING_DRIFTS)],
)
def test_drifts_of_upper_stories_that_start_at_rest(story, drifts, method):
    stories = [{"mass": 1.2e5, "height": 3.5, **story(force, 1.4e8)} for force in YIELD_FORCES]
    model = {"stories": stories, "damping": {"rayleigh": {"mass": 0.5, "stiffness": 0.001}}}
    time = np.arange(161) * 0.01
    pulse = 8.0 * np.sin(2.5 * np.pi * time) * np.minimum(time / 0.8, 1.0) * (time < 1.2)
    record = make_record(pulse, dt=0.01, units="m/s^2")
    response = run(model, record, method=method, duration=1.6, check=False)
    assert response.stories.peak_drift == pytest.approx(drifts, rel=3e-3)


def test_drifts_of_upper_stories_after_a_sudden_motion():
    """The ground acceleration jumps in one step; the errors are larger than in a record."""
    stories = [{"mass": 1.2e5, "height": 3.5, **steel(force, 1.4e8)} for force in YIELD_FORCES]
    model = {"stories": stories, "damping": {"rayleigh": {"mass": 0.5, "stiffness": 0.001}}}
    record = make_record([0.0, *20 * [3.0], *20 * [-3.0]], dt=0.02, units="m/s^2")
    response = run(model, record, duration=0.8, check=False)
    drifts = (0.11150989, 0.06608615, 0.02143081, 0.00699928, 0.00260044)
    assert response.stories.peak_drift == pytest.approx(drifts, rel=3e-3)
