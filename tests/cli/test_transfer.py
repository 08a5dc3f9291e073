"""`tdint modes --transfer`: table, summary, figure, report, units and messages."""

import json
from pathlib import Path

import numpy as np
import pytest

from csv_rows import rows
from facts import states

MODEL = """\
name: frame
stories:
  - {mass: 1e3, height: 3, stiffness: 4e5, law: {type: bilinear, yield_force: 2e3, hardening: 0.1}}
  - {mass: 1e3, height: 3, stiffness: 4e5}
damping: 5%
"""


@pytest.fixture
def frame(working_directory):
    """Write the model file and return its name."""
    Path("frame.yaml").write_text(MODEL)
    return "frame.yaml"


@pytest.mark.long
def test_table_summary_figure_and_report(frame, tdint, drawn):
    result = tdint(
        "modes", frame, "--transfer", "-o", "t.csv", "--plot", "--report", "t.html", code=0
    )
    table = rows(Path("t.csv").read_text())
    assert list(table[0]) == [
        "frequency_hz",
        *(f"floor_{floor}_{name}" for floor in (1, 2) for name in ("amplitude", "phase_deg")),
    ]
    # The floors follow a slow ground motion.
    assert float(table[0]["floor_2_amplitude"]) == pytest.approx(1.0, abs=0.01)
    roof = [float(row["floor_2_amplitude"]) for row in table]
    summary = json.loads(Path("t.json").read_text())
    assert summary["maxima"][1]["amplitude"] == pytest.approx(max(roof))
    maximum = summary["maxima"][1]["frequency_hz"]
    assert maximum == pytest.approx(float(table[int(np.argmax(roof))]["frequency_hz"]))
    first, note = result.stderr.splitlines()
    assert states(first, f"frame: ... {max(roof):.4g} times the ground ... {maximum:.4g} Hz")
    assert states(note, "note: ... initial stiffness")
    page = Path("t.html").read_text()
    assert f"{max(roof):.4g} times the ground acceleration" in page
    assert Path("t.png").stat().st_size > 10_000


def test_displacement_for_a_force(frame, tdint):
    """The static displacement of the roof under a force on it is 1 / k1 + 1 / k2."""
    result = tdint("modes", frame, "--transfer", "2", code=0)
    first = rows(result.stdout)[0]
    assert float(first["floor_2_amplitude_m_N"]) == pytest.approx(2.0 / 4e5, rel=0.01)
    assert "m/N per force on floor 2" in result.stderr
    result = tdint("modes", frame, "--transfer", "2", "--output-units", "mm,kN", code=0)
    first = rows(result.stdout)[0]
    assert float(first["floor_2_amplitude_mm_kN"]) == pytest.approx(5.0, rel=0.01)
    assert "mm/kN per force on floor 2" in result.stderr


def test_the_option_may_precede_the_model(frame, tdint):
    """A file after an option is not its value; a floor or a norm is."""
    after = tdint("modes", frame, "--transfer", code=0).stdout
    assert tdint("modes", "--transfer", frame, code=0).stdout == after
    assert tdint("modes", "--transfer", "./" + frame, code=0).stdout == after
    assert tdint("modes", "--transfer", "ground", frame, code=0).stdout == after
    force = tdint("modes", frame, "--transfer", "2", code=0).stdout
    assert tdint("modes", "--transfer", "2", frame, code=0).stdout == force != after
    assert tdint("modes", "--transfer", "roof", frame, code=0).stdout == force
    shapes = tdint("modes", frame, "--shapes", code=0).stdout
    assert tdint("modes", "--shapes", frame, code=0).stdout == shapes


def test_invalid_calls_are_refused(frame, tdint):
    for source in ("3", "0", "attic"):
        tdint.refused(
            f"Error: the source of the transfer function ... ground ... from 1 to 2 ... {source}",
            "modes",
            frame,
            "--transfer",
            source,
        )
    for option in (["--shapes"], ["--target", "ec8:ag=0.3,soil=B"]):
        tdint.refused(
            f"Error: {option[0]} has no effect with --transfer",
            "modes",
            frame,
            "--transfer",
            *option,
        )
    Path("power.yaml").write_text(
        MODEL.replace(
            "stiffness: 4e5}", "stiffness: 4e5, dashpot: {coefficient: 1e3, exponent: 1.5}}"
        )
    )
    tdint.refused("Error: ... story 2 ... power-law", "modes", "power.yaml", "--transfer", code=3)


def test_undamped_modes_cause_a_warning(frame, tdint):
    Path("bare.yaml").write_text(MODEL.replace("damping: 5%\n", ""))
    assert states(
        tdint("modes", "bare.yaml", "--transfer", code=0).stderr,
        "Warning: ... undamped ... unbounded",
    )
