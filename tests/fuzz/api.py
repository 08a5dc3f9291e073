"""Calls of the Python interface from a seed, with arguments sound and strange; what becomes of
them.

A call is refused (a TdintError; a TypeError, or numpy's ValueError, where an argument is of another
type than it must be), or every number that it gives is finite.
"""

import dataclasses
import functools
import io
import random
import re
from collections.abc import Callable
from typing import Any

import numpy as np

import tdint
from fuzz.oracle import LARGEST_MESSAGE, Failure
from fuzz.sandbox import MODELS
from tdint.errors import TdintError
from tdint.ground_motion.horizontals import Horizontals
from tdint.ground_motion.record import Record

OUTCOMES = REFUSED, DONE = "refused", "finite"

_NUMBERS: tuple[Any, ...] = (0.01, 0.05, 0.2, 1.0, 2, np.float64(0.1), np.int64(2))
_STRANGE: tuple[Any, ...] = (
    0, 0.0, -1, -0.0, 1e-308, 5e-324, 1e308, float("nan"), float("inf"), -np.inf,
    10**30, 1e9,
)  # fmt: skip
_TYPES: tuple[Any, ...] = (
    "1", "abc", "", True, 1j, [], [1.0], {}, b"1", np.array([1.0, 2.0]), np.ma.masked, object(), (),
)  # fmt: skip
_NEVER_NUMBERS = (
    "ductility", "errors", "collapse", "residual_drift_ratio", "peak_drift_ratio",
    "height", "limits", "yield_drift", "law_state", "scratch",
)  # fmt: skip
"""Fields that are nan where there is nothing to tell: a story without height, a law without
yielding, a story without this limit. In a final state: tables of laws, in which the end of a branch
is infinite, and working memory, which holds no result."""

_OF_ANOTHER_TYPE = re.compile("truth value of an|could not be broadcast|could not convert string")
"""What numpy says of an array or a text in the place of a number."""

_SAMPLES = np.sin(0.3 * np.arange(60)) * np.exp(-0.02 * np.arange(60))


def _record(shift: float = 0.0, component: str = "HNE") -> Record:
    return Record(_SAMPLES + shift, 0.01, "", f"..{component}", component, "sound")


@functools.cache
def _model(name: str) -> Any:
    return tdint.load_model(io.StringIO(MODELS[name]))


def _number(source: random.Random) -> Any:
    (pool,) = source.choices((_NUMBERS, _STRANGE, _TYPES, (None,)), (14, 4, 1, 1))
    return source.choice(pool)


def _numbers(source: random.Random) -> Any:
    if source.random() < 0.1:
        return _number(source)
    values = [
        source.choice((*_NUMBERS, *(_STRANGE if source.random() < 0.2 else ())))
        for _ in range(source.randrange(4))
    ]
    return (
        np.array(values, dtype=source.choice((float, float, object)))
        if source.random() < 0.7
        else values
    )


def _text(*sound: str) -> Callable[[random.Random], Any]:
    strange = ("", "nothing", "\x1b", None, 1, 2.0, b"x", "1" * 3000, [])
    return lambda source: source.choice(sound if source.random() < 0.8 else strange)


def _flag(source: random.Random) -> Any:
    return source.choice((True, False))


def _layout(source: random.Random) -> Any:
    return tdint.TextLayout(
        _number(source), source.choice((("1",), "2", 3, (), "x", None)), _number(source)
    )


_METHOD = _text("newmark-average", "impulse4", "exact", "newmark:beta=0.3:gamma=0.6")
_PROCESSING = {
    "trim": lambda source: source.choice(((0.1, 0.3), (_number(source), _number(source)))),
    "baseline": _text("constant", "linear", "quadratic"),
    "pad": lambda source: source.choice((0.1, (0.1, 0.2), (_number(source), 0.0), _number(source))),
    "highpass": _number,
    "lowpass": _number,
    "filter_order": _number,
    "resample": _number,
}


def _run(source: random.Random) -> Any:
    options = {
        "method": _METHOD,
        "dt": _number,
        "duration": lambda random_source: random_source.choice((0.1, 0.2, _number(random_source))),
        "history": _flag,
        "check": _flag,
        "tolerance": _number,
    }
    arguments = _some(options, source)
    arguments.setdefault("duration", 0.1)
    return tdint.run(_model(source.choice(tuple(MODELS))), _record(), **arguments)


_PARAMETERS = (
    "damping", "stories[1].stiffness", "stories.mass", "record.scale",
    "strength_factor", "stories[1].law.yield_force", "stories[0].mass", "storys", "",
    "\x1b", 3, None,
)  # fmt: skip


def _gradient(source: random.Random) -> Any:
    names = source.choice((*_PARAMETERS, [*source.choices(_PARAMETERS[:5], k=2)]))
    options = {"method": _METHOD, "dt": _number, "history": _flag, "check": _flag}
    return tdint.run(
        _model(source.choice(tuple(MODELS))),
        _record(),
        gradient=names,
        duration=0.1,
        **_some(options, source),
    ).gradient


def _limited(source: random.Random) -> Any:
    options = {"limit": source.choice((_number, _text("operational", "2%")))}
    return tdint.run(_model("limited.yaml"), _record(), duration=0.1).limit_checks(
        **_some(options, source)
    )


def _matched(source: random.Random) -> Any:
    options = {
        "periods": lambda random_source: random_source.choice(
            ((0.3, 0.4), (_number(random_source), _number(random_source)))
        ),
        "damping": _number,
    }
    sound = ("asce7:sds=1,sd1=0.6,tl=8", "ec8:type=1,soil=B,ag=0.25g")
    target = source.choice(sound if source.random() < 0.8 else ("none", "", "\0", 1))
    motion = tdint.read_record("suite/1.txt") if source.random() < 0.8 else _record()
    return tdint.match(motion, target, **_some(options, source))


def _scaled(source: random.Random) -> Any:
    case = tdint.prepare(_model("linear.yaml"), _record())
    return tdint.run_case(case.scaled(_number(source)), duration=0.1)


def _many(source: random.Random) -> Any:
    names = (
        "damping", "stories.mass", "stories[1].law.hardening", "stories[2].mass",
        "record.scale", "strength_factor",
    )  # fmt: skip
    strange = (
        "", "stories", "stories[0].mass", "stories[x].mass", "stories[1].law.",
        "storys.mass", "\x1b", 3, None,
    )  # fmt: skip
    chosen = source.choices(
        (*names, *strange) if source.random() < 0.3 else names, k=source.randrange(1, 4)
    )
    options = {
        "product": _flag,
        "zip_records": _flag,
        "progress": lambda random_source: random_source.choice(
            (False, len, _number(random_source))
        ),
    }
    vary = {name: _numbers(source) for name in chosen} if source.random() < 0.9 else _number(source)
    some = _some(options | {"check": _flag, "method": _METHOD}, source)
    if some.get("progress") is len:
        some["progress"] = lambda done, of: None
    return tdint.run_many(
        _model(source.choice(tuple(MODELS))), _record(), duration=0.1, vary=vary, **some
    ).to_dict()


def _replaced(source: random.Random) -> Any:
    name = source.choice(
        (
            "damping", "stories[1].mass", "stories.height", "stories.law.hardening",
            "mass_factor", "x",
        )
    )  # fmt: skip
    return tdint.modes(
        _model(source.choice(tuple(MODELS))).replace(**{name: _number(source)})
    ).omega


CALLS: dict[str, Callable[[random.Random], Any]] = {
    "Record": lambda source: Record(_numbers(source), _number(source), "", "", "", ""),
    "scaled": lambda source: _record().scaled(_number(source)),
    "process": lambda source: tdint.process(_record(), **_some(_PROCESSING, source)),
    "TextLayout": _layout,
    "read_record": lambda source: tdint.read_record(
        source.choice(
            ("a.txt", "table.csv", "n.mseed", "a.txt", "a.txt", "none", "", "\0", 1.5, b"a.txt")
        ),
        **_some(
            {
                "units": _text("m/s^2"),
                "component": _text("HNE", "2"),
                "inventory": _text("a.txt", "none"),
                "layout": _layout,
            },
            source,
        ),
    ),
    "spectrum": lambda source: tdint.spectrum(
        _record(),
        _numbers(source),
        **_some(
            {
                "damping": _number,
                "method": _METHOD,
                "maxima": _text("continuous", "samples"),
                "interpolation": _text("linear", "band-limited"),
            },
            source,
        ),
    ),
    "rotated_spectrum": lambda source: tdint.rotated_spectrum(
        Horizontals(_record(), _record(0.1, "HNN")),
        _numbers(source),
        **_some({"damping": _number, "percentiles": _numbers}, source),
    ),
    "constant_ductility": lambda source: tdint.constant_ductility(
        _record(),
        _numbers(source),
        _numbers(source),
        **_some({"damping": _number, "hardening": _number}, source),
    ),
    "constant_strength": lambda source: tdint.constant_strength(
        _record(),
        _numbers(source),
        _numbers(source),
        **_some({"damping": _number, "hardening": _number}, source),
    ),
    "drift_spectrum": lambda source: tdint.drift_spectrum(
        _record(),
        _numbers(source),
        **_some(
            {"damping": _number, "stories": _number, "story_height": _number, "beam": _flag}, source
        ),
    ),
    "load_model": lambda source: tdint.load_model(
        source.choice(
            (
                io.StringIO(MODELS["linear.yaml"]),
                "linear.yaml",
                "none",
                "",
                "\0",
                {},
                [],
                1,
                None,
                b"x",
                io.BytesIO(),
            )
        )
    ),
    "run": _run,
    "run_many": _many,
    "replace": _replaced,
    "scaled case": _scaled,
    "gradient": _gradient,
    "limit_checks": _limited,
    "match": _matched,
}
"""Functions by name; each makes its arguments and calls."""


def _some(
    makers: dict[str, Callable[[random.Random], Any]], source: random.Random
) -> dict[str, Any]:
    return {name: make(source) for name, make in makers.items() if source.random() < 0.3}


def outcome(name: str, seed: int) -> str:
    """Make a call within a sandbox and return its outcome; raise Failure for a forbidden result."""
    try:
        with np.errstate(all="ignore"):
            result = CALLS[name](random.Random(seed))
    except TdintError as error:
        if len(str(error)) > LARGEST_MESSAGE:
            raise Failure(f"a message of {len(str(error))} characters") from error
        return REFUSED
    except TypeError:
        return REFUSED
    except ValueError as error:
        if not _OF_ANOTHER_TYPE.search(str(error)):
            raise Failure(f"ValueError: {error}"[:500]) from error
        return REFUSED
    except Exception as error:
        raise Failure(f"{type(error).__name__}: {error}"[:500]) from error
    if found := _not_finite(result, name):
        raise Failure(f"{found} is not finite")
    return DONE


def _not_finite(value: Any, path: str) -> str:
    """Return the path of a number in a result that is not finite, or an empty text."""
    if re.search("|".join(_NEVER_NUMBERS), path):
        return ""
    if isinstance(value, np.ndarray):
        return path if value.dtype.kind in "fc" and not np.isfinite(value).all() else ""
    if isinstance(value, float | np.floating):
        return "" if np.isfinite(value) else path
    if isinstance(value, list | tuple):
        found = (_not_finite(item, f"{path}[{index}]") for index, item in enumerate(value[:1000]))
        return next(filter(None, found), "")
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        found = (
            _not_finite(getattr(value, item.name), f"{path}.{item.name}")
            for item in dataclasses.fields(value)
        )
        return next(filter(None, found), "")
    return ""
