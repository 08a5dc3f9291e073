"""What is wrong in the sections of a model file: place, key and words of every fault."""

import io

import pytest

from tdint.errors import ModelError
from tdint.model.config.model_file import load_model
from tdint.model.laws import LAWS

STORY_KEYS = "mass, weight, height, stiffness, law, dashpot, isolator, repeat"
THREE = "stories: [{repeat: 3, mass: 1, stiffness: 1}]\n"
RATIO = "must be a number of at least 0 and below 1"
RAYLEIGH = "must be {ratio: ..., modes: ...} or {mass: ..., stiffness: ...}"


def faults(text: str) -> list[str]:
    """The faults of a file as `line:column: key: message`."""
    with pytest.raises(ModelError) as caught:
        load_model(io.StringIO(text))
    return [str(problem).removeprefix("<stream>:") for problem in caught.value.faults]


@pytest.mark.parametrize(
    ("stories", "expected"),
    [
        ("3", ["1:10: stories: must be a list of stories, got '3'"]),
        ("", ["1:9: stories: must be a list of stories, got nothing"]),
        ("[]", ["1:10: stories: must hold at least one story"]),
        ("[3]", [f"1:11: stories[1]: must be a mapping with the keys {STORY_KEYS}, got '3'"]),
        (
            "[{}]",
            [
                "1:11: stories[1].mass: is missing; give a positive number, or the weight in its place",
                "1:11: stories[1].stiffness: is missing; give a positive number",
            ],
        ),
        (
            "[{mass: 1, stiffness: -1, height: 0, dashpot: -2}]",
            [
                "1:32: stories[1].stiffness: must be a positive number, got '-1'",
                "1:44: stories[1].height: must be a positive number, got '0'",
                "1:56: stories[1].dashpot: must be zero or a positive number, got '-2'",
            ],
        ),
        (
            "[{mass: 1, stiffness: 1, dashpot: {coefficient: 0, exponent: 2.5}}]",
            [
                "1:58: stories[1].dashpot.coefficient: must be a positive number, got '0'",
                "1:71: stories[1].dashpot.exponent: must be a number above 0 and of at most 2, got '2.5'",
            ],
        ),
        (
            "[{mass: 1, stiffness: 1, dashpot: {coefficient: 1, exponent: 0.5}}]",
            [
                "1:44: stories[1].dashpot.linear_below: is missing; "
                "an exponent below 1 needs the drift rate under which the dashpot is linear"
            ],
        ),
        (
            "[{mass: 1, stiffness: 1, dashpot: {coefficient: 1, exponent: 0.5, linear_below: 0, power: 2}}]",
            [
                "1:90: stories[1].dashpot.linear_below: must be a positive number, got '0'",
                "1:93: stories[1].dashpot.power: unknown key; known: coefficient, exponent, linear_below",
            ],
        ),
        ("[{mass: , stiffness: 1}]", ["1:17: stories[1].mass: must be a positive number, got nothing"]),
        ("[{mass: [1], stiffness: 1}]", ["1:18: stories[1].mass: must be a positive number, got a list"]),
        (
            "[{repeat: 0, mass: 1, stiffness: 1}, {repeat: 2.0, mass: 1, stiffness: 1}]",
            [
                "1:20: stories[1].repeat: must be a whole number from 1 to 100000, got '0'",
                "1:56: stories[2].repeat: must be a whole number from 1 to 100000, got '2.0'",
            ],
        ),
        (
            f"[{{repeat: {'9' * 50}, mass: 1, stiffness: 1}}]",
            [f"1:20: stories[1].repeat: must be a whole number from 1 to 100000, got '{'9' * 37}...'"],
        ),
        (
            "[{repeat: 60000, mass: 1, stiffness: 1}, {repeat: 60000, mass: 1, stiffness: 1}]",
            ["1:51: stories[2]: brings the model over 100000 stories; check `repeat`"],
        ),
        ("[{mass: 1, colour: red, stiffness: 1}]", [f"1:21: stories[1].colour: unknown key; known: {STORY_KEYS}"]),
    ],
)
def test_stories(stories: str, expected: list[str]) -> None:
    assert faults(f"stories: {stories}") == expected


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        ("bilinar", ["stories[1].law: unknown law 'bilinar'; did you mean 'bilinear'?"]),
        ("", ["stories[1].law: must be the name of a law, got nothing"]),
        ("[a]", ["stories[1].law: must be the name of a law, got a list"]),
        ("{typ: bilinear}", ["stories[1].law.typ: unknown key; did you mean 'type'?"]),
        ("{type: [a]}", ["stories[1].law.type: must be the name of a law, got a list"]),
        (
            "bilinear",
            [
                "stories[1].stiffness: is missing; give a positive number",
                "stories[1].law: the bilinear law needs its parameters; "
                "write {type: bilinear, yield_force: ..., hardening: ...}",
            ],
        ),
        (
            "polynomial",
            ["stories[1].law: the polynomial law needs its parameters; write {type: polynomial, coefficients: ...}"],
        ),
        (
            "{type: bilinear, yield_forc: 3, hardening: 1}, stiffness: 1",
            [
                "stories[1].law.yield_forc: unknown key; did you mean 'yield_force'?",
                f"stories[1].law.hardening: {RATIO}, got '1'",
            ],
        ),
        (
            "{type: bilinear, coefficients: [1]}, stiffness: 1",
            [
                "stories[1].law.yield_force: is missing; give a positive number",
                f"stories[1].law.hardening: is missing; give {RATIO.removeprefix('must be ')}",
                "stories[1].law.coefficients: unknown key; known: type, yield_force, hardening",
            ],
        ),
        ("{type: polynomial}", ["stories[1].law.coefficients: is missing; give a list of numbers"]),
        ("{type: polynomial, coefficients: []}", ["stories[1].law.coefficients: must hold at least one number"]),
        ("{type: polynomial, coefficients: 3}", ["stories[1].law.coefficients: must be a list of numbers, got '3'"]),
        (
            "{type: polynomial, coefficients: [-3, x]}",
            [
                "stories[1].law: the initial stiffness of the polynomial law must be a positive number, got -3",
                "stories[1].law.coefficients[2]: must be a number, got 'x'",
            ],
        ),
        (
            "{type: polynomial, coefficients: [0]}, stiffness: 3",
            ["stories[1].law: the initial stiffness of the polynomial law must be a positive number, got 0"],
        ),
        (
            "{type: polynomial, coefficients: [3, 1]}, stiffness: 3.1",
            [
                "stories[1].stiffness: must agree with the initial stiffness 3 of its polynomial law, got 3.1; "
                "correct it or leave it out"
            ],
        ),
        (
            "{type: polynomial, coefficients: [3, 1]}, stiffness: x",
            ["stories[1].stiffness: must be a positive number, got 'x'"],
        ),
    ],
)
def test_laws(law: str, expected: list[str]) -> None:
    found = faults(f"units: {{force: kN}}\nstories: [{{mass: 1, law: {law}}}]")
    assert [fault.split(": ", 1)[1] for fault in found] == expected


def test_faults_list_the_laws() -> None:
    names = ", ".join(LAWS)
    assert faults("stories: [{mass: 1, law: zzz}]") == [f"1:26: stories[1].law: unknown law 'zzz'; known: {names}"]
    assert faults("stories: [{mass: 1, law: {}}]") == [f"1:26: stories[1].law.type: is missing; give one of {names}"]


def test_stiffness_agrees_in_the_units_of_the_file() -> None:
    stories = "[{mass: 1, stiffness: 3.1, law: {type: polynomial, coefficients: [3]}}]"
    (fault,) = faults(f"units: {{length: mm, force: kN}}\nstories: {stories}")
    assert fault.startswith("2:32: stories[1].stiffness: must agree with the initial stiffness 3 of its polynomial law")


def test_values_out_of_all_proportion_in_si() -> None:
    beyond = "is out of all proportion: its size must lie between 1e-60 and 1e+60 in SI units"
    assert faults("units: {mass: t}\nstories: [{mass: 1e308, stiffness: 1e999}, {mass: 1e-999, stiffness: 1}]") == [
        f"2:18: stories[1].mass: {beyond}, got '1e308'",
        f"2:36: stories[1].stiffness: {beyond}, got '1e999'",
        "2:51: stories[2].mass: must be a positive number, got '1e-999'",
    ]
    coefficients = ", ".join(["1"] * 110)
    found = faults(
        f"units: {{length: mm}}\nstories: [{{mass: 1, law: {{type: polynomial, coefficients: [{coefficients}]}}}}]"
    )
    assert found[0].endswith(f"stories[1].law.coefficients[21]: {beyond}, got '1'")


@pytest.mark.parametrize(
    ("damping", "expected"),
    [
        ("", ["2:9: damping: must be none, a ratio such as 5%, {rayleigh: ...} or {modal: ...}, got nothing"]),
        ("5", ["2:10: damping: must be none, a ratio such as 5%, {rayleigh: ...} or {modal: ...}, got '5'"]),
        (
            "{}",
            [
                "2:10: damping: must be none, a ratio such as 5%, {rayleigh: ...} or {modal: ...}, got a mapping "
                "without either"
            ],
        ),
        (
            "{raileigh: 3}",
            [
                "2:11: damping.raileigh: unknown key; did you mean 'rayleigh'?",
                f"2:21: damping.raileigh: {RAYLEIGH}, got '3'",
            ],
        ),
        (
            "{modal: 0.05, rayleigh: {mass: 0, stiffness: 0}}",
            ["2:10: damping: give either rayleigh or modal, not both"],
        ),
        ("{rayleigh: 0.05}", [f"2:21: damping.rayleigh: {RAYLEIGH}, got '0.05'"]),
        ("{rayleigh: {}}", [f"2:21: damping.rayleigh: {RAYLEIGH}, got a mapping without either"]),
        ("{rayleigh: {ratio: 0.05}}", ["2:21: damping.rayleigh.modes: is missing; give a list of two modes"]),
        (
            "{rayleigh: {modes: [1, 2]}}",
            ["2:21: damping.rayleigh.ratio: is missing; give one damping ratio or a list of two"],
        ),
        (
            "{rayleigh: {ratio: -0.1, modes: [2, 2]}}",
            [
                f"2:29: damping.rayleigh.ratio: {RATIO}, got '-0.1'",
                "2:42: damping.rayleigh.modes: must be two different modes, got 2 twice",
            ],
        ),
        (
            "{rayleigh: {ratio: [0.1, 0.2, 0.3], modes: [0, 4]}}",
            [
                "2:29: damping.rayleigh.ratio: must be one damping ratio or a list of two, got 3",
                "2:54: damping.rayleigh.modes[1]: must be a whole number from 1 to 3 (the number of stories), got '0'",
                "2:57: damping.rayleigh.modes[2]: must be a whole number from 1 to 3 (the number of stories), got '4'",
            ],
        ),
        (
            "{rayleigh: {ratio: [0.1], modes: 3}}",
            [
                "2:29: damping.rayleigh.ratio: a list must hold at least two damping ratios; "
                "write a single one without brackets",
                "2:43: damping.rayleigh.modes: must be a list of two modes, got '3'",
            ],
        ),
        (
            "{rayleigh: {ratio: 0.1, modes: [1, 2, 3]}}",
            ["2:41: damping.rayleigh.modes: must be a list of two modes, got 3"],
        ),
        (
            "{rayleigh: {ratio: 0.1, mass: 3}}",
            ["2:21: damping.rayleigh: give either ratio and modes or mass and stiffness, not both"],
        ),
        (
            "{rayleigh: {mass: -1}}",
            [
                "2:21: damping.rayleigh.stiffness: is missing; give zero or a positive number",
                "2:28: damping.rayleigh.mass: must be zero or a positive number, got '-1'",
            ],
        ),
        (
            "{rayleigh: {ratoi: 0.1, mode: [1, 2]}}",
            [
                "2:22: damping.rayleigh.ratoi: unknown key; did you mean 'ratio'?",
                "2:34: damping.rayleigh.mode: unknown key; did you mean 'modes'?",
            ],
        ),
        ("{modal: 105%}", [f"2:18: damping.modal: {RATIO}, got '105%'"]),
        ("{modal: x%}", [f"2:18: damping.modal: {RATIO}, got 'x%'"]),
        (
            "{modal: [0.05]}",
            ["2:18: damping.modal: a list must hold at least two damping ratios; write a single one without brackets"],
        ),
        (
            "{modal: [0.05, 1, 0.2, 0.3]}",
            [
                "2:18: damping.modal: must hold at most 3 damping ratios (one per mode), got 4",
                f"2:25: damping.modal[2]: {RATIO}, got '1'",
            ],
        ),
        ("{modal: {ratio: 0.05}}", ["2:18: damping.modal.modes: is missing; give the number of modes to damp"]),
        (
            "{modal: {ratio: 0.05, modes: 4}}",
            ["2:39: damping.modal.modes: must be a whole number from 1 to 3 (the number of stories), got '4'"],
        ),
    ],
)
def test_damping(damping: str, expected: list[str]) -> None:
    assert faults(f"{THREE}damping: {damping}") == expected


def test_rayleigh_ratio_of_one_story() -> None:
    assert faults("stories: [{mass: 1, stiffness: 1}]\ndamping: {rayleigh: {ratio: 0.05, modes: [1, 1]}}") == [
        "2:21: damping.rayleigh: a one-story model has one mode, and the ratio form needs two; "
        "write the ratio alone (damping: 5%), {rayleigh: {mass: a0, stiffness: a1}} or {modal: ratio}"
    ]


@pytest.mark.parametrize(
    ("excitation", "expected"),
    [
        ("", ["12: excitation: must be a mapping with the keys record, forces, got nothing"]),
        ("{recrod: x}", ["14: excitation.recrod: unknown key; did you mean 'record'?"]),
        ("{record: }", ["21: excitation.record: must be text, got nothing"]),
        ("{record: []}", ["22: excitation.record: must be a file or a mapping with the key file, got a list"]),
        ("{record: {}}", ["22: excitation.record.file: is missing; give the record's file"]),
        (
            "{record: {file: '', units: gels, scale: 0, component: [], inventory: ~}}",
            [
                "29: excitation.record.file: must be text, got ''",
                "40: excitation.record.units: units 'gels': use one of m/s^2, cm/s^2, gal, mm/s^2, g, in/s^2, ft/s^2, "
                "with a factor before it for counts",
                "53: excitation.record.scale: must not be zero; leave the record out for no ground motion",
                "67: excitation.record.component: must be text, got a list",
                "82: excitation.record.inventory: must be text, got nothing",
            ],
        ),
        (
            '{record: {file: "a\\nb", scale: .inf}}',
            [
                "29: excitation.record.file: must be one line without control characters, got 'a\\nb'",
                "44: excitation.record.scale: must be a number, got '.inf'; it must be finite",
            ],
        ),
        (
            "{record: {file: a, trim: 3, pad: x, highpass: 0, lowpass: a, baseline: linaer, corners: 2.5, "
            "resample: []}}",
            [
                "38: excitation.record.trim: trim must be START:END in seconds, got '3'",
                "46: excitation.record.pad: pad must be SECONDS or BEFORE:AFTER, got 'x'",
                "59: excitation.record.highpass: must be a positive number, got '0'",
                "71: excitation.record.lowpass: must be a positive number, got 'a'",
                "84: excitation.record.baseline: unknown baseline 'linaer'; did you mean 'linear'?",
                "101: excitation.record.corners: must be a whole number from 1 to 10, got '2.5'",
                "116: excitation.record.resample: must be a positive number, got a list",
            ],
        ),
        (
            "{record: {file: a, trim: '3:2'}}",
            ["22: excitation.record: trim must be START:END in seconds from the first sample with START below END"],
        ),
        (
            "{record: {file: a, highpass: 3, lowpass: 2}}",
            ["22: excitation.record: highpass (3 Hz) must be below lowpass (2 Hz): nothing would be left"],
        ),
        (
            "{record: {file: a, corners: 3}}",
            ["22: excitation.record: corners are those of a filter: give highpass or lowpass, too"],
        ),
        ('{record: "\\ud800"}', ["22: excitation.record: must be one line without control characters, got '\\ud800'"]),
        ("{forces: {}}", ["22: excitation.forces: must be a list of forces, got a mapping"]),
        (
            "{forces: [3, {}, {floor: 4, amplitude: x, omega: -1, phase: tan}, {floor: 1, amplitude: 1, freq: 3}]}",
            [
                "23: excitation.forces[1]: must be a mapping with the keys floor, amplitude, omega, phase, got '3'",
                "26: excitation.forces[2].floor: is missing; give the floor, counted from 1 at the bottom",
                "26: excitation.forces[2].amplitude: is missing; give a number",
                "26: excitation.forces[2].omega: is missing; give zero or a positive number",
                "38: excitation.forces[3].floor: must be a whole number from 1 to 3 (the number of stories), got '4'",
                "52: excitation.forces[3].amplitude: must be a number, got 'x'",
                "62: excitation.forces[3].omega: must be zero or a positive number, got '-1'",
                "73: excitation.forces[3].phase: must be cos, sin or an angle in radians, got 'tan'",
                "79: excitation.forces[4].omega: is missing; give zero or a positive number",
                "104: excitation.forces[4].freq: unknown key; known: floor, amplitude, omega, phase",
            ],
        ),
    ],
)
def test_excitation(excitation: str, expected: list[str]) -> None:
    assert faults(f"{THREE}excitation: {excitation}") == [f"2:{fault}" for fault in expected]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("initial: [1]", ["10: initial: must be a mapping with the keys displacement, velocity, got a list"]),
        (
            "initial: {displacement: 1, velocity: [1, 2]}",
            [
                "25: initial.displacement: must be a list with one number per story, got '1'",
                "38: initial.velocity: must have one number per story (3), got 2",
            ],
        ),
        ("initial: {displacement: [1, x, 2]}", ["29: initial.displacement[2]: must be a number, got 'x'"]),
        (
            "analysis: {dt: 0, duration: -1, method: }",
            [
                "16: analysis.dt: must be a positive number, got '0'",
                "29: analysis.duration: must be a positive number, got '-1'",
                "40: analysis.method: must be text, got nothing",
            ],
        ),
        ("analysis: impulse4", ["11: analysis: must be a mapping with the keys method, dt, duration, got 'impulse4'"]),
        ("collapse_drift: 0", ["17: collapse_drift: must be a positive number, got '0'"]),
        ("name: [a]", ["7: name: must be text, got a list"]),
        ("p_delta: 'true'", ["10: p_delta: must be true or false, got 'true' in quotes; remove the quotes"]),
        ("p_delta: 1", ["10: p_delta: must be true or false, got '1'"]),
        ("units: SI", ["8: units: must be a mapping with the keys length, force, mass, got 'SI'"]),
        (
            "units: {length: metre, force: KN, mass: , time: s}",
            [
                "17: units.length: unknown length unit 'metre'; known: m, cm, mm, in, ft",
                "31: units.force: unknown force unit 'KN'; did you mean 'kN'?",
                "40: units.mass: must be the name of a mass unit, got nothing",
                "43: units.time: unknown key; known: length, force, mass",
            ],
        ),
    ],
)
def test_the_rest(line: str, expected: list[str]) -> None:
    assert faults(THREE + line) == [f"2:{fault}" for fault in expected]


def test_p_delta_needs_heights() -> None:
    assert faults("p_delta: true\nstories: [{mass: 1, stiffness: 1, height: 3}, {mass: 1, stiffness: 1}]") == [
        "2:47: stories[2].height: is missing; p_delta needs the height of every story"
    ]


def test_unknown_number_of_stories_gives_no_further_faults() -> None:
    text = "stories: [{repeat: x, mass: 1, stiffness: 1}]\ninitial: {velocity: [1, 2]}\n"
    text += (
        "damping: {rayleigh: {ratio: 0.05, modes: [1, 3]}}\nexcitation: {forces: [{floor: 9, amplitude: 1, omega: 1}]}"
    )
    assert faults(text) == ["1:20: stories[1].repeat: must be a whole number from 1 to 100000, got 'x'"]
