"""Errors in model files: position, key and message of every error, with all errors of a file in one
exception."""

import io
import os
import re
import sys
from pathlib import Path

import pytest

from tdint.errors import ModelError, ModelFault
from tdint.model.config.model_file import load_model
from tdint.model.keys import document as config
from tdint.model.story_laws import LAWS

WORDS = {
    "<keys>": (
        "name, units, stories, building, stiffness_matrix, matrices, base, attachments, links, "
        "damping, p_delta, excitation, initial, analysis, collapse_drift, plausibility, damage, "
        "limits, output_units, report, x, y"
    ),
    "<story keys>": "mass, weight, height, stiffness, period, law, elements, dashpot, isolator, "
    "rayleigh, p_delta, inertance, flexural, rotary_inertia, repeat, x, y",
    "<rayleigh>": "must be {ratio: ..., modes: ...} or {mass: ..., stiffness: ...}",
    "<ratio>": "a number of at least 0 and below 1",
    "<laws>": ", ".join(LAWS),
}

# Each file is one line, with its lines joined by a pilcrow, followed by its errors; further
# indented lines continue the line above. Each type of error is tested once, for one key.
# test_schema.py tests that every key refuses invalid types.
FILES = r"""
stories: 3
    1:10: stories: must be a list of stories, got '3'
stories:
    1:9: stories: must be a list of stories, got nothing
stories: []
    1:10: stories: must contain at least one story
stories: [3]
    1:11: stories[1]: must be a mapping with the keys <story keys>, got '3'
stories: [{}]
    1:11: stories[1].mass: is missing; give a positive number, or `weight` instead
    1:11: stories[1].stiffness: is missing; give a positive number
stories: [{mass: 1, stiffness: -1, height: 0, dashpot: -2}]
    1:32: stories[1].stiffness: must be a positive number, got '-1'
    1:44: stories[1].height: must be a positive number, got '0'
    1:56: stories[1].dashpot: must be zero or a positive number, got '-2'
stories: [{mass: 1, stiffness: 1, dashpot: {coefficient: 0, exponent: 2.5}}]
    1:58: stories[1].dashpot.coefficient: must be a positive number, got '0'
    1:71: stories[1].dashpot.exponent: must be a number above 0 and of at most 2, got '2.5'
stories: [{mass: 1, stiffness: 1, dashpot: {coefficient: 1, exponent: 0.5}}]
    1:44: stories[1].dashpot.linear_below: is missing; an exponent below 1 requires the drift rate below which the
        dashpot is linear, or the stiffness of its `brace`
stories: [{mass: 1, stiffness: 1, dashpot: {coefficient: 1, exponent: 0.5, linear_below: 0, power: 2}}]
    1:90: stories[1].dashpot.linear_below: must be a positive number, got '0'
    1:93: stories[1].dashpot.power: unknown key; known: coefficient, exponent, linear_below, brace,
        relief, factor, angle
stories: [{repeat: 0, mass: 1, stiffness: 1}, {repeat: 2.0, mass: 1, stiffness: 1}]
    1:20: stories[1].repeat: must be a whole number from 1 to 100000, got '0'
    1:56: stories[2].repeat: must be a whole number from 1 to 100000, got '2.0'
stories: [{repeat: 60000, mass: 1, stiffness: 1}, {repeat: 60000, mass: 1, stiffness: 1}]
    1:51: stories[2]: the model has more than 100000 stories; check `repeat`
stories: !!python/object:os.x [ls]
    1:10: the tag tag:yaml.org,2002:python/object:os.x is not allowed; write the value without it
    1:32: stories[1]: must be a mapping with the keys <story keys>, got 'ls'
stories: [{mass: 1, stiffness: 1}]¶name: ! x
    2:7: the tag ! is not allowed; write the value without it
stories: [{mass: 1, height: 3,5, stiffness: 1}]
    1:31: stories[1].5: unknown key; a comma divides entries here: write a decimal point
z: &a {mass: 1}¶stories: [{<<: *a, stiffness: 1}]
    1:1: z: unknown key; known: <keys>
    2:12: stories[1].<<: merge keys are not supported; write the entries out
stories: [{mass: 1, stiffness: 1}]¶? [a]¶: b
    2:3: a key must be a word, got a list or a mapping
stories: [{mass: 1, stiffness: 1}]¶"a b\n": 3
    2:1: 'a b\n': unknown key; known: <keys>
# nothing¶
    2:1: the model file is empty; it needs at least `stories`
---¶
    2:1: must be a mapping with the keys <keys>, got nothing
- a
    1:1: must be a mapping with the keys <keys>, got a list
"\U00110000"
    1:4: not valid YAML: the number here is too large for a character or a version
stories: &a¶  - *a
    2:5: the alias *a is used inside its own anchor
stories: *x
    1:10: the alias *x has no anchor &x above it
---¶a: 1¶---¶b: 2
    3:1: a second YAML document starts here; a model file contains one
stories: [{mass: 1, law: {}}]
    1:26: stories[1].law.type: is missing; give one of <laws>
stories: [{mass: 1, weight: 1, stiffness: 1}]
    1:11: stories[1]: give either mass or weight, not both
stories:¶  - {repeat: 9, mass: 1, stiffness: 1}¶  - {mass: 0, stiffness: 1}
    3:12: stories[2].mass: must be a positive number, got '0'
units: {mass: t}¶stories: [{mass: 1e308, stiffness: 1e999}, {mass: 1e-999, stiffness: 1}]
    2:18: stories[1].mass: must have an absolute value between 1e-60 and 1e+60 in SI units, got
        '1e308'
    2:36: stories[1].stiffness: must have an absolute value between 1e-60 and 1e+60 in SI units,
        got '1e999'
    2:51: stories[2].mass: must have an absolute value between 1e-60 and 1e+60 in SI units, got
        '1e-999'
p_delta: true¶stories: [{mass: 1, stiffness: 1, height: 3}, {mass: 1, stiffness: 1}]
    2:47: stories[2].height: is missing; p_delta needs the height of every story; give it, or `p_delta: false` in this story
stories: [{mass: 1, stiffness: 1}]¶damping: {rayleigh: {ratio: 0.05, modes: [1, 1]}}
    2:21: damping.rayleigh: a one-story model has one mode; write damping: 5%,
        {rayleigh: {ratio: 5%, modes: [1]}} (proportional to the stiffness), {rayleigh: {mass: a0, stiffness: a1}}
        or {modal: ratio}
stories: [{repeat: x, mass: 1, stiffness: 1}]¶initial: {velocity: [1, 2]}¶damping: {modal: [0.05, 0.1]}
    1:20: stories[1].repeat: must be a whole number from 1 to 100000, got 'x'
stories: [{repeat: x, mass: 1, stiffness: 1}]¶excitation: {forces: [{floor: 9, amplitude: 1, omega: 1}]}
    1:20: stories[1].repeat: must be a whole number from 1 to 100000, got 'x'
storeys:¶  - {mass: 0, stifness: x}¶analisys: {method: a, dt: -1}¶exitation: {record: {file: a, scale: 0}}
    1:1: storeys: unknown key; did you mean 'stories'?
    2:12: storeys[1].mass: must be a positive number, got '0'
    2:15: storeys[1].stifness: unknown key; did you mean 'stiffness'?
    2:25: storeys[1].stifness: must be a positive number, got 'x'
    3:1: analisys: unknown key; did you mean 'analysis'?
    3:27: analisys.dt: must be a positive number, got '-1'
    4:1: exitation: unknown key; did you mean 'excitation'?
    4:38: exitation.record.scale: must not be zero; omit the record to run without ground motion
stories: [{mass: 1, stiffness: 1}]¶analysis: {dt: 1}¶analisys: {dt: 0}
    3:1: analisys: unknown key; did you mean 'analysis'?
stories: [{mass: 1, stiffness: 1}]¶output_units: kip, inch, g
    2:15: output_units: output units 'kip, inch, g': unknown unit 'inch'; did you mean 'in'?
"""  # noqa: E501

# A second line below that of three sound stories.
LINES = r"""
damping: 5
    2:10: damping: must be none, a ratio such as 5%, {rayleigh: ...} or {modal: ...}, got '5'; did you mean 5%?
damping: {}
    2:10: damping: must be none, a ratio such as 5%, {rayleigh: ...} or {modal: ...}, got a mapping without any of the keys rayleigh, modal
damping: {raileigh: 3}
    2:11: damping.raileigh: unknown key; did you mean 'rayleigh'?
    2:21: damping.raileigh: <rayleigh>, got '3'
damping: {modal: 0.05, rayleigh: {mass: 0, stiffness: 0}}
    2:10: damping: give either rayleigh or modal, not both
damping: {rayleigh: {}}
    2:21: damping.rayleigh: <rayleigh>, got a mapping without any of the keys ratio, modes, mass, stiffness
damping: {rayleigh: {ratio: 0.05}}
    2:21: damping.rayleigh.modes: is missing; give a list of two modes, or of one mode for damping
        proportional to the stiffness
damping: {rayleigh: {ratio: -0.1, modes: [2, 2]}}
    2:29: damping.rayleigh.ratio: must be <ratio>, got '-0.1'
    2:42: damping.rayleigh.modes: must be two different modes, got 2 twice
damping: {rayleigh: {ratio: [0.1, 0.2, 0.3], modes: [0, 4]}}
    2:29: damping.rayleigh.ratio: must be one damping ratio or a list of two, got 3
    2:54: damping.rayleigh.modes[1]: must be a whole number from 1 to 3 (the number of stories), got '0'
    2:57: damping.rayleigh.modes[2]: must be a whole number from 1 to 3 (the number of stories), got '4'
damping: {rayleigh: {ratio: [0.1], modes: 3}}
    2:29: damping.rayleigh.ratio: a list must contain at least two damping ratios; write a single ratio
        without brackets
    2:43: damping.rayleigh.modes: must be a list of two modes, or of one mode for damping
        proportional to the stiffness, got '3'
damping: {rayleigh: {ratio: 0.1, modes: [1, 2, 3]}}
    2:41: damping.rayleigh.modes: must be a list of two modes, or of one mode for damping
        proportional to the stiffness, got 3
damping: {rayleigh: {ratio: 0.1, mass: 3}}
    2:21: damping.rayleigh: give either ratio and modes or mass and stiffness, not both
damping: {rayleigh: {mass: -1}}
    2:21: damping.rayleigh.stiffness: is missing; give zero or a positive number
    2:28: damping.rayleigh.mass: must be zero or a positive number, got '-1'
damping: {modal: 105%}
    2:18: damping.modal: must be <ratio>, got '105%'
damping: {modal: [0.05, 1, 0.2, 0.3]}
    2:18: damping.modal: must be a list of at most 3 damping ratios (one per mode), got 4
    2:25: damping.modal[2]: must be <ratio>, got '1'
damping: {modal: {modes: 2}}
    2:18: damping.modal.ratio: is missing; give the damping ratio
excitation: {record: []}
    2:22: excitation.record: must be a file or a mapping with the key file, got a list
excitation: {record: {}}
    2:22: excitation.record.file: is missing; give the record's file
excitation: {record: {file: '', units: gels, scale: 0, component: [], inventory: ~}}
    2:29: excitation.record.file: must be text, got ''
    2:40: excitation.record.units: units 'gels': use one of m/s^2, cm/s^2, gal, mm/s^2, g, mg, %g, in/s^2,
        ft/s^2, with a factor before it for counts
    2:53: excitation.record.scale: must not be zero; omit the record to run without ground motion
    2:67: excitation.record.component: must be text, got a list
    2:82: excitation.record.inventory: must be text, got nothing
excitation: {record: {file: "a\nb", scale: .inf}}
    2:29: excitation.record.file: must be one line without control characters, got 'a\nb'
    2:44: excitation.record.scale: must be a number, got '.inf'; it must be finite
excitation: {record: {file: a, trim: 3, pad: x, baseline: linaer, filter_order: 2.5}}
    2:38: excitation.record.trim: trim must be START:END in seconds, got '3'
    2:46: excitation.record.pad: pad must be SECONDS or BEFORE:AFTER, got 'x'
    2:59: excitation.record.baseline: unknown baseline 'linaer'; did you mean 'linear'?
    2:81: excitation.record.filter_order: must be a whole number from 1 to 10, got '2.5'
excitation: {record: {file: a, trim: '3:2'}}
    2:22: excitation.record: trim must be START:END in seconds from the first sample with START below END
excitation: {record: {file: a, highpass: 3, lowpass: 2}}
    2:22: excitation.record: highpass (3 Hz) must be below lowpass (2 Hz), otherwise the filters remove the entire motion
excitation: {record: {file: a, filter_order: 3}}
    2:22: excitation.record: filter_order requires highpass or lowpass; specify one of them
excitation: {record: "\ud800"}
    2:22: excitation.record: must be one line without control characters, got '\ud800'
excitation: {forces: [3, {}, {floor: 4, amplitude: x, omega: -1, phase: tan}, {floor: 1, amplitude: 1, freq: 3}]}
    2:23: excitation.forces[1]: must be a mapping with the keys floor, amplitude, omega, phase, got '3'
    2:26: excitation.forces[2].floor: is missing; give the floor, counted from 1 at the bottom
    2:26: excitation.forces[2].amplitude: is missing; give a number
    2:26: excitation.forces[2].omega: is missing; give zero or a positive number
    2:38: excitation.forces[3].floor: must be a whole number from 1 to 3 (the number of stories), got '4'
    2:52: excitation.forces[3].amplitude: must be a number, got 'x'
    2:62: excitation.forces[3].omega: must be zero or a positive number, got '-1'
    2:73: excitation.forces[3].phase: must be cos, sin or an angle in radians, got 'tan'
    2:79: excitation.forces[4].omega: is missing; give zero or a positive number
    2:104: excitation.forces[4].freq: unknown key; known: floor, amplitude, omega, phase
initial: {displacement: 1, velocity: [1, 2]}
    2:25: initial.displacement: must be a list with one number per story, got '1'
    2:38: initial.velocity: must have one number per story (3), got 2
p_delta: 'true'
    2:10: p_delta: must be true or false, got 'true' in quotes; remove the quotes
units: {length: metre, force: KN, mass: , time: s}
    2:17: units.length: unknown length unit 'metre'; did you mean 'm'?
    2:31: units.force: unknown force unit 'KN'; did you mean 'kN'?
    2:40: units.mass: must be the name of a mass unit, got nothing
    2:43: units.time: unknown key; known: length, force, mass
"""  # noqa: E501

# Laws of a story with a valid mass, without the positions, which are those of the keys above.
LAWS_OF_A_STORY = r"""
bilinar
    stories[1].law: unknown law 'bilinar'; did you mean 'bilinear'?
[a]
    stories[1].law: must be a law, got a list; several laws in one story are written as `elements: [{type: ..., stiffness: ...}, ...]`
bilinear
    stories[1].stiffness: is missing; give a positive number
    stories[1].law: the bilinear law requires parameters; write {type: bilinear, yield_force: ..., hardening:
        ...}
{type: bilinear, yield_forc: 3, hardening: 1}, stiffness: 1
    stories[1].law.yield_forc: unknown key; did you mean 'yield_force'?
    stories[1].law.hardening: must be a number above -1 and below 1, got '1'
{type: bilinear, coefficients: [1]}, stiffness: 1
    stories[1].law.yield_force: is missing; give a positive number
    stories[1].law.hardening: is missing; give a number above -1 and below 1
    stories[1].law.coefficients: unknown key; known: type, fracture_drift, yield_force, hardening, negative
{type: polynomial, coefficients: [-3, x]}
    stories[1].law.coefficients[2]: must be a number, got 'x'
{type: polynomial, coefficients: [-3, 1]}
    stories[1].law: the initial stiffness of the polynomial law must be a positive number, got -3
{type: polynomial, coefficients: [0]}, stiffness: 3
    stories[1].law: the initial stiffness of the polynomial law must be a positive number, got 0
{type: polynomial, coefficients: [3, 1]}, stiffness: 3.1
    stories[1].stiffness: must agree with the initial stiffness 3 of its polynomial law, got 3.1; correct it or
        omit it
"""  # noqa: E501


def cases(table: str) -> list[tuple[str, list[str]]]:
    """Return the invalid model texts of a table with their error messages."""
    for short, replacement in WORDS.items():
        table = table.replace(short, replacement)
    blocks = re.split(r"\n(?! )", table.strip("\n").replace("\n        ", " "))
    return [
        (text.replace("¶", "\n"), faults.split("\n    "))
        for text, _, faults in (b.partition("\n    ") for b in blocks)
    ]


def faults(text: str) -> list[str]:
    """Return the errors of a file as `line:column: key: message`."""
    with pytest.raises(ModelError) as caught:
        load_model(io.StringIO(text))
    problems = caught.value.faults
    assert str(caught.value) == "\n".join(map(str, problems))
    assert all(problem.source == "<stream>" and "\n" not in str(problem) for problem in problems)
    return [str(problem).removeprefix("<stream>:") for problem in problems]


@pytest.mark.parametrize(("text", "expected"), cases(FILES))
def test_errors_of_files(text: str, expected: list[str]) -> None:
    assert faults(text) == expected


@pytest.mark.parametrize(("line", "expected"), cases(LINES))
def test_errors_of_single_keys(line: str, expected: list[str]) -> None:
    assert faults(f"stories: [{{repeat: 3, mass: 1, stiffness: 1}}]\n{line}") == expected


@pytest.mark.parametrize(("law", "expected"), cases(LAWS_OF_A_STORY))
def test_errors_of_laws(law: str, expected: list[str]) -> None:
    found = faults(f"units: {{force: kN, mass: kg}}\nstories: [{{mass: 1, law: {law}}}]")
    assert [fault.split(": ", 1)[1] for fault in found] == expected


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("a: 1\nb: \x00", "2:4: invalid character U+0000 in a YAML file; remove it"),
        ("[" * 5000, "1:34: more than 32 nested levels; this is not a model file"),
    ],
)
def test_invalid_characters_and_nesting_are_refused(text: str, fault: str) -> None:
    assert faults(text) == [fault]


def test_excessive_coefficients_in_si_are_refused() -> None:
    found = faults(
        "units: {length: mm, mass: kg}\n"
        f"stories: [{{mass: 1, law: {{type: polynomial, coefficients: "
        f"[{', '.join(['1'] * 110)}]}}}}]"
    )
    beyond = "must have an absolute value between 1e-60 and 1e+60 in SI units"
    assert found[0].endswith(f"stories[1].law.coefficients[21]: {beyond}, got '1'")


def test_errors_have_positions_in_order_of_file(tmp_path: Path) -> None:
    """Error messages of the command start with the position. All errors of a file are reported in
    the order of the file (`storeys` is before the others)."""
    path = tmp_path / "bad.yaml"
    path.write_text(
        "stories:\n  - mass: 200\n    stiffness: 1\n  - mass: abc\n    stiffness: 1\np_delta: "
        "yes\np_delta: no\n"
    )
    with pytest.raises(ModelError) as caught:
        load_model(path)
    assert caught.value.exit_code == 3
    first, *others = caught.value.faults
    assert first == ModelFault(
        str(path), 4, 11, "stories[2].mass", "must be a positive number, got 'abc'"
    )
    assert [str(fault).removeprefix(str(path)) for fault in others] == [
        ":6:10: p_delta: must be true or false, got 'yes'",
        ":7:1: p_delta: duplicate key, first given on line 6",
    ]


@pytest.mark.parametrize(
    ("text", "position", "advice"),
    [
        ("a: b: c", "1:5", ""),
        ("stories: [{mass: 1\n", "2:1", ""),
        ("a:\n\tb: 1", "2:1", "; indent with spaces, not tabs"),
    ],
)
def test_invalid_yaml_is_refused(text: str, position: str, advice: str) -> None:
    """The error has a position and a remedy; the text between them is the message of PyYAML on one
    line."""
    (fault,) = faults(text)
    assert re.fullmatch(rf"{position}: not valid YAML: [^;]*\w[^;]*{advice}", fault), fault


def test_alias_bomb_is_refused() -> None:
    """A value that aliases repeat is read again at each of them, so that their number is limited:
    9^5 + 9^4 + ... values exceed the limit at the sixth list."""
    lines = ["a0: &a0 [x]"] + [
        f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 40)
    ]
    found = faults("\n".join(lines))
    assert len(found) == 1 and found[0].startswith("7:10: the aliases up to *a5 repeat more than")


@pytest.mark.parametrize(("aliases", "is_refused"), [(5, False), (7, True)])
def test_values_that_aliases_repeat_are_limited(
    aliases: int, is_refused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A list of 1000 points has 3001 values: six repetitions stay below a tenth of the limit."""
    assert config._MAX_ALIASED == 200_000
    monkeypatch.setattr(config, "_MAX_ALIASED", 20_000)
    points = ", ".join(f"[{i}, 1]" for i in range(1000))
    forces = f"  - {{floor: 1, points: &p [{points}]}}\n"
    forces += "  - {floor: 1, points: *p}\n" * aliases
    text = f"stories: [{{mass: 1, stiffness: 1}}]\nexcitation:\n  forces:\n{forces}"
    found = faults(text) if is_refused else []
    assert len(found) == is_refused
    if is_refused:
        assert "the aliases up to *p repeat more than 20000 values" in found[0]
    else:
        assert len(load_model(io.StringIO(text)).excitation.tables) == 1 + aliases


def refusal(source: str | Path) -> str:
    with pytest.raises(ModelError) as caught:
        load_model(source)
    return str(caught.value)


def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    missing = tmp_path / "none.yaml"
    assert re.fullmatch(
        rf"{re.escape(str(missing))}: .*not found; .*YAML.* - for .*", refusal(missing)
    )
    for directory, shown in ((str(tmp_path), str(tmp_path)), ("", ".")):
        message = refusal(directory)
        assert message.startswith(f"{shown}: ") and "directory; " in message
    assert re.fullmatch("a\0b: .*null character", refusal("a\0b"))
    assert refusal(f"{tmp_path}/{'x' * 300}").endswith("cannot be read: File name too long")


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root reads everything")
def test_file_without_permission_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "locked.yaml"
    path.touch(mode=0)
    assert refusal(path) == f"{path}: cannot be read: Permission denied"


def test_too_large_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(config, "MAX_BYTES", 2 * 1024 * 1024)
    path = tmp_path / "m.yaml"
    path.write_text("#" * (2 * 1024 * 1024 + 1))
    assert re.match(rf"{path}: larger than 2 MiB", refusal(path))


def test_closed_standard_input_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    assert re.fullmatch("-: standard input .*closed; .*model file", refusal("-"))


def test_stream_with_invalid_utf8_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_bytes(b"name: \xfc\n")
    with (
        path.open(encoding="utf-8", errors="surrogateescape") as stream,
        pytest.raises(ModelError) as caught,
    ):
        load_model(stream)
    assert re.fullmatch(rf"{path}:1:7: .*0xed.*; .*UTF-8", str(caught.value))
    with (
        path.open(encoding="utf-8") as stream,
        pytest.raises(ModelError, match=r"m\.yaml: cannot be read: "),
    ):
        load_model(stream)
