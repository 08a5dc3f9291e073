"""Types of fuzzed input: records, model files, files of studies, stores, command lines, and calls
of the Python interface.

Each type has names and a function that returns the outcome for a name and a seed; it raises Failure
for forbidden behavior.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass

from fuzz import (
    api,
    changed_models,
    characters,
    command_lines,
    model_files,
    oracle,
    shards,
    stores,
    studies,
)
from fuzz import names as file_names
from fuzz.corpus import corpus
from fuzz.mutators import mutated
from fuzz.printed import CODES
from fuzz.sandbox import run


@dataclass(frozen=True)
class Kind:
    """Type of input: names of the cases, the function that runs a case, and its possible
    outcomes."""

    names: Callable[[], list[str]]
    outcome: Callable[[str, int], str]
    outcomes: tuple[str, ...]


@functools.cache
def _sounds() -> dict[str, oracle.Sound]:
    return {f"{number} {sound.name}": sound for number, sound in enumerate(corpus())}


@functools.cache
def _before(name: str) -> tuple[oracle.Record, ...]:
    """Return the content of a valid file."""
    sound = _sounds()[name]
    before = oracle.read(sound.data, sound.units)
    if oracle.outcome(sound, before, sound.data) != oracle.SAME:
        raise oracle.Failure("a sound file is not read twice as the same")
    return before


def _record(name: str, seed: int) -> str:
    sound = _sounds()[name]
    return oracle.outcome(sound, _before(name), mutated(sound.data, seed))


@functools.cache
def _models() -> dict[str, str]:
    return model_files.sound_models()


KINDS = {
    "records": Kind(lambda: list(_sounds()), _record, oracle.OUTCOMES),
    "models": Kind(
        lambda: list(_models()),
        lambda name, seed: model_files.outcome(
            _models()[name], model_files.damaged(_models()[name], seed)
        ),
        model_files.OUTCOMES,
    ),
    "changes": Kind(
        lambda: list(changed_models.NAMES), changed_models.outcome, changed_models.OUTCOMES
    ),
    "commands": Kind(
        command_lines.names,
        lambda name, seed: run(command_lines.command_line(name, seed)),
        tuple(CODES.values()),
    ),
    "characters": Kind(characters.names, characters.outcome, tuple(CODES.values())),
    "studies": Kind(studies.names, studies.outcome, tuple(CODES.values())),
    "stores": Kind(lambda: list(stores.CALLS), stores.outcome, stores.OUTCOMES),
    "names": Kind(file_names.names, file_names.outcome, tuple(CODES.values())),
    "shards": Kind(shards.names, shards.outcome, shards.OUTCOMES),
    "api": Kind(lambda: list(api.CALLS), api.outcome, api.OUTCOMES),
}
