"""A few damaged inputs of every kind; `python tests/fuzz/run.py` does the same by the hundred thousand."""

from collections import Counter

import pytest

from fuzz import api, command_lines, model_files, stores, studies
from fuzz import names as file_names
from fuzz.corpus import corpus
from fuzz.mutators import mutated
from fuzz.oracle import REFUSED, SAME, Failure, outcome, read
from fuzz.printed import check
from fuzz.run import BITS, flipped_bits
from fuzz.sandbox import MODELS, run, sandbox
from tdint.ground_motion.reading import contents

SOUNDS = corpus()
EACH = 24
SLOW = {"order", "failures", "chart", "campaign", "ida", "scale", "fragility", "compare"}
"""Commands whose seeds `run.py` alone tries."""


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


@pytest.fixture(scope="module")
def work():
    """The working directory is a sandbox."""
    with sandbox():
        yield


@pytest.mark.parametrize("name", MODELS)
def test_damaged_model_files(work, name):
    text = MODELS[name]
    assert model_files.outcome(text, text) == model_files.SAME
    found = Counter(model_files.outcome(text, model_files.damaged(text, seed)) for seed in range(EACH))
    assert found[model_files.REFUSED] > 0
    assert found[model_files.RUNS] > 0


@pytest.mark.parametrize("name", studies.STUDIES)
def test_damaged_studies(work, name):
    """Before the damage all end well; after it some do, some do not."""
    assert {run(list(line)) for line in studies.STUDIES[name].lines} == {"done"}
    found = Counter(studies.outcome(name, seed) for seed in range(10))
    assert 0 < found["done"] < sum(found.values())


@pytest.mark.parametrize("name", stores.CALLS)
def test_damaged_stores(work, name):
    """Healing is rarer than one in so few; tests/cli/test_campaign_store.py has it, damage by damage."""
    found = Counter(stores.outcome(name, seed) for seed in range(EACH))
    assert 0 < found[stores.REFUSED] < EACH


@pytest.mark.parametrize("name", file_names.names())
def test_strange_names_and_long_runs(work, name):
    found = Counter(file_names.outcome(name, seed) for seed in range(EACH // 8 if name == "memory" else EACH))
    assert sum(found.values()) > 0


@pytest.mark.parametrize("name", sorted(set(command_lines.names()) - SLOW))
def test_command_lines(work, name):
    for seed in range(EACH // 4):
        run(command_lines.command_line(name, seed))


@pytest.mark.parametrize("name", api.CALLS)
@pytest.mark.filterwarnings("ignore")
def test_calls(work, name):
    found = Counter(api.outcome(name, seed) for seed in range(EACH))
    assert min(found[one] for one in api.OUTCOMES) > 0


@pytest.mark.parametrize(
    ("code", "stdout", "stderr", "files", "message"),
    [
        (1, b"", "Error: a bug", {}, "exit code 1"),
        (0, b"a,b\n1,inf\n", "", {}, "inf in"),
        (0, b"a,b\n1,nan\n", "", {}, "nan in"),
        (0, b"a,b\n1\n", "", {}, "1 cells below 2"),
        (0, b"a,b\n1,2", "", {}, "is cut off"),
        (0, b"a\n\x1b[31m\n", "", {}, "control character"),
        (0, b"a\n=cmd()\n", "", {}, "the formula"),
        (0, b'a\n"1\n2"\n', "", {}, "a cell of two lines"),
        (0, "a\n\u202eb\n".encode(), "", {}, "control character"),
        (0, b"", "note: the peak is inf m", {}, "inf on standard error"),
        (0, b"", "Warning: overflow encountered in divide", {}, "encountered in"),
        (2, b"", "Error: \x1b[31m", {}, "control character"),
        (2, b"", "Error: " + "x" * 3000, {}, "a line of 3007"),
        (4, b"", "", {}, "without a line that tells why"),
        (0, b"", "", {"out/.tdint-1.tmp": b"x"}, "temporary file"),
        (0, b"", "", {"out/t.csv": b""}, "is empty"),
        (0, b"", "", {"out/t.json": b'{"a": NaN}'}, "NaN is no JSON"),
    ],
)
def test_the_oracle_sees_what_must_not_be_printed(code, stdout, stderr, files, message):
    with pytest.raises(Failure, match=message):
        check(code, stdout, stderr, files)


def test_the_oracle_passes_what_may_be_printed():
    assert check(0, b"a,b\n-1.5,inf.txt\n", "note: inf.txt is read", {"out/t.csv": b"a\n1\n"}) == "done"
    assert check(2, b"", "Error: nan is not a finite number", {}) == "usage"


def test_the_oracle_sees_what_is_not_compared(monkeypatch):
    """Without the comparison of the counts a lost line of a text is a silent change."""
    sound = next(one for one in SOUNDS if one.name == "SLIST")
    before = read(sound.data, sound.units)
    wrong = sound.data.replace(b"100 samples", b"94 samples")
    assert outcome(sound, before, wrong) == REFUSED
    monkeypatch.setattr(contents, "compare_with_statements", lambda *_: ("number of samples",))
    lines = sound.data.splitlines(keepends=True)
    with pytest.raises(Failure, match="changed without a word: 94 samples of 100"):
        outcome(sound, before, b"".join([*lines[:3], *lines[4:]]))
