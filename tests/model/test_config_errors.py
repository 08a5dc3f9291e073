"""What is wrong with a model file: place, key and words of every fault, all of them in one error."""

import io
import os
import re
import sys
from pathlib import Path

import pytest

from tdint.errors import ModelError, ModelFault
from tdint.model.config.model_file import load_model
from tdint.model.keys import document as config

KEYS = (
    "name, units, stories, building, damping, p_delta, excitation, initial, analysis, collapse_drift, damage, "
    "output_units"
)
STORY_KEYS = "mass, weight, height, stiffness, law, dashpot, isolator, repeat"
THREE = "stories: [{repeat: 3, mass: 1, stiffness: 1}]\n"
RATIO = "must be a number of at least 0 and below 1"


def faults(text: str) -> list[str]:
    """The faults of a file as `line:column: key: message`."""
    with pytest.raises(ModelError) as caught:
        load_model(io.StringIO(text))
    problems = caught.value.faults
    assert str(caught.value) == "\n".join(map(str, problems))
    assert all(problem.source == "<stream>" and "\n" not in str(problem) for problem in problems)
    return [str(problem).removeprefix("<stream>:") for problem in problems]


def test_all_faults_at_once_in_file_order(tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(
        "storeys: 3\n"
        "units: {length: m, force: kn}\n"
        "stories:\n"
        "  - mass: 200\n"
        "    stiffness: 1\n"
        "  - mass: abc\n"
        "    stifness: 1\n"
        "    law: {type: bilinear, yield_force: -1}\n"
        "damping: {rayleigh: {ratio: 5, modes: [1, 7]}}\n"
        "p_delta: yes\n"
        "analysis:\n"
        "  dt: 0\n"
        "  dt: 0.01\n"
    )
    with pytest.raises(ModelError) as caught:
        load_model(path)
    assert caught.value.exit_code == 3
    assert caught.value.faults[2] == ModelFault(
        str(path), 6, 11, "stories[2].mass", "must be a positive number, got 'abc'"
    )
    assert [str(problem).removeprefix(str(path)) for problem in caught.value.faults] == [
        ":1:1: storeys: unknown key; did you mean 'stories'?",
        ":2:27: units.force: unknown force unit 'kn'; did you mean 'kN'?",
        ":6:11: stories[2].mass: must be a positive number, got 'abc'",
        ":7:5: stories[2].stifness: unknown key; did you mean 'stiffness'?",
        f":8:10: stories[2].law.hardening: is missing; give {RATIO.removeprefix('must be ')}",
        ":8:40: stories[2].law.yield_force: must be a positive number, got '-1'",
        f":9:29: damping.rayleigh.ratio: {RATIO}, got '5'",
        ":9:43: damping.rayleigh.modes[2]: must be a whole number from 1 to 2 (the number of stories), got '7'",
        ":10:10: p_delta: must be true or false, got 'yes'",
        ":12:7: analysis.dt: must be a positive number, got '0'",
        ":13:3: analysis.dt: duplicate key, first given on line 12",
    ]


def test_entries_count_from_one_whatever_repeat_says() -> None:
    text = "stories:\n  - {repeat: 9, mass: 1, stiffness: 1}\n  - {mass: 0, stiffness: 1}"
    assert faults(text) == ["3:12: stories[2].mass: must be a positive number, got '0'"]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", "1:1: the model file is empty; it needs at least `stories`"),
        ("# nothing\n", "2:1: the model file is empty; it needs at least `stories`"),
        ("---\n", f"2:1: must be a mapping with the keys {KEYS}, got nothing"),
        ("- a\n", f"1:1: must be a mapping with the keys {KEYS}, got a list"),
        ("abc", f"1:1: must be a mapping with the keys {KEYS}, got 'abc'"),
        ("a: 1\nb: \x00", "2:4: the character U+0000 cannot stand in a YAML file; remove it"),
        ('"\\UFFFFFFFF"', "1:4: not valid YAML: the number here is too large for a character or a version"),
        ('"\\U00110000"', "1:4: not valid YAML: the number here is too large for a character or a version"),
        ("[" * 5000, "1:34: nested more than 32 levels deep; this is no model file"),
        ("stories: &a\n  - *a", "2:5: the alias *a stands inside its own anchor"),
        ("stories: *x", "1:10: the alias *x has no anchor &x above it"),
        ("---\na: 1\n---\nb: 2", "3:1: a second YAML document begins here; a model file holds one"),
    ],
)
def test_not_a_model_file(text: str, fault: str) -> None:
    assert faults(text) == [fault]


@pytest.mark.parametrize(
    ("text", "place", "advice"),
    [
        ("a: b: c", "1:5", ""),
        ("stories: [{mass: 1\n", "2:1", ""),
        ("a:\n\tb: 1", "2:1", "; indent with spaces, not tabs"),
    ],
)
def test_not_yaml(text: str, place: str, advice: str) -> None:
    """Place and advice; the words between them are PyYAML's, on one line."""
    (fault,) = faults(text)
    assert re.fullmatch(rf"{place}: not valid YAML: [^;]*\w[^;]*{advice}", fault), fault


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "stories: !!python/object:os.x [ls]",
            [
                "1:10: the tag tag:yaml.org,2002:python/object:os.x is not allowed; write the value without it",
                f"1:32: stories[1]: must be a mapping with the keys {STORY_KEYS}, got 'ls'",
            ],
        ),
        (
            "stories: [{mass: !!float 3, stiffness: 1}]",
            ["1:18: the tag tag:yaml.org,2002:float is not allowed; write the value without it"],
        ),
        (THREE + "name: ! x", ["2:7: the tag ! is not allowed; write the value without it"]),
        (
            "x: &a {mass: 1}\nstories: [{<<: *a, stiffness: 1}]",
            [
                f"1:1: x: unknown key; known: {KEYS}",
                "2:12: stories[1].<<: merge keys are not supported; write the entries out",
            ],
        ),
        (THREE + "? [a]\n: b", ["2:3: a key must be a word, got a list or a mapping"]),
        (THREE + '"a b\\n": 3', [f"2:1: 'a b\\n': unknown key; known: {KEYS}"]),
        (THREE + "name: x\nname: y", ["3:1: name: duplicate key, first given on line 2"]),
    ],
)
def test_tags_and_keys(text: str, expected: list[str]) -> None:
    assert faults(text) == expected


def test_long_value_is_quick() -> None:
    (fault,) = faults(f"stories: [{{mass: {'0' * 200_000}x, stiffness: 1}}]")
    assert fault == f"1:18: stories[1].mass: must be a positive number, got '{'0' * 37}...'; write the number alone"


def test_alias_bomb_is_just_an_unknown_key() -> None:
    lines = ["a0: &a0 [x]"] + [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 40)]
    found = faults("\n".join(lines))
    assert len(found) == 41
    assert found[0] == f"1:1: a0: unknown key; known: {KEYS}"
    assert "1:1: stories: is missing; give a list with one entry per story, or a building in its place" in found


def refusal(source: str | Path) -> str:
    with pytest.raises(ModelError) as caught:
        load_model(source)
    return str(caught.value)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    missing = tmp_path / "none.yaml"
    assert refusal(missing) == f"{missing}: no such file; give a model file (YAML) or - for standard input"
    assert refusal(str(tmp_path)) == f"{tmp_path}: is a folder; give a model file (YAML) in it"
    assert refusal("") == ".: is a folder; give a model file (YAML) in it"
    assert refusal("a\0b") == "a\0b: cannot be read: no file has a null character in its name"
    assert refusal(f"{tmp_path}/{'x' * 300}").endswith("cannot be read: File name too long")


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root reads everything")
def test_file_without_permission(tmp_path: Path) -> None:
    path = tmp_path / "locked.yaml"
    path.touch(mode=0)
    assert refusal(path) == f"{path}: cannot be read: Permission denied"


def test_file_that_is_not_text(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_bytes("# Büro\nname: B".encode() + b"\xfcro\n")
    assert refusal(path) == f"{path}:2:8: not UTF-8 text (byte 0xfc); save the model file as UTF-8"
    path.write_text("name: x", encoding="utf-16")
    assert refusal(path) == f"{path}:1:1: not UTF-8 text (byte 0xff); save the model file as UTF-8"


def test_file_that_is_too_large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(config, "MAX_BYTES", 2 * 1024 * 1024)
    path = tmp_path / "m.yaml"
    path.write_text("#" * (2 * 1024 * 1024 + 1))
    assert refusal(path) == f"{path}: larger than 2 MiB; this is no model file"


def test_closed_standard_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    assert refusal("-") == "-: standard input is closed; give a model file"


def test_streams_that_are_not_utf8(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_bytes(b"name: \xfc\n")
    with path.open(encoding="utf-8", errors="surrogateescape") as stream, pytest.raises(ModelError) as caught:
        load_model(stream)
    assert str(caught.value) == f"{path}:1:7: not UTF-8 text (byte 0xed); save the model file as UTF-8"
    with path.open(encoding="utf-8") as stream, pytest.raises(ModelError, match=r"m\.yaml: cannot be read: "):
        load_model(stream)
