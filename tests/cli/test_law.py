"""`tdint law`: rows, messages, figures, exit codes."""

import re
from pathlib import Path

import pytest

from csv_rows import rows
from facts import states
from tdint.model.story_laws import LAWS

CONFIGS = Path(__file__).parents[2] / "configs"


def test_one_cycle(folder, tdint):
    """The story is bilinear with k = 8000 N/m, Fy = 50 N, hardening 0.1 and height 3 m. At a drift
    ratio of 1 %, the force is 50 + 800 (0.03 - 0.00625) = 69 N."""
    result = tdint("law", "shaken.yaml", "--story", "2", "--drift", "0.01", "--points", "4", code=0)
    table = rows(result.stdout)
    assert [row["step"] for row in table] == [str(i) for i in range(17)]
    assert {row["story"] for row in table} == {"2"}
    assert [row["cycle"] for row in table] == ["0", *["1"] * 16]
    assert table[4] == {
        "story": "2", "step": "4", "cycle": "1", "drift_m": "0.03", "drift_ratio": "0.01",
        "shear_N": "69", "shear_with_p_delta_N": "69", "tangent_stiffness_N_m": "800",
        "strain_energy_J": "0.500625", "hysteretic_energy_J": "1.06875",
    }  # fmt: skip
    assert (table[8]["drift_m"], table[12]["drift_m"], table[16]["drift_m"]) == ("0", "-0.03", "0")


def test_messages_contain_stiffness_yield_drift_and_cycles(folder, tdint):
    result = tdint("law shaken.yaml --drift 0.5dy --drift 3cm --cycles 2 --points 2")
    lines = result.stderr.splitlines()
    assert lines[0].startswith("shaken, story 1, bilinear law: f = a k d + z, ")
    assert lines[1] == "Initial stiffness 8000 N/m, yield drift 0.00625 m (drift ratio 0.002083)."
    assert [line.split() for line in lines[3:]] == [
        ["2", "0.003125", "0.001042", "0.5", "25", "-25", "8000", "0", "0"],
        # 4 (1 - 0.1) 50 (0.03 - 0.00625) = 4.275 J; over 2 pi 2300 0.03^2
        ["4", "0.03", "0.01", "4.8", "69", "-69", "2300", "4.275", "0.3287"],
    ]


def test_rule_of_a_multilinear_story_is_reported(tdint):
    text = """
name: joint
stories:
  - {mass: 1, height: 3, law: {type: multilinear, rule: origin, backbone: [[0.01, 1], [0.03, 1.5]]}}
"""
    result = tdint("law", "-", "--drift", "20mm", "--points", "1", stdin=text.encode(), code=0)
    first = result.stderr.splitlines()[0]
    assert first.startswith("joint, story 1, multilinear law: backbone through ")
    assert first.endswith(" (rule origin)")


def test_a_linear_story_from_standard_input(folder, tdint):
    text = (folder / "forced.yaml").read_text().replace(", height: 3", "")
    result = tdint("law", "-", "--drift", "10mm", "--points", "1", stdin=text.encode(), code=0)
    assert [row["shear_N"] for row in rows(result.stdout)] == ["0", "8", "0", "-8", "0"]
    assert {row["drift_ratio"] for row in rows(result.stdout)} == {""}
    assert "Initial stiffness 800 N/m.\n" in result.stderr
    assert result.stderr.splitlines()[-1].split() == [
        "1", "0.01", "-", "-", "8", "-8", "800", "0", "0",
    ]  # fmt: skip


@pytest.mark.parametrize("units", ["m", "dy"])
def test_a_drift_path_from_a_file(folder, tdint, units):
    """The path reaches 0.03 m with a force of 69 N, returns by 0.01 m along k = 8000 N/m, and
    continues. Each drift has a row."""
    scale = 1.0 if units == "m" else 1.0 / 0.00625
    drifts = [0.03, 0.02, 0.03, 0.0425]
    text = "".join(f"{i},{drift * scale!r}\n" for i, drift in enumerate(drifts))
    (folder / "path.csv").write_text("step,drift_m\n" + text)
    result = tdint("law shaken.yaml --path path.csv --units", units, "--plot=x.png", code=0)
    table = rows(result.stdout)
    assert [float(row["drift_m"]) for row in table] == pytest.approx(drifts, rel=1e-11)
    assert [float(row["shear_N"]) for row in table] == pytest.approx(
        [69.0, -11.0, 69.0, 79.0], rel=1e-9
    )
    assert [(row["step"], row["cycle"]) for row in table] == [(str(i), "") for i in range(4)]
    assert states(
        result.stderr.splitlines()[-1], "4 drifts ... 0.02 to 0.0425 m, ... -11 to 79 N, "
    )
    assert (folder / "x.png").exists()


def test_list_of_the_laws(folder, tdint):
    """Each law and each of its keys is listed; keys without default are those that `check` misses
    in a law without keys, and a law with the listed keys only is valid."""
    table = rows(tdint("law", "--list", code=0).stdout)
    keys = {}
    for row in table:
        keys.setdefault(row["law"], {})[row["key"]] = row
    assert list(keys) == list(LAWS) and list(keys["linear"]) == [""]
    assert {name: list(of_law) for name, of_law in keys.items() if name != "linear"} == {
        name: [parameter.path for parameter in law.parameters]
        for name, law in LAWS.items()
        if law.parameters
    }
    assert keys["bilinear"]["yield_force"]["unit"] == "N"
    assert keys["bilinear"]["yield_force"]["values"] == "a positive number"
    assert keys["bilinear"]["negative.yield_force"]["default"] == "yield_force"
    assert keys["gap"]["sides"]["values"] == "both | positive | negative"
    assert keys["imk"]["exponent"]["default"] == "1"
    for name, of_law in keys.items():
        story = f"{{mass: 1000, stiffness: 1e5, law: {{type: {name}}}}}"
        Path("bare.yaml").write_text(f"stories: [{story}]\n")
        stderr = tdint("check", "bare.yaml").stderr
        required = {key for key, row in of_law.items() if key and not row["default"]}
        if "stiffness" not in stderr:  # a law that defines the stiffness refuses this key first
            for key in required:
                assert re.search(rf"law\.{key.partition('.')[0]}\b", stderr), (name, key)
    tdint.refused("MODEL.yaml, or --list", "law", code=2)
    tdint.refused("--story has no effect with --list", "law", "--list", "--story", "2", code=2)
    tdint.refused("MODEL.yaml has no effect with --list", "law", "a.yaml", "--list", code=2)


def test_p_delta(tdint):
    result = tdint(
        "law", CONFIGS / "three-story-concrete.yaml", "--drift", "0.002", "--points", "1"
    )
    row = rows(result.stdout)[1]
    assert float(row["shear_N"]) == pytest.approx(4.9e7 * 0.0072)
    assert float(row["shear_with_p_delta_N"]) == pytest.approx(
        (4.9e7 - 450e3 * 9.80665 / 3.6) * 0.0072
    )
    assert "geometric stiffness of P-delta -1.226e+06 N/m" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["shaken.yaml"], 2, "the imposed drifts are required; add --drift or --path"),
        (["shaken.yaml", "--path", "path.csv"], 2, "path.csv:3: drift_m must be a number, got 'x'"),
        (["shaken.yaml", "--path", "forced.yaml"], 2, "forced.yaml: column drift_m not found"),
        (["shaken.yaml", "--path", "missing.csv"], 2, "missing.csv: file not found"),
        (["-", "--path", "-"], 2, "cannot both be standard input"),
        (["forced.yaml", "--path", "good.csv", "--units", "dy"], 2,
         "the law of story 1 does not yield"),
        (["shaken.yaml", "--drift", "2"], 2, "drift '2': a drift ratio must be at most 1"),
        (["shaken.yaml", "--drift", "1%", "--drift", "x"], 2,
         "drift 'x': write a drift ratio (0.02 or 2%)"),
        (["shaken.yaml", "--drift", "1%", "--story", "3"], 2,
         "story 3 not found: the model has 2 stories"),
        (["shaken.yaml", "--drift", "1%", "--story", "0"], 2, "Invalid value for '--story'"),
        (["shaken.yaml", "--drift", "1%", "--cycles", "0"], 2, "Invalid value for '--cycles'"),
        (["shaken.yaml", "--drift", "1%", "--points", "0"], 2, "Invalid value for '--points'"),
        (["shaken.yaml", "--drift", "1%", "--cycles", "1000000"], 2,
         "the maximum of 2,000,000 points"),
        (["forced.yaml", "--drift", "2dy"], 2, "the law of story 1 does not yield"),
        (["no-height.yaml", "--drift", "1%"], 2, "drift 1% ... story 1 has no height"),
        (["missing.yaml", "--drift", "1%"], 3, "missing.yaml: file not found"),
        (["shaken.yaml", "--drift", "1%", "-o", "other.mseed"], 6,
         "other.mseed: the file exists; add --overwrite"),
        (["cubic.yaml", "--drift", "1e59m"], 5, "story 1: ... not finite ... drift "),
    ],
)  # fmt: skip
def test_invalid_arguments_are_refused(folder, tdint, arguments, code, message):
    (folder / "no-height.yaml").write_text(
        (folder / "forced.yaml").read_text().replace(", height: 3", "")
    )
    law = "law: {type: polynomial, coefficients: [1, 0, 1e60, 0, 1e60]}"
    (folder / "cubic.yaml").write_text(
        (folder / "forced.yaml").read_text().replace("stiffness: 800", law)
    )
    (folder / "path.csv").write_text("drift_m\n0.1\nx\n")
    (folder / "good.csv").write_text("drift_m\n0.1\n")
    tdint.refused(message, "law", *arguments, code=code)
