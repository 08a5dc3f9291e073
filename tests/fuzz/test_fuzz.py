"""A few mutated inputs of every type; `python tests/fuzz/run.py` tests hundreds of thousands."""

from collections import Counter

import pytest

from fuzz import api, changed_models, model_files, stores, studies, table_files
from fuzz.corpus import corpus
from fuzz.kinds import KINDS
from fuzz.oracle import REFUSED, Failure, outcome, read
from fuzz.printed import check
from fuzz.run import BITS, flipped_bits
from fuzz.sandbox import MODELS, run, sandbox
from selection import every
from tdint.ground_motion.reading import contents

SLOW = {"order", "failures", "chart", "campaign", "ida", "scale", "fragility", "compare", "match"}
"""Commands whose seeds `run.py` alone tries."""

TRIED: dict[str, tuple[int, set[str]]] = {
    "records": (6, {REFUSED}),
    "models": (6, {model_files.REFUSED, model_files.RUNS}),
    "changes": (6, {changed_models.REFUSED}),
    "commands": (2, set()),
    "characters": (3, {"usage"}),
    "studies": (8, {"done"}),
    # Recovery is too rare for so few cases; tests/cli/studies/test_campaign_store.py tests it for
    # each type of damage.
    "stores": (8, {stores.REFUSED}),
    "names": (12, set()),
    "api": (16, set(api.OUTCOMES)),
}
"""How many seeds of a kind are tried, and what some of them end with."""

MAX_SEEDS = {"memory": 2, "match": 6}
"""Largest numbers of seeds of names whose single calls take a second or longer."""

CASES = [
    pytest.param(
        kind,
        name,
        marks=[pytest.mark.long]
        * ((kind == "studies" and name != "run") or (kind, name) == ("names", "campaign")),
    )
    for kind in TRIED
    for name in dict.fromkeys(KINDS[kind].names())
    if not (kind in ("commands", "characters") and name in SLOW)
    and (kind != "models" or name in MODELS)
]


@pytest.fixture(scope="module")
def work():
    """Set the working directory to a sandbox."""
    with sandbox():
        yield


@pytest.mark.parametrize(("input_type", "name"), every(4, CASES))
@pytest.mark.usefixtures("short_matching")
@pytest.mark.filterwarnings("ignore")
def test_corrupt_inputs_have_expected_outcomes(work, input_type, name):
    seeds, some = TRIED[input_type]
    seeds = min(seeds, MAX_SEEDS.get(name, seeds))
    found = Counter(KINDS[input_type].outcome(name, seed) for seed in range(seeds))
    assert some <= set(found)
    assert len(found) > 1 or input_type not in ("studies", "stores"), "damage makes no difference"


@pytest.mark.parametrize(
    "name",
    every(
        3,
        [
            pytest.param(name, marks=[pytest.mark.long] * (name in ("limits", "compare")))
            for name in studies.STUDIES
        ],
    ),
)
@pytest.mark.usefixtures("short_matching")
def test_intact_studies_are_done(work, name):
    assert {run(list(line)) for line in set(studies.STUDIES[name].lines)} == {"done"}


@pytest.mark.parametrize("part", range(4))
def test_motions_of_random_tables(tmp_path, part):
    """No table is misread, no motion is refused, and damaged tables are refused."""
    seeds = range(50 * part, 50 * part + 50)
    found = {seed: table_files.outcome(seed, tmp_path / "table.txt") for seed in seeds}
    assert set(found.values()) == {table_files.RIGHT, table_files.REFUSED}, found


@pytest.mark.slow
@pytest.mark.parametrize("name", BITS)
def test_every_flipped_bit_of_header_is_detected(name):
    _, failures = flipped_bits(name, BITS[name])
    assert not failures


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
def test_oracle_detects_forbidden_output(code, stdout, stderr, files, message):
    with pytest.raises(Failure, match=message):
        check(code, stdout, stderr, files)


def test_oracle_accepts_valid_output():
    assert (
        check(0, b"a,b\n-1.5,inf.txt\n", "note: inf.txt is read", {"out/t.csv": b"a\n1\n"})
        == "done"
    )
    assert check(2, b"", "Error: nan is not a finite number", {}) == "usage"


def test_oracle_detects_missing_comparison(monkeypatch):
    """Without the comparison of the counts, a lost line of a text is not reported."""
    sound = next(candidate for candidate in corpus() if candidate.name == "SLIST")
    before = read(sound.data, sound.units)
    wrong = sound.data.replace(b"100 samples", b"94 samples")
    assert outcome(sound, before, wrong) == REFUSED
    monkeypatch.setattr(contents, "compare_with_statements", lambda *_: ("number of samples",))
    lines = sound.data.splitlines(keepends=True)
    with pytest.raises(Failure, match="changed without a word: 94 samples of 100"):
        outcome(sound, before, b"".join([*lines[:3], *lines[4:]]))
