"""Loops and responses of laws that were computed twice by separate programs: in branch form with
located events, by Runge-Kutta methods or closed forms, and mostly by OpenSees.

The glossary names these loops as proofs that a law of another program is exactly available.
"""

import io
import json
import re
from pathlib import Path

import numpy as np
import pytest

import tdint
from el_centro import el_centro
from selection import every
from tdint.model.building import assemble
from tdint.response.static.cyclic import follow_path

PATH = (0.015, 0.002, -0.01, -0.025, -0.005, 0.02, 0.04, 0.015, 0.03, -0.035)
"""Drifts at the ends of monotonic paths, m."""

REFERENCES = json.loads(Path(__file__).with_name("law_references.json").read_text())
"""Loops: the story in kN and m, the forces at the drifts of `PATH`, N, and the work at the end, J.
Responses: the story of 100 t, the scale of El Centro, the peak drift, m, and its digits."""

LOOPS, RESPONSES = REFERENCES["loops"], REFERENCES["responses"]

UNITS = "units: {length: m, force: kN, mass: t}\nplausibility: off, reference\n"


def load(story, more="damping: none\n"):
    text = f"{UNITS}{more}stories: [{{mass: 100, {story}}}]\n"
    return tdint.load_model(io.StringIO(text))


@pytest.mark.parametrize("name", every(3, LOOPS))
def test_loops(name):
    loop = LOOPS[name]
    result = follow_path(assemble(load(loop["story"])), 1, np.array(PATH))
    largest = max(map(abs, loop["forces"]))
    # The printed forces of one loop have four digits.
    digits = 5e-4 if name == "trilinear-equal-pinch" else 1e-7
    assert result.shear == pytest.approx(loop["forces"], abs=digits * largest)
    if loop["work"]:
        total = result.strain_energy[-1] + result.hysteretic_energy[-1]
        assert total == pytest.approx(loop["work"], rel=5e-5)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["impulse4", "moment4", "gauss4"])
@pytest.mark.parametrize("name", RESPONSES)
def test_peak_drifts(name, method):
    """The error is at most one unit of the last printed digit, or twice its estimate."""
    response = RESPONSES[name]
    model = load(response["story"], "damping: {rayleigh: {mass: 1, stiffness: 0}}\n")
    record = el_centro(duration=31.18, scale=response["scale"])
    result = tdint.run(model, record, method=method, dt=0.001, duration=31.18)
    peak = response["peak_drift"]
    error = abs(result.stories.peak_drift[0] - peak)
    unit = 10.0 ** (np.floor(np.log10(peak)) + 1 - response["digits"])
    assert error <= max(unit, 2.0 * result.check.errors.peak_drift[0])
    assert error <= 1e-4 * peak


GLOSSARY = (Path(__file__).parents[2] / "src" / "GLOSSARY.md").read_text()


def exact_rows(glossary):
    """Return the words of the model and the loops of each row that says "exactly"."""
    table = glossary.split("### Laws of OpenSees", 1)[1].split("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in table.splitlines() if line.startswith("| ")]
    for law, *in_a_model, available in rows:
        if available.startswith("exactly"):
            loops = [word for word in re.findall(r"[\w.-]+", available) if word in LOOPS]
            yield law, re.findall(r"`([\w-]+)", "".join(in_a_model)), loops


def test_each_exact_law_of_the_glossary_is_a_loop():
    """Each row names loops of `test_loops`, and one of them at least has its law and its keys."""
    rows = list(exact_rows(GLOSSARY))
    assert len(rows) >= 12
    for law, words, loops in rows:
        stories = " ".join(LOOPS[loop]["story"] for loop in loops)
        missing = [word for word in words if word not in stories and word != "linear"]
        assert loops, f"{law}: exactly, without a loop"
        assert not missing, f"{law}: no loop with {missing}"


def test_bilinear_by_return_mapping():
    """Steel01: an elastic part beside a spring whose force is limited, with one inner loop more."""
    stiffness, strength, hardening = 4e7, 2e5, 0.05
    path = np.array([*PATH, 0.01, -0.002, 0.006, 0.001, 0.05])
    law = f"law: {{type: bilinear, yield_force: {strength / 1e3}, hardening: {hardening}}}"
    result = follow_path(assemble(load(f"stiffness: {stiffness / 1e3}, {law}")), 1, path)
    plastic, forces = 0.0, []
    for drift in path:
        trial = stiffness * (drift - plastic)
        plastic += np.sign(trial) * max(abs(trial) - strength, 0.0) / stiffness
        forces.append(
            hardening * stiffness * drift + (1.0 - hardening) * stiffness * (drift - plastic)
        )
    assert result.shear == pytest.approx(forces, abs=1e-9 * strength)
