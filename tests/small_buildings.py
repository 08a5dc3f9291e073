"""Buildings with two stories for tests without compiled loops, as mappings of model files.

The stories have the initial stiffness `STIFFNESS` and strengths near `STRENGTH`, and `MOTION`
causes several times their yield drift in both directions.
"""

from building_cases import noise
from tdint.ground_motion.horizontals import Horizontals

MASS, STIFFNESS, STRENGTH = 1e5, 4e7, 2e5  # kg, N/m, N
YIELD_DRIFT = STRENGTH / STIFFNESS  # m

MOTION = noise(samples=51, dt=0.02, peak=8.0)
PAIR = Horizontals(MOTION, noise(samples=51, dt=0.02, seed=8, peak=6.0))


def _backbone(drifts, forces):
    return [
        [drift * YIELD_DRIFT, force * STRENGTH] for drift, force in zip(drifts, forces, strict=True)
    ]


def _multilinear(rule, drifts, forces):
    """Return a law with three points, and with smaller drifts on the negative side."""
    return {
        "type": "multilinear",
        "rule": rule,
        "backbone": _backbone(drifts, forces),
        "last_slope": 0.02 * STIFFNESS,
        "negative": {"backbone": _backbone([0.8 * d for d in drifts], [0.8 * f for f in forces])},
    }


_IMK = {
    "type": "imk", "yield_force": STRENGTH, "plastic_drift": 3.0 * YIELD_DRIFT,
    "post_capping_drift": 9.0 * YIELD_DRIFT, "capping_ratio": 1.1, "residual_ratio": 0.2,
    "ultimate_drift": 60.0 * YIELD_DRIFT,
}  # fmt: skip
_PINCHING4 = {
    "type": "multilinear-pinching",
    "backbone": _backbone((1.0, 3.0, 6.0, 30.0), (1.0, 1.2, 1.1, 0.3)),
    "pinching": {"drift": 0.5, "force": 0.25, "unloading": 0.05},
}
_DEGRADATION = {
    "stiffness": {"peak": 0.3, "work": 0.2, "limit": 0.5},
    "drift": {"peak": 0.1, "work": 0.05, "limit": 0.2},
    "strength": {"peak": 0.15, "work": 0.05, "limit": 0.3},
    "capacity": 8.0,
}

LAWS = {
    "bilinear": {"type": "bilinear", "yield_force": STRENGTH, "hardening": 0.05},
    "elastoplastic": {"type": "bilinear", "yield_force": STRENGTH, "hardening": 0.0},
    "peak-oriented": {
        "type": "peak-oriented",
        "yield_force": STRENGTH,
        "hardening": 0.05,
        "unloading": 0.4,
    },
    "bouc-wen": {
        "type": "bouc-wen",
        "yield_force": STRENGTH,
        "hardening": 0.05,
        "exponent": 2.0,
        "beta": 0.6,
    },
    "bouc-wen-sharp": {
        "type": "bouc-wen",
        "yield_force": STRENGTH,
        "hardening": 0.1,
        "exponent": 5.5,
        "beta": 0.5,
    },
    "gap": {"type": "gap", "gap": 1.5 * YIELD_DRIFT, "stop_stiffness": 3.0 * STIFFNESS},
    "tanh": {"type": "tanh", "strength": 1.5 * STRENGTH},
    "polynomial": {
        "type": "polynomial",
        "coefficients": [
            STIFFNESS,
            -0.05 * STIFFNESS / YIELD_DRIFT,
            0.04 * STIFFNESS / YIELD_DRIFT**2,
        ],
    },
    "trilinear-pinching": {
        "type": "trilinear-pinching",
        "yield_force": STRENGTH,
        "ultimate_force": 1.5 * STRENGTH,
        "ultimate_drift": 5.0 * YIELD_DRIFT,
        "pinching": 0.4,
        "unloading": 0.3,
    },
    "imk": _IMK,
    "imk-pinching": {
        **_IMK,
        "deterioration": 40.0 * YIELD_DRIFT,
        "pinching": {"force": 0.4, "drift": 0.6},
    },
    "imk-deteriorating": {**_IMK, "deterioration": 15.0 * YIELD_DRIFT},
    "multilinear-pinching": {**_PINCHING4, "degradation": _DEGRADATION},
    "multilinear-rising": {
        **_PINCHING4,
        "backbone": _backbone((1.0, 4.0), (1.0, 1.5)),
        "pinching": {"drift": 0.3, "force": 0.6, "unloading": -0.1},
    },
    "falling": {
        "type": "bilinear",
        "yield_force": STRENGTH,
        "hardening": -0.02,
        "negative": {"yield_force": 0.8 * STRENGTH},
    },
    "kinematic": _multilinear("kinematic", (1.0, 3.0, 6.0), (1.0, 1.4, 1.6)),
    "isotropic": _multilinear("isotropic", (1.0, 3.0, 6.0), (1.0, 1.4, 1.6)),
    "origin": _multilinear("origin", (1.0, 3.0, 6.0), (1.0, 1.4, 1.2)),
    "peak": _multilinear("peak", (1.0, 3.0, 6.0), (1.0, 1.4, 1.2)),
    "hook": _multilinear("elastic", (1.0, 2.0, 4.0), (1.0, 1.0, 2.5)),
    "ramberg-osgood": {
        "type": "ramberg-osgood",
        "yield_force": STRENGTH,
        "alpha": 0.5,
        "exponent": 4.0,
    },
    "bouc-wen-thin": {
        "type": "bouc-wen",
        "yield_force": STRENGTH,
        "hardening": 0.05,
        "exponent": 2.0,
        "beta": 0.3,
    },
}
"""Hysteretic models, one story of which yields several times."""


def _stories(*laws, **more):
    """Return stories with these laws, each with 0.8 times the stiffness of the story below.

    Parameters
    ----------
    *laws : dict or None
        Law of each story; None for a linear story.
    **more
        Other keys of all stories.
    """
    stories = []
    for i, law in enumerate(laws):
        stiffness = STIFFNESS if i == 0 or law else 0.8 * STIFFNESS
        entry = {"mass": MASS * (1.0 - 0.2 * i), "height": 3.0, "stiffness": stiffness, **more}
        if law:
            entry["law"] = law
        if law and law["type"] in ("polynomial", "multilinear-pinching", "multilinear"):
            del entry["stiffness"]  # The law defines the initial stiffness.
        stories.append(entry)
    return stories


BUILDINGS = {
    name: {"stories": _stories(law, law), "damping": 0.03, "collapse_drift": 0.9}
    for name, law in LAWS.items()
} | {
    "elastic": {
        "stories": _stories(None, None, dashpot=1e5),
        "damping": {"rayleigh": {"mass": 0.5, "stiffness": 5e-4}},
        "p_delta": True,
    },
    "forces": {
        "stories": _stories(LAWS["tanh"], LAWS["bilinear"], dashpot=2e5),
        "damping": {"rayleigh": {"mass": 0.5, "stiffness": 5e-4}},
        "p_delta": True,
        "excitation": {
            "forces": [
                {"floor": 1, "amplitude": 1e5, "omega": 25.0, "phase": "cos"},
                {"floor": 2, "amplitude": 7e4, "omega": 9.0, "phase": "sin"},
            ]
        },
        "initial": {"displacement": [0.003, -0.004], "velocity": [0.1, 0.3]},
        "collapse_drift": 0.9,
    },
    "modal": {
        "stories": _stories(LAWS["bilinear"], LAWS["gap"]),
        "damping": {"modal": [0.03, 0.08]},
        "collapse_drift": 0.9,
    },
    "power-dashpots": {
        "stories": _stories(
            LAWS["bilinear"],
            LAWS["polynomial"],
            dashpot={"coefficient": 8e4, "exponent": 0.4, "linear_below": 0.01},
        ),
        "damping": 0.02,
        "collapse_drift": 0.9,
    },
    "curved-power-dashpots": {
        "stories": _stories(
            LAWS["bouc-wen"],
            LAWS["bouc-wen-sharp"],
            dashpot={"coefficient": 1.5e5, "exponent": 0.3, "linear_below": 0.02},
        ),
        "damping": {"modal": 0.02},
        "collapse_drift": 0.9,
    },
    "collapse": {
        "stories": _stories(LAWS["bilinear"], LAWS["peak-oriented"]),
        "collapse_drift": 0.01,
    },
    "failure": {
        "stories": _stories({**_IMK, "ultimate_drift": 6.0 * YIELD_DRIFT}, LAWS["imk-pinching"]),
        "damping": 0.03,
        "p_delta": True,
        "collapse_drift": 0.9,
    },
    "stiff": {
        "stories": _stories(LAWS["elastoplastic"], None, LAWS["trilinear-pinching"]),
        "damping": 0.01,
        "collapse_drift": 0.9,
    },
    "isolated": {
        "stories": [
            {
                "mass": MASS,
                "stiffness": 0.2 * STIFFNESS,
                "isolator": True,
                "law": {**LAWS["bilinear"], "yield_force": 0.2 * STRENGTH, "hardening": 0.1},
            },
            *_stories(LAWS["bouc-wen"]),
        ],
        "damping": 0.03,
        "collapse_drift": 0.9,
    },
}
"""Buildings by name: one for each law of `LAWS`, and others with other options of model files."""
