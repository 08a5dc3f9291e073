"""A few damaged files of every format; `python tests/fuzz/run.py` does the same by the hundred thousand."""

from __future__ import annotations

import random
from collections import Counter
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from fuzz.corpus import corpus
from fuzz.mutators import mutated
from fuzz.oracle import REFUSED, SAME, Failure, outcome, read
from fuzz.run import BITS, flipped_bits
from tdint.errors import ModelError, TdintError
from tdint.ground_motion.reading import plugins
from tdint.ground_motion.record import Record
from tdint.model.config.read import load_model

SOUNDS = corpus()
EACH = 40
CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.mark.parametrize("place", range(len(SOUNDS)), ids=[sound.name for sound in SOUNDS])
def test_damaged_files(place):
    sound = SOUNDS[place]
    before = read(sound.data, sound.units)
    assert outcome(sound, before, sound.data) == SAME
    found = Counter(outcome(sound, before, mutated(sound.data, seed)) for seed in range(EACH))
    assert found[REFUSED] > 0


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.slow) for name in BITS])
def test_every_bit_of_a_header(name):
    _, failures = flipped_bits(name, BITS[name])
    assert not failures


@pytest.mark.parametrize("name", ["ten-story", "fluid-dampers", "three-story-concrete", "hardening"])
def test_damaged_model_files(name):
    data = (CONFIGS / f"{name}.yaml").read_bytes()
    for seed in range(100):
        text = mutated(data, seed).decode("utf-8", "surrogateescape")
        try:
            load_model(StringIO(text))
        except ModelError as error:
            assert all(len(line) < 2000 for line in str(error).splitlines())


def test_arguments_of_records():
    strange = [0, -1, 1e-308, 1e308, float("nan"), float("inf"), None, "1", True, 1j, [], [0.0], [[1.0, 2.0]], {}, b"1"]
    source = random.Random(0)
    for _ in range(400):
        samples, dt = source.choice([[0.0, 1.0], np.arange(5), *strange]), source.choice([0.01, *strange])
        try:
            record = Record(samples, dt, "", "", "", "")
        except TdintError as error:
            assert len(str(error)) < 2000
        else:
            assert np.isfinite(record.acceleration).all()
            assert 0.0 < record.dt < np.inf


def test_the_oracle_sees_what_is_not_compared(monkeypatch):
    """Without the comparison of the counts a lost line of a text is a silent change."""
    sound = next(one for one in SOUNDS if one.name == "SLIST")
    before = read(sound.data, sound.units)
    wrong = sound.data.replace(b"100 samples", b"94 samples")
    assert outcome(sound, before, wrong) == REFUSED
    monkeypatch.setattr(plugins, "compare_with_statements", lambda *_: ("number of samples",))
    lines = sound.data.splitlines(keepends=True)
    with pytest.raises(Failure, match="changed without a word: 94 samples of 100"):
        outcome(sound, before, b"".join([*lines[:3], *lines[4:]]))
