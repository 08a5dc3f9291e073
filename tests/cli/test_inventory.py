"""`tdint inventory` and `tdint pushover`: rows, files, words, exit codes."""

import json
from pathlib import Path

import pytest

from csv_rows import rows
from tdint import pushover, target_displacements

CONFIGS = Path(__file__).parents[2] / "configs"
BAD = "id,NumberOfStories,YearBuilt,StructureType,PlanArea\ngood,2,1990,C1,600\nbad,0,1990,C9,600\n"


def test_a_table_of_buildings_and_their_models(folder, tdint):
    result = tdint(
        "inventory", CONFIGS / "buildings.csv", "--units", "ft", "--models", "models", code=0
    )
    table = rows(result.stdout)
    assert [row["story"] for row in table if row["id"] == "town-hall"] == ["1", "2", "3"]
    assert {row["id"]: row["hazus_type"] for row in table}["tower"] == "S1H"
    assert result.stderr == "4 of 4 buildings by the rules mdof-lu.\n"
    assert {path.stem for path in Path("models").iterdir()} == {
        "house",
        "school",
        "tower",
        "town-hall",
    }
    period = next(row["period_shear_beam_s"] for row in table if row["id"] == "school")
    assert rows(tdint("modes", "models/school.yaml").stdout)[0]["period_s"] == period
    motion = ("--record", "motion.mseed", "--component", "HNE", "--units", "m/s^2")
    assert "energy error" in tdint("run", "models/school.yaml", *motion, code=0).stderr


def test_bad_rows_cost_the_exit_code_alone(folder, tdint):
    (folder / "b.csv").write_text(BAD)
    result = tdint("inventory", "b.csv", "--units", "m", "-o", "models.csv")
    assert (result.exit_code, result.stdout) == (3, "")
    assert {row["id"] for row in rows(folder / "models.csv")} == {"good"}
    words, *faults = result.stderr.splitlines()
    assert words == "1 of 2 buildings by the rules mdof-lu."
    assert [fault.split(": ")[1] for fault in faults] == ["b.csv:3:2", "b.csv:3:4"]


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["missing.csv", "--units", "m"], 3, "missing.csv: no such file"),
        (["b.csv"], 2, "Missing option '--units'"),
        (["b.csv", "--units", "cm"], 2, "Invalid value for '--units'"),
        (["b.csv", "--units", "m", "--rules", "mine"], 2, "Invalid value for '--rules'"),
        (
            ["odd.csv", "--units", "m", "--models", "x"],
            2,
            "the id '../up' does not make a file name",
        ),
        (
            ["b.csv", "--units", "m", "-o", "forced.yaml"],
            6,
            "forced.yaml: exists already; give --overwrite",
        ),
        (["forced.yaml", "--units", "m"], 3, "forced.yaml:1: no column id"),
    ],
)
def test_what_is_refused(folder, tdint, arguments, code, message):
    (folder / "b.csv").write_text(BAD)
    (folder / "odd.csv").write_text(BAD.replace("good", "../up"))
    tdint.refused(message, "inventory", *arguments, code=code)


def test_a_pushover(folder, tdint, drawn):
    """Two equal stories of 8000 N/m, yield at 50 N: under equal forces the lower one yields at a
    base shear of 50 N."""
    words = (
        "--pattern",
        "uniform",
        "--drift",
        "75mm",
        "--points",
        "8",
        "-o",
        "p.csv",
        "--plot=x.pdf",
    )
    result = tdint("pushover", "shaken.yaml", *words, code=0)
    table = rows(folder / "p.csv")
    assert [float(row["roof_displacement_m"]) for row in table] == pytest.approx(
        [0.075 * i / 8 for i in range(9)]
    )
    assert float(table[1]["base_shear_N"]) == pytest.approx(50.0, rel=1e-9)
    assert float(table[1]["story_2_drift_m"]) == pytest.approx(25.0 / 8000.0, rel=1e-9)
    assert "\nshaken, uniform pattern: maximum base shear " in result.stderr
    assert (folder / "x.pdf").read_bytes().startswith(b"%PDF")


def test_a_pushover_to_a_design_spectrum(folder, tdint):
    """What is the building's stands once in a sentence and in the JSON; the rows of each method:
    test_interface.py."""
    target = "ec8:type=1,soil=C,ag=0.05g"
    result = tdint(
        "pushover",
        "shaken.yaml",
        "--target",
        target,
        "--points",
        50,
        "--plot=t.png",
        "-o",
        "t.csv",
        code=0,
    )
    made = target_displacements(pushover("shaken.yaml", "4%", points=50), target)
    of_building = json.loads((folder / "t.json").read_text())["targets"]
    assert [told["yield_force_N"] for told in of_building] == pytest.approx(
        [each.yield_force for each in made]
    )
    roofs = [told["roof_displacement_m"] for told in of_building]
    assert roofs == pytest.approx([each.roof_displacement for each in made], rel=1e-11)
    assert f"n2: roof displacement {roofs[0]:.4g} m" in result.stderr
    assert (folder / "t.png").exists()


def test_a_target_beyond_the_curve_is_refused(folder, tdint):
    arguments = ("--target", "ec8:type=1,soil=C,ag=0.9g", "--points", "20", "-o", "t.csv")
    said = "no remaining lateral resistance"
    tdint.refused(said, "pushover", CONFIGS / "collapse-prone-frame.yaml", *arguments, code=5)


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["shaken.yaml", "--drift", "2dy"], 2, "drift 2dy: the roof has no yield drift"),
        (["shaken.yaml", "--drift", "x"], 2, "write a drift ratio"),
        (["shaken.yaml", "--pattern", "modal"], 2, "Invalid value for '--pattern'"),
        (["shaken.yaml", "--points", "0"], 2, "Invalid value for '--points'"),
        (["missing.yaml"], 3, "missing.yaml: no such file"),
    ],
)
def test_what_a_pushover_refuses(folder, tdint, arguments, code, message):
    tdint.refused(message, "pushover", *arguments, code=code)


def test_of_many_faults_the_first_ten_and_their_number_are_shown(folder, tdint):
    (folder / "many.csv").write_text(BAD.partition("\n")[0] + "\n" + "a,x,1985,C1,400\n" * 100)
    lines = tdint("inventory", "many.csv", "--units", "m", code=3).stderr.splitlines()
    errors = [line for line in lines if line.startswith("Error")]
    assert len(errors) == 11 and errors[-1].endswith("and 90 more faults, 100 in all")


def test_modes_under_a_design_spectrum(folder, tdint):
    """The rows: test_interface.py."""
    arguments = ("modes", CONFIGS / "ten-story.yaml", "--target", "asce7:sds=0.4,sd1=0.3,tl=8")
    result = tdint(*arguments, "--plot=m.png", code=0)
    assert "All modes are included (100 % of the mass)." in result.stderr
    assert (folder / "m.png").exists()
