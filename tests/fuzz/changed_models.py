"""Valid models of all laws, topologies and matrices from a seed, with one to three changed values:
each is refused with a TdintError, or it is a model whose modes and short run raise no other error.

    python tests/fuzz/run.py --of changes --cases 20000
"""

import copy
import functools
import math
import random
import warnings
from typing import Any

import numpy as np

import tdint
from fuzz.oracle import Failure
from grid.axes import AXES, build, is_allowed
from random_buildings import any_building
from tdint.errors import TdintError

REFUSED, RUNS, FAILS = "refused", "runs", "does not run"
OUTCOMES = (REFUSED, RUNS, FAILS)

_UNITS = {"length": "m", "force": "kN", "mass": "t"}
_SPRING = {"type": "bilinear", "yield_force": 100, "hardening": 0.03}
_BASES: dict[str, dict[str, Any]] = {
    "matrices": {
        "units": _UNITS,
        "matrices": {
            "names": ["a", "b", "c"],
            "mass": [300, 200, 0],
            "stiffness": [[3000, -1000, -10], [-1000, 2000, 0], [-10, 0, 50]],
            "damping": [[40, 0, 0], [0, 20, 0], [0, 0, 1]],
            "influence": [1, 1, 0],
        },
        "initial": {"displacement": [0.1, 0, 0]},
    },
    "stiffness matrix": {
        "units": _UNITS,
        "stories": [{"mass": 10, "height": 3}, {"mass": 10, "height": 3}],
        "stiffness_matrix": [[9e3, -4e3], [-4e3, 4e3]],
        "damping": {"modal": [0.03, 0.02]},
    },
    "flexural": {
        "units": _UNITS,
        "stories": [
            {
                "repeat": 3,
                "mass": 10,
                "height": 3,
                "flexural": {"EI": 1e6, "GA": 1e6},
                "rotary_inertia": 12,
            }
        ],
        "base": {"rotation": 1e6, "translation": 1e6},
        "damping": {"rayleigh": {"ratio": 0.05, "modes": [1, 2]}},
    },
    "topology": {
        "units": _UNITS,
        "stories": [
            {"mass": 100, "height": 3, "stiffness": 4e4, "dashpot": 10},
            {"mass": 100, "height": 3, "stiffness": 4e4},
        ],
        "attachments": [{"name": "tank", "floor": 2, "mass": 4, "stiffness": 630, "dashpot": 3}],
        "links": [
            {"name": "d", "from": "ground", "to": 2, "dashpot": 60, "stiffness": 100},
            {"name": "e", "from": 1, "to": "tank", "stiffness": 100, "law": _SPRING},
        ],
        "excitation": {"forces": [{"floor": 1, "points": [[0, 1], [1, 2], [2, 0]]}]},
        "damping": {"rayleigh": {"ratio": "5%", "modes": [1, 2]}},
        "limits": {"drift_ratio": "2%"},
        "p_delta": False,
    },
    "elements": {
        "units": _UNITS,
        "stories": [
            {
                "mass": 100,
                "height": 3,
                "elements": [
                    {"name": "x", "type": "linear", "stiffness": 3e4},
                    {"name": "y", "stiffness": 1e4} | _SPRING,
                ],
            }
        ],
        "damping": 0.03,
    },
}
NAMES = (*_BASES, "grid", "laws")

_STRANGE = (
    *(0, -1, 1, 3, 0.5, 1e-30, 1e30, 1e300, 1e15, 1e-9, -5.5, 2**70, 10**400),
    *(math.nan, math.inf, True, False, None, "", "both", "5%", "x", "roof", "ground", "1/0", "1e5"),
    *([], [0], [1, 2], [None], ["both"], [[]], [[1, 2], [3, 4]], [[1, 2], [3]], [[0, 0], [0, 0]]),
    *({}, {"a": 1}, {"type": "linear"}, "-", np.zeros(2), np.array([1.0, math.nan]), np.eye(3)),
)
_KEYS = (
    *("damping", "stiffness", "law", "dashpot", "rayleigh", "sides", "rule", "return", "negative"),
    *("floor", "to", "mass", "height", "elements", "flexural", "base", "initial", "limits"),
    *("isolator", "period", "repeat", "links", "matrices", "inertance", "type", "backbone"),
)
_MILD, _WILD = (0.3, 0.9, 1.1, 1.5, 3.0), (0.0, -1.0, 10.0, 1e3, 1e-3, 1e6, 1e-6, 1e12, 1e-12)
"""Factors on numbers; about half of the models with mild factors are valid."""


def outcome(name: str, seed: int) -> str:
    """Return the outcome of a changed model; raise Failure for any error that is not explained to
    the user."""
    source = random.Random(f"{name} {seed}")
    content = _base(name, source)
    is_mild = source.random() < 0.6
    for _ in range(source.choice((1, 1, 1, 2, 3))):
        _change(content, source, is_mild)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.simplefilter("error", RuntimeWarning)  # of numpy
        try:
            model = tdint.load_model(content)
            tdint.check(content)
        except TdintError:
            return REFUSED
        except Exception as error:
            raise Failure(f"{type(error).__name__}: {error}: {content}"[:2000]) from error
        try:
            tdint.modes(model)
            if source.random() < 0.2:
                tdint.run(model, _record(), duration=0.06, check=False)
        except TdintError:
            return FAILS
        except Exception as error:
            raise Failure(f"valid, {type(error).__name__}: {error}: {content}"[:2000]) from error
    return RUNS


@functools.cache
def _record() -> tdint.Record:
    """Return a short ground motion."""
    return tdint.make_record(np.sin(np.arange(8.0)), dt=0.02, units="m/s^2")


def _base(name: str, source: random.Random) -> dict[str, Any]:
    """Return the content of a valid model."""
    if name in _BASES:
        return copy.deepcopy(_BASES[name])
    if name == "laws":
        return copy.deepcopy(any_building(source.randrange(10**6))[0])
    while True:
        row = {axis: source.choice(list(values)) for axis, values in AXES.items()}
        if is_allowed(row):
            return build(row, source.randrange(1000)).model


def _paths(content: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the keys of all entries of nested content."""
    found = [path] if path else []
    items = content.items() if isinstance(content, dict) else enumerate(content)
    for key, item in items:
        is_nested = isinstance(item, dict | list)
        found += _paths(item, (*path, key)) if is_nested else [(*path, key)]
    return found


def _at(content: Any, path: tuple[Any, ...]) -> Any:
    """Return the entry with the given keys."""
    for key in path:
        content = content[key]
    return content


def _change(content: dict[str, Any], source: random.Random, is_mild: bool) -> None:
    """Change, remove, repeat or add an entry; with `is_mild`, usually multiply a number."""
    paths = _paths(content)
    if not paths:
        return
    *parent, key = source.choice(paths)
    owner, action = _at(content, tuple(parent)), source.random()
    value = owner[key]
    is_number = isinstance(value, float) or (type(value) is int and abs(value) < 10**300)
    if is_number and action < (0.9 if is_mild else 0.6):
        owner[key] = value * source.choice(_MILD if is_mild else _WILD)
    elif action < 0.8:
        owner[key] = copy.deepcopy(source.choice(_STRANGE))
    elif action < 0.87:
        del owner[key]
    elif isinstance(owner, list):
        owner.append(copy.deepcopy(value))
    else:
        owner[source.choice(_KEYS)] = copy.deepcopy(_at(content, source.choice(paths)))
