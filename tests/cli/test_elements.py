"""Elements of a story on the command line: tables, parameters, messages, tests of one element."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from building_cases import noise
from selection import every
from tdint import load_model, run, run_many
from tdint.errors import ModelError
from tdint.model.building import law_column, stiffness_after_yield
from tdint.model.law_checks import tangent_at
from tdint.model.story_laws import LAWS

MODEL = """
units: {length: m, force: kN, mass: t}
stories:
  - mass: 500
    height: 3.0
    elements:
      - {name: bearings, type: bilinear, stiffness: 5.0e+4, yield_force: 250, hardening: 0.1}
      - {name: moat wall, type: gap, gap: 0.02, stop_stiffness: 1.0e+5}
damping: 3%
excitation: {forces: [{floor: 1, amplitude: 400, omega: 8, phase: sin}]}
analysis: {dt: 0.02, duration: 2}
"""


@pytest.fixture
def model(folder):
    Path("m.yaml").write_text(MODEL)
    return "m.yaml"


def test_run_writes_a_table_of_elements(model, tdint):
    result = tdint("run", model, "-o", "out", "--history")
    assert result.exit_code == 0, result.output
    with Path("out/elements.csv").open() as file:
        bearings, wall = csv.DictReader(file)
    assert (bearings["story"], bearings["element"], bearings["law"]) == (
        "1",
        "bearings",
        "bilinear",
    )
    assert wall["element"] == "moat wall" and wall["yield_drift_m"] == wall["ductility"] == ""
    with Path("out/stories.csv").open() as file:
        (story,) = csv.DictReader(file)
    drift = float(story["peak_drift_m"])
    assert float(bearings["ductility"]) == pytest.approx(drift / 0.005, rel=1e-9)
    assert float(wall["peak_force_N"]) == pytest.approx(1e8 * (drift - 0.02), rel=1e-6)
    summary = json.loads(Path("out/summary.json").read_text())
    assert [row["element"] for row in summary["elements"]] == ["bearings", "moat wall"]
    assert summary["meanings"]["peak_force_N"]["unit"] == "N"
    assert any("element that yields first" in note for note in summary["notes"])
    # The forces of the elements in the history add up to the story shear.
    with Path("out/history.csv").open() as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        parts = [float(row[f"story_1_{name}_force_N"]) for name in ("bearings", "moat_wall")]
        assert sum(parts) == pytest.approx(float(row["story_1_shear_N"]), rel=1e-9, abs=1e-3)


@pytest.mark.parametrize("check", every(2, ["--no-check", "--check"]))
def test_several_runs_and_campaigns_write_the_table_of_each_run(check, model, tdint):
    """elements.csv of several runs, of a campaign in two shards, and of its merged store have the
    cells of the single runs."""
    text = yaml.safe_load(MODEL)
    text["stories"] = [text["stories"][0], {"mass": 300, "height": 3.0, "stiffness": 2e5}]
    del text["excitation"]
    Path("m.yaml").write_text(yaml.safe_dump(text))
    for name, seed in (("a", 1), ("b", 2)):
        motion = noise(samples=101, dt=0.02, peak=6.0, seed=seed)
        rows = [f"{0.02 * i:g},{value}" for i, value in enumerate(motion.acceleration)]
        Path(f"{name}.csv").write_text("\n".join(["time_s,acceleration_m_s2", *rows]))
    expected = []
    for name in "ab":
        for scale in "12":
            result = tdint("run", model, f"{name}.csv", "--scale", scale, check, "-o", name + scale)
            assert result.exit_code == 0, result.output
            head = {"building": "m", "record": f"{name}.csv", "component": "", "scale": scale}
            expected += [head | row for row in _rows(name + scale)]
    result = tdint("run", model, "a.csv", "b.csv", "--scale", "1,2", check, "-o", "several")
    assert result.exit_code == 0, result.output
    assert _rows("several") == expected
    assert [row["element"] for row in expected[:2]] == ["bearings", "moat wall"]
    Path("c.yaml").write_text(
        "buildings: {models: [m.yaml]}\nrecords: {files: [a.csv, b.csv]}\n"
        f"intensity: {{scales: [1, 2]}}\nanalysis: {{check: {str(check == '--check').lower()}}}\n"
        "outputs: {stories: true}\n"
    )
    for shard in "12":
        tdint("campaign", "c.yaml", "-o", f"part{shard}", "--shard", f"{shard}/2")
    result = tdint("campaign", "merge", "part1", "part2", "-o", "merged")
    assert result.exit_code == 0, result.output
    assert _rows("merged") == expected


def test_a_sequence_lists_the_elements_over_all_events(model, tdint):
    """The dissipated energy of a sequence contains that of its first event."""
    motion = noise(samples=101, dt=0.02, peak=6.0)
    rows = [f"{0.02 * i:g},{value}" for i, value in enumerate(motion.acceleration)]
    Path("a.csv").write_text("\n".join(["time_s,acceleration_m_s2", *rows]))
    tdint("run", model, "a.csv", "-o", "one")
    result = tdint("run", model, "a.csv", "a.csv", "--sequence", "--rest", "1", "-o", "two")
    assert result.exit_code == 0, result.output
    one, two = (float(_rows(name)[0]["dissipated_energy_J"]) for name in ("one", "two"))
    assert two > 1.1 * one


def _rows(folder):
    with Path(folder, "elements.csv").open() as file:
        return list(csv.DictReader(file))


def test_law_tests_one_element(model, tdint):
    story = tdint("law", model, "--drift", "50mm", "--points", "5")
    bearings = tdint("law", model, "--drift", "50mm", "--points", "5", "--element", "bearings")
    assert "bilinear + gap" in story.stderr and "element bearings" in bearings.stderr
    peaks = [
        max(float(row["shear_N"]) for row in csv.DictReader(result.stdout.splitlines()))
        for result in (story, bearings)
    ]
    assert peaks == pytest.approx([250e3 + 5e6 * 0.045 + 1e8 * 0.03, 250e3 + 5e6 * 0.045])
    result = tdint("law", model, "--drift", "50mm", "--element", "wall")
    assert result.exit_code == 2 and "did you mean 'moat wall'?" in result.stderr


def test_pushover_lists_yielding_and_contact(model, tdint):
    result = tdint("pushover", model, "--drift", "1%", "-o", "curve.csv")
    assert result.exit_code == 0, result.output
    events = json.loads(Path("curve.json").read_text())["element_events"]["events"]
    assert [(event["element"], round(event["drift_m"], 9)) for event in events] == [
        ("bearings", 0.005),
        ("moat wall", 0.02),
    ]
    assert "moat wall: stiffness 0 to 1e+08 N/m at a drift of 0.02 m" in result.stderr


def test_pushover_of_several_stories_lists_events_of_elements(model, tdint):
    story = "  - {mass: 100, height: 3.0, stiffness: 1.0e+5}\ndamping"
    Path(model).write_text(MODEL.replace("damping", story))
    result = tdint("pushover", model, "--drift", "1%", "-o", "curve.csv")
    assert result.exit_code == 0, result.output
    events = json.loads(Path("curve.json").read_text())["element_events"]["events"]
    assert [event["element"] for event in events] == ["bearings", "moat wall"]


ERRORS = {
    "elements: []": "stories[1].elements: must contain at least one element",
    "elements: [{type: gap, gap: 1, stop_stiffness: 1}]": "stories[1].elements: the sum of the "
    "initial stiffnesses of the elements must be positive; add the stiffness of an element",
    "elements: [{type: bilinear, yield_force: 1, hardening: 0}]": "stories[1].elements[1].stiffness"
    ": is missing; give a positive number",
    "law: linear, elements: [{type: linear, stiffness: 1}]": "stories[1]: give either `law` or "
    "`elements`, not both; move the law into an element",
    "stiffness: 1, elements: [{type: linear, stiffness: 1}]": "stories[1]: give either `stiffness` "
    "or `elements`, not both; move the stiffness into an element",
    "elements: [{type: linear, name: a, stiffness: 1}, {type: linear, name: a, stiffness: 1}]": (
        "stories[1].elements[2].name: 'a' is already the name of element 1; names must be unique "
        "within the story"
    ),
    "elements: [{type: linear, name: '1', stiffness: 1}]": "stories[1].elements[1].name: must "
    "contain a letter and none of [ ] , = and quotation marks, got '1'",
    "elements: [3]": "stories[1].elements[1]: must be a mapping with `type`, `stiffness` and the "
    "parameters of the law",
}


@pytest.mark.parametrize("story", ERRORS)
def test_errors_of_elements(story):
    with pytest.raises(ModelError) as error:
        load_model(_mapping(story))
    assert str(error.value).partition(": ")[2] == ERRORS[story]


def _mapping(story):
    return {"stories": [yaml.safe_load(f"{{mass: 1, {story}}}")]}


def test_one_element_is_the_law_of_the_story():
    spring = {"type": "bilinear", "yield_force": 1.0, "hardening": 0.1}
    one = load_model({"stories": [{"mass": 1, "elements": [{**spring, "stiffness": 2.0}]}]})
    law = load_model({"stories": [{"mass": 1, "stiffness": 2.0, "law": spring}]})
    assert one.stories == law.stories


def test_stiffness_after_yield_is_the_sum_after_all_have_yielded():
    springs = [
        {"type": "bilinear", "stiffness": 1000.0, "yield_force": 60.0, "hardening": 0.1},
        {"type": "linear", "stiffness": 30.0},
        {"type": "gap", "gap": 1.0, "stop_stiffness": 1e6},
    ]
    story = load_model({"stories": [{"mass": 1, "elements": springs}]}).stories[0]
    assert stiffness_after_yield(story) == pytest.approx(130.0)


def test_the_stability_check_includes_the_stiffness_of_a_stop_in_contact(model, tdint):
    """The limit of central differences is 2 / omega, with the stop (1e8 N/m) in contact."""
    limit = 2.0 / ((5e7 + 1e8) / 5e5) ** 0.5
    for dt, code in ((0.98 * limit, 0), (1.02 * limit, 5)):
        method = ("--method", "central-difference", "--dt", f"{dt:.6f}", "--duration", f"{dt:.6f}")
        result = tdint("run", model, *method, "--no-check")
        assert result.exit_code == code, result.output
    assert "unstable" in result.stderr


def test_samples_vary_the_elements():
    """A sample of `run_many` is the run of the changed model."""
    values = {
        "stories[1].elements[bearings].yield_force": np.array([200e3, 300e3]),
        "stories.elements[2].gap": np.array([0.015, 0.03]),
        "stiffness_factor": np.array([1.1, 0.9]),
        "strength_factor": np.array([0.9, 1.2]),
    }
    text = yaml.safe_load(MODEL)
    del text["excitation"], text["analysis"]
    model, motion = load_model(text), noise(samples=101, dt=0.02, peak=8.0)
    runs = run_many(model, [motion], vary=values, check=False)
    for number in range(2):
        changed = model.replace(**{name: array[number] for name, array in values.items()})
        alone = run(changed, motion, check=False).stories
        assert runs.stories.peak_drift[number] == pytest.approx(alone.peak_drift, rel=1e-12)
        assert runs.stories.ductility[number] == pytest.approx(alone.ductility, rel=1e-12)


def test_a_law_of_a_plugin_counts_in_the_warning_of_p_delta():
    """The stiffness after yield of a law that declares only its yield drift is measured."""
    declared = LAWS["bilinear"]
    measured = replace(declared, stiffness_after_yield=None)
    (story,) = load_model(
        {
            "stories": [
                {
                    "mass": 1,
                    "stiffness": 1000,
                    "law": {"type": "bilinear", "yield_force": 60, "hardening": 0.1},
                }
            ]
        }
    ).stories
    column = np.array(law_column(story.law, story.stiffness))
    assert tangent_at(measured, column, 1.1 * 60.0 / 1000.0) == pytest.approx(100.0)
