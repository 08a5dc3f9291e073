"""Studies from a seed: one of the input files of a valid command line is changed, and the outcome
is checked.

Printed output and written files are checked (`fuzz.printed`), including the directory of a
campaign.
"""

import math
import random
import re
from dataclasses import dataclass
from pathlib import Path

from fuzz.model_files import damaged
from fuzz.sandbox import replaced, run
from fuzz.study_files import CAMPAIGN, COMPARE, MATCH, SELECT

_NUMBER = re.compile(r"(?<![\w.+-])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")
_NUMBERS = (
    "0", "1", "-1", "3", "0.01", "0.5", "100", "1e5", "1e9", "1e-9", "1e100", "-1e100",
    "1e308", "1e-308", "5e-324",
)  # fmt: skip

_COMPARE = [("compare", *item) for item in COMPARE]
_SCALES, _LEVELS, _TOWN, _FACTORS, _PAIRS, _ASSETS = ([("campaign", *item)] for item in CAMPAIGN)


@dataclass(frozen=True)
class Study:
    """Command lines, and the files one of which is changed before one of the command lines."""

    lines: list[tuple[str, ...]]
    files: tuple[str, ...]


STUDIES = {
    "compare": Study(_COMPARE, ("recorded.yaml", "sensors.yaml", "history.csv")),
    "campaign of models": Study([*_SCALES, *_LEVELS], ("scales.yaml", "levels.yaml")),
    "campaign with factors": Study(_FACTORS, ("factors.yaml", "factors.csv")),
    "campaign of a town": Study(
        _TOWN, ("town.yaml", "town.csv", "grid.csv", "here.csv", "pair.json", "single.json")
    ),
    "campaign of pairs": Study(_PAIRS, ("pairs.yaml", "limited.yaml")),
    "campaign of assets": Study(_ASSETS, ("assets.yaml", "assets.xml", "mapping.csv")),
    "limits": Study(
        [
            ("run", "limited.yaml", "a.txt", "n.mseed", "--units", "m/s^2"),
            ("run", "limited.yaml", "a.txt", "--report", "out/page.html"),
        ],
        ("limited.yaml",),
    ),
    "match": Study([("match", *item) for item in MATCH], ("target.csv", "suite/1.txt")),
    "select": Study(
        [
            ("scale", *SELECT),
            ("scale", *SELECT, "--events", "events.csv", "--per-event", "1"),
            ("scale", *SELECT, "--target-std", "scatter.csv"),
        ],
        ("target.csv", "events.csv", "scatter.csv"),
    ),
    "inventory": Study([("inventory", "town.csv", "--units", "ft")], ("town.csv",)),
    "scale": Study(
        [("scale", "a.txt", "n.mseed", "--units", "m/s^2", "--target", "target.csv")],
        ("target.csv",),
    ),
    "law": Study([("law", "bilinear.yaml", "--path", "path.csv")], ("path.csv",)),
    "fragility": Study(
        [
            ("fragility", "stripes.csv"),
            ("fragility", "capacities.csv"),
            ("fragility", "cloud.csv", "--threshold", "1%,2%", "--edp-range", "0.002:"),
        ],
        ("stripes.csv", "capacities.csv", "cloud.csv"),
    ),
}
"""By name."""

WEIGHTS = {
    "compare": 4,
    "campaign of models": 4,
    "campaign of a town": 4,
    "campaign with factors": 2,
}
"""How often a study is tried; once where it is not here."""


def names() -> list[str]:
    """Return the names of the studies, repeated by their weights."""
    return [name for name in STUDIES for _ in range(WEIGHTS.get(name, 1))]


def outcome(name: str, seed: int) -> str:
    """Return the outcome of a study with a changed file within a sandbox; raise Failure for
    forbidden behavior."""
    study, source = STUDIES[name], random.Random(f"{name} {seed}")
    line = source.choice(study.lines)
    file = source.choice(_read_by(study, line))
    text = Path(file).read_text()
    wrong = text
    while wrong == text or _takes_long(wrong):
        wrong = (
            _other_numbers(text, source)
            if source.random() < 0.6 and _NUMBER.search(text)
            else damaged(text, source.randrange(2**31))
        )
    with replaced(file, wrong.encode("utf-8", "surrogateescape")):
        return run(list(line))


def _takes_long(text: str) -> bool:
    """Return True if a campaign requests millions of steps, which is allowed."""
    return any(
        not low <= float(found[1]) <= high
        for name, low, high in (("dt", 1e-4, math.inf), ("duration", -math.inf, 30.0))
        for found in re.finditer(rf"\b{name}: ({_NUMBER.pattern})", text)
    )


def _other_numbers(text: str, source: random.Random) -> str:
    """Return the text with other numbers at some positions. Most readers accept it, so that the
    computation is tested."""
    for _ in range(source.choice((1, 1, 2, 3))):
        match = source.choice(list(_NUMBER.finditer(text)))
        near = (
            f"{float(match[0]) * source.choice((0.5, 2.0, 10.0, -1.0, 1e-3, 1e3)):.6g}",
            match[0] + "0",
        )
        text = (
            text[: match.start()]
            + source.choice((*near, source.choice(_NUMBERS)))
            + text[match.end() :]
        )
    return text


def _read_by(study: Study, line: tuple[str, ...]) -> list[str]:
    """Return the files of a study that a command line reads: files in the command line, and files
    in no command line."""
    named = {word for item in study.lines for word in item}
    return [item for item in study.files if item in line or item not in named]
