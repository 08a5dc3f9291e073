"""What a campaign file says of a sweep: its key `vary`, and the lists under `analysis`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tdint.campaign.sweep import DISTRIBUTIONS, Distribution, ParameterSweep
from tdint.errors import UsageError
from tdint.methods.catalogue import parse as parse_method
from tdint.model.keys.fields import Value
from tdint.model.keys.kinds import ANY, POSITIVE, Bounds, Key, Keys, Schema, Whole
from tdint.model.variation import PARAMETERS, check_parameter, check_value

_NUMBER = Bounds(ratio=True)
_SAMPLES = (
    Key("samples", Whole(1, 100_000), "draws of the random parameters, by a Latin hypercube"),
    Key("seed", Whole(0, 2**31 - 1), "what they are drawn from"),
)
_RANDOM = {
    kind: Keys(tuple(Key(name, _NUMBER, needed=True) for name in numbers)) for kind, numbers in DISTRIBUTIONS.items()
}
_WHAT = "a list of values, or a distribution such as {lognormal: {median: 1, beta: 0.2}}"


@dataclass(frozen=True)
class Varied:
    """Parameters with their values or distributions, samples and a seed."""

    def schema(self) -> Schema:
        """The JSON schema; a story's own factor has its number in its name."""
        values = {"type": "array", "items": _NUMBER.schema(), "minItems": 1}
        random = {"type": "object", "properties": {kind: keys.schema() for kind, keys in _RANDOM.items()}}
        either = {"anyOf": [values, random | {"additionalProperties": False, "minProperties": 1, "maxProperties": 1}]}
        named = {name: {"description": meaning, **either} for name, meaning in PARAMETERS.items()}
        pattern = {r"^story [0-9]+\.(mass|stiffness|strength)_factor$": either}
        return {
            "type": "object",
            "properties": named | {key.name: {"description": key.meaning, **key.kind.schema()} for key in _SAMPLES},
            "patternProperties": pattern,
            "additionalProperties": False,
        }


def positive(value: Value) -> float | None:
    """A positive number; None after a fault."""
    number = value.number(POSITIVE)
    return None if math.isnan(number) else number


def read_sweep(vary: Value | None, analysis: Value | None, *, models: bool) -> ParameterSweep | None:
    """The sweep of a campaign; None without any. Faults are noted.

    Parameters
    ----------
    vary, analysis : Value or None
        The values of these keys.
    models : bool
        Whether the buildings are model files.
    """
    methods, dt = (analysis.peek(name) if analysis else None for name in ("methods", "dt"))
    steps = dt if dt and dt.is_list else None
    for value in (methods, steps):
        if value and not models:
            value.fault("lists of methods and steps are of `models`; an inventory has one of each")
            return None
    if not (vary or methods or steps):
        return None
    texts = (methods.items("a list of methods") if methods else None) or ()
    numbers = (steps.items("a list of steps") if steps else None) or ()
    grids: dict[str, tuple[float, ...]] = {}
    random: dict[str, Distribution] = {}
    samples, seed = (_read_vary(vary, grids, random) if vary else None) or (0, 0)
    return ParameterSweep(
        grids,
        random,
        samples,
        seed,
        methods=tuple(dict.fromkeys(found.label for item in texts if (found := item.parsed(parse_method)))),
        steps=tuple(dict.fromkeys(number for item in numbers if (number := positive(item)))),
    )


def _read_vary(
    value: Value, grids: dict[str, tuple[float, ...]], random: dict[str, Distribution]
) -> tuple[int, int] | None:
    """Fill grids and distributions; samples and seed."""
    names = value.names
    section = value.section([key.name for key in _SAMPLES] + names)
    if section is None:
        return None
    for name in names:
        entry = section.get(name)
        if entry is None or name in ("samples", "seed"):
            continue
        try:
            check_parameter(name)
        except UsageError as error:
            entry.fault(str(error))
            continue
        if entry.is_mapping:
            if found := _distribution(entry):
                random[name] = found
        else:
            grids[name] = _values(entry, name)
    counted, seeded = section.get("samples"), section.get("seed")
    samples = counted.whole(1, 100_000) if counted else None
    seed = seeded.whole(0, 2**31 - 1) if seeded else 0
    if random and not counted:
        value.fault("random parameters need `samples`: how many are drawn")
    if counted and not random:
        counted.fault("has nothing to act on without a random parameter")
    return samples or 0, seed or 0


def _values(entry: Value, name: str) -> tuple[float, ...]:
    found: dict[float, None] = {}
    for item in entry.items(_WHAT) or ():
        number = item.number(_NUMBER if name == "damping" else ANY)
        try:
            if not math.isnan(number):
                check_value(name, number)
                found[number] = None
        except UsageError as error:
            item.fault(str(error))
    return tuple(found)


def _distribution(entry: Value) -> Distribution | None:
    section = entry.section(list(DISTRIBUTIONS))
    kinds = [kind for kind in DISTRIBUTIONS if section and section.has(kind)]
    if section is None or len(kinds) != 1:
        if section is not None:
            entry.fault(f"must be {_WHAT}")
        return None
    inner = section.get(kinds[0])
    names = DISTRIBUTIONS[kinds[0]]
    numbers = inner.section(names) if inner else None
    if numbers is None or inner is None:
        return None
    first, second = (numbers.number(name, _NUMBER) for name in names)
    if math.isnan(first) or math.isnan(second):
        return None
    try:
        return Distribution(kinds[0], first, second)
    except UsageError as error:
        inner.fault(str(error))
        return None
