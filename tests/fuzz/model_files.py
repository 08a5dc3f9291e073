"""Model files from a seed: valid files with changed numbers, words, bytes and lines, and their
outcomes.

A file is refused with a position for every error, or it is a valid model, which runs for a tenth of
a second under a record and prints no forbidden output (`fuzz.printed`).
"""

import functools
import io
import math
import random
import re
from pathlib import Path

from fuzz.mutators import mutated
from fuzz.oracle import LARGEST_MESSAGE, Failure
from fuzz.sandbox import MODELS, run
from tdint.errors import ModelError
from tdint.model.config.model_file import load_model
from tdint.model.definition import Model

REFUSED, SAME, FAILS = "refused", "unchanged", "changed, does not run"
RUNS = "changed, runs"
OUTCOMES = (REFUSED, SAME, FAILS, RUNS)

_CONFIGS = Path(__file__).parents[2] / "configs"
_WORD = re.compile(r"[^\s,:{}\[\]#]+")
_STRANGE = (
    "0", "-1", "1e308", "1e-308", "5e-324", "1e999", "nan", ".inf", "012", "1_0", "0,5",
    "5%", "'1'", "true", "null", "none", "[]", "{}", "[1, 2]", "*x", "&x", "!!int 3",
    "1e9", "99999999999999999999", "linear", "bilinear", "tanh", "cos", "kip", "in",
    "\x1b[31m", "\u202e", "\U0001f600", "-0", "1e-9", "1e5", "3", "0.5",
)  # fmt: skip
_KEYS = (
    "mass", "stiffness", "height", "repeat", "law", "type", "dashpot", "name", "units",
    "p_delta", "record", "file", "forces", "floor", "omega", "initial", "modal",
    "rayleigh", "ratio", "modes", "hardening", "yield_force",
)  # fmt: skip


def sound_models() -> dict[str, str]:
    """Return names and texts of the models of the sandbox and of fast models in `configs`."""
    small = (
        "fluid-dampers", "hardening", "three-story-concrete", "collapse-prone-frame",
        "ten-story-bilinear",
    )  # fmt: skip
    return MODELS | {f"{name}.yaml": (_CONFIGS / f"{name}.yaml").read_text() for name in small}


def damaged(text: str, seed: int) -> str:
    """Return the text after one to three changes, which are the same for the same seed."""
    source = random.Random(seed)
    for _ in range(source.choice((1, 1, 2, 3))):
        action = source.randrange(4)
        if action == 0:
            text = mutated(text.encode("utf-8", "surrogateescape"), source.randrange(2**31)).decode(
                "utf-8", "replace"
            )
            continue
        matches = list(_WORD.finditer(text))
        if not matches:
            break
        match = source.choice(matches)
        word = {
            1: source.choice(_STRANGE),
            2: source.choice(_KEYS),
            3: source.choice((match[0] * 2, match[0][:-1], "", source.choice(matches)[0])),
        }[action]
        text = text[: match.start()] + word + text[match.end() :]
    return text


def outcome(original: str, text: str) -> str:
    """Return the outcome of a changed model file within a sandbox; raise Failure for forbidden
    behavior."""
    model = sound(text)
    if model is None:
        return REFUSED
    if _same(model, _loaded(original)):
        return SAME
    content = text.encode("utf-8", "surrogateescape")
    result = run(["run", "-", "--record", "a.txt", "--duration", "0.1", "-o", "out/run"], content)
    run(["modes", "-"], content)
    return RUNS if result == "done" else FAILS


def sound(text: str) -> Model | None:
    """Return the valid model of a text, or None if all its errors have positions; otherwise raise
    Failure."""
    try:
        model = load_model(io.StringIO(text))
    except ModelError as error:
        _check_faults(error, text)
        return None
    except Exception as error:
        raise Failure(f"{type(error).__name__}: {error}") from error
    _check_sound(model)
    return model


@functools.cache
def _loaded(text: str) -> Model:
    return load_model(io.StringIO(text))


def _check_faults(error: ModelError, text: str) -> None:
    lines = len(text.splitlines())
    if not error.faults:
        raise Failure(f"refused without a fault: {error}")
    for fault in error.faults:
        if not (
            1 <= fault.line <= lines + 1
            and fault.column >= 1
            and fault.message
            and "\n" not in str(fault)
        ):
            raise Failure(f"a fault without its place: {fault}")
        if len(str(fault)) > LARGEST_MESSAGE:
            raise Failure(f"a message of {len(str(fault))} characters")


def _check_sound(model: Model) -> None:
    count = len(model.stories)
    numbers = [model.collapse_drift, *model.initial.displacement, *model.initial.velocity]
    is_sound = count > 0 and model.collapse_drift > 0.0
    for story in model.stories[:10]:
        numbers += [story.mass, story.stiffness, story.dashpot, *story.law.parameters]
        is_sound &= story.mass > 0.0 and story.stiffness > 0.0 and story.dashpot >= 0.0
        is_sound &= bool(not model.p_delta or story.height)
    for force in model.excitation.forces:
        numbers += [force.cosine, force.sine, force.omega]
        is_sound &= 1 <= force.floor <= count
    if not is_sound or not len(model.initial.displacement) == len(model.initial.velocity) == count:
        raise Failure(f"a story, a force or a start that is none: {model}"[:500])
    if not all(map(math.isfinite, numbers)):
        raise Failure(f"numbers that are not finite: {model}"[:500])


def _same(model: Model, other: Model) -> bool:
    """Return True if two models are equal except for their texts and names."""
    fields = (
        "stories", "damping", "p_delta", "excitation", "initial", "analysis",
        "collapse_drift",
    )  # fmt: skip
    return all(getattr(model, name) == getattr(other, name) for name in fields)
