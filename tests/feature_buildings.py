"""Buildings with each optional feature of the time loops and with each pair of features.

The stories are those of `small_buildings.py`. A feature is a function that changes the mapping of a
model file; several features can be applied one after the other.
"""

from itertools import combinations

from small_buildings import LAWS, MASS, STIFFNESS, STRENGTH, YIELD_DRIFT

_DEFINE_THEIR_STIFFNESS = ("polynomial", "multilinear-pinching", "multilinear")
"""Laws with points or coefficients that define the initial stiffness."""


def two_stories(*laws):
    """Return a model of two stories with the names of their laws in `LAWS`; None is linear."""
    stories = []
    for i, name in enumerate(laws):
        law = LAWS[name] if name else None
        story = {"mass": MASS * (1.0 - 0.2 * i), "height": 3.0}
        if not law or law["type"] not in _DEFINE_THEIR_STIFFNESS:
            story["stiffness"] = STIFFNESS
        stories.append({**story, **({"law": law} if law else {})})
    return {"stories": stories, "damping": 0.03, "collapse_drift": 0.9}


def _dashpot(story, **keys):
    """Return a function that adds a dashpot to a story, beside the keys of another feature."""

    def add(model):
        model["stories"][story].setdefault("dashpot", {}).update(keys)

    return add


def _elements(model):
    """Divide the first story into two elements."""
    story = model["stories"][0]
    own = {key: story.pop(key) for key in ("stiffness", "fracture_drift") if key in story}
    own |= story.pop("law", {"type": "linear"})
    story["elements"] = [
        {"name": "frame", **own},
        {"name": "wall", "type": "gap", "gap": YIELD_DRIFT, "stiffness": 0.1 * STIFFNESS,
         "stop_stiffness": 0.4 * STIFFNESS},
    ]  # fmt: skip


def _fracture(model):
    """Let the laws of both stories fracture, of which the second is curved."""
    first, second = model["stories"]
    first["law"] = {"type": "linear", **first.get("law", {}), "fracture_drift": 5.0 * YIELD_DRIFT}
    second["law"] = {"type": "tanh", "strength": STRENGTH, "fracture_drift": 1.5 * YIELD_DRIFT}
    second.setdefault("stiffness", STIFFNESS)


def _attachments(model):
    """Add two masses, one of which yields, to the first floor."""
    model.setdefault("attachments", []).extend([
        {"name": "tank", "floor": 1, "mass": 0.05 * MASS, "stiffness": 0.05 * STIFFNESS,
         "dashpot": 1e4},
        {"name": "shelf", "floor": 1, "mass": 0.02 * MASS, "stiffness": 0.02 * STIFFNESS,
         "law": {"type": "bilinear", "yield_force": 0.02 * STRENGTH, "hardening": 0.1}},
    ])  # fmt: skip


def _links(model):
    """Link the ground and the second floor by a yielding cable and a dashpot."""
    model.setdefault("links", []).extend([
        {"name": "cable", "from": "ground", "to": 2, "stiffness": 0.2 * STIFFNESS, "dashpot": 2e5,
         "law": {"type": "bilinear", "yield_force": 0.3 * STRENGTH, "hardening": 0.1}},
    ])  # fmt: skip


def _contact(model):
    """Add a second building of two masses, which only links hold, and a contact with it."""
    model.setdefault("attachments", []).extend(
        {"name": name, "floor": "ground", "mass": 0.6 * MASS, "stiffness": 0}
        for name in ("lower", "upper")
    )
    model.setdefault("links", []).extend([
        {"name": "story-1", "from": "ground", "to": "lower", "stiffness": 0.5 * STIFFNESS,
         "dashpot": 1e5},
        {"name": "story-2", "from": "lower", "to": "upper", "stiffness": 0.3 * STIFFNESS},
        {"name": "contact", "from": 2, "to": "upper",
         "law": {"type": "gap", "gap": 0.5 * YIELD_DRIFT, "stop_stiffness": STIFFNESS,
                 "dashpot": 2e5}},
    ])  # fmt: skip


def _loads(*forces):
    """Return a function that adds forces to a model."""

    def add(model):
        model.setdefault("excitation", {}).setdefault("forces", []).extend(forces)

    return add


def _damping(**damping):
    """Return a function that sets the damping of a model."""
    return lambda model: model.update(damping=damping)


FEATURES = {
    "modal": _damping(modal=0.03),
    "tangent": _damping(rayleigh={"ratio": 0.03, "modes": [1, 2], "tangent": True}),
    "harmonic": _loads({"floor": 1, "amplitude": 2e5, "omega": 25.0, "phase": "cos"}),
    "points": _loads({"floor": 2, "points": [[0.05, 0.0], [0.2, 3e5], [0.2, -1e5], [0.43, 0.0]]}),
    "power": _dashpot(1, coefficient=2e5, exponent=0.5, linear_below=0.01),
    "brace": _dashpot(0, coefficient=1e6, brace=2.0 * STIFFNESS),
    "power-brace": _dashpot(
        1, coefficient=2e5, exponent=0.5, linear_below=0.01, brace=2.0 * STIFFNESS
    ),
    "relief": _dashpot(
        0, coefficient=1e6, brace=2.0 * STIFFNESS, relief={"force": 1e5, "ratio": 0.1}
    ),
    "elements": _elements,
    "attachments": _attachments,
    "links": _links,
    "contact": _contact,
    "p-delta": lambda model: model.update(p_delta=True),
    "fracture": _fracture,
}
"""Functions that add a feature to a model, by name."""


def _pairs():
    """Yield the pairs of features that a model can have at the same time."""
    for pair in combinations(FEATURES, 2):
        # Two types of damping, two versions of one damper, and a damping without a definition at a
        # fracture
        if {*pair} not in ({"modal", "tangent"}, {"power", "power-brace"}, {"tangent", "fracture"}):
            yield pair


CASES = [(name,) for name in FEATURES] + list(_pairs())
"""Each feature and each pair of features."""

_RISING = ("bilinear", "kinematic", "peak-oriented", None, "tanh", "isotropic", "bouc-wen")
"""Laws of the stories in turn; all features accept them."""


def building(features):
    """Return the model with these features, for features of `CASES`."""
    number = CASES.index(features)
    model = two_stories(_RISING[number % 7], _RISING[(number // 7 + 3 * number + 1) % 7])
    # The elements take the law of the story, and all other features keep it.
    for name in sorted(features, key=lambda name: name == "elements"):
        FEATURES[name](model)
    return model
