"""Attachments and links on the command line: tables, history, summary, first model."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

import tdint as package
from building_cases import noise
from csv_rows import rows
from selection import every
from tdint.errors import UsageError
from tdint.output.figures.mode_shapes import mode_picture
from tdint.output.figures.runs import run_picture
from tdint.output.tables.buildings import device_model_table

MODEL = """
units: {length: m, force: kN, mass: t}
stories: [{repeat: 2, mass: 100, height: 3, stiffness: 6.0e4}]
attachments: [{name: water tank, floor: 1, mass: 4, stiffness: 600, dashpot: 3}]
links:
  - {name: cable, from: water tank, to: roof, stiffness: 50}
  - {from: 2, to: ground, dashpot: 90}
initial: {velocity: [0.1, 0.2]}
analysis: {method: newmark-average, dt: 0.02, duration: 0.4}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.yaml").write_text(MODEL)
    return tmp_path


def test_an_attachment_that_still_moves_is_named(folder, tdint):
    """A tank of 10 Hz without a dashpot on a building that comes to rest: the stated
    amplitude is that of its free vibration."""
    (folder / "model.yaml").write_text(
        """
units: {length: m, force: kN, mass: t}
stories: [{mass: 100, height: 3, stiffness: 6.0e4, dashpot: 2000}]
attachments: [{name: tank, floor: 1, mass: 1.0e-6, stiffness: 3.947842e-3}]
excitation: {record: {file: rest.csv, units: m/s^2}}
initial: {displacement: [0.0], velocity: [0.1]}
analysis: {method: moment4, dt: 0.005, duration: 3.02}
"""
    )
    lines = "".join(f"{0.01 * i:.2f},0\n" for i in range(400))
    (folder / "rest.csv").write_text("time_s,acceleration\n" + lines)
    printed = tdint("run", "model.yaml", "-o", "out", "--history", code=0).stderr
    (tank,) = rows((folder / "out/attachments.csv").read_text())
    history = rows((folder / "out/history.csv").read_text())[-40:]
    amplitude = max(abs(float(row["tank_drift_m"])) for row in history)
    assert abs(float(tank["residual_drift_m"])) < 0.9 * amplitude
    assert f"tank still vibrates at the end (deformation by about +-{1e3 * amplitude:.2g} mm)" in (
        " ".join(printed.split())
    )
    note = "note: the pushover is without the attachments"
    assert note in tdint("pushover", "model.yaml", "--drift", "1mm", code=0).stderr


def test_tables_of_attachments_and_links(folder, tdint):
    printed = tdint("run", "model.yaml", "-o", "out", "--history", "--plot", code=0)
    (tank,) = rows((folder / "out/attachments.csv").read_text())
    cable, damper = rows((folder / "out/links.csv").read_text())
    stories = rows((folder / "out/stories.csv").read_text())
    history = rows((folder / "out/history.csv").read_text())
    assert len(stories) == 2
    assert tank["attachment"] == "water tank" and tank["floor"] == "1"
    assert (cable["from"], cable["to"]) == ("water tank", "2")
    assert (damper["link"], damper["from"], damper["to"]) == ("link_2", "2", "ground")
    drift = float(tank["peak_drift_m"])
    assert float(tank["peak_shear_N"]) == pytest.approx(6e5 * drift, rel=1e-6)
    assert drift >= 0.999 * max(abs(float(row["water_tank_drift_m"])) for row in history)
    assert float(tank["peak_drift_m_error"]) > 0.0
    force = float(cable["peak_force_N"])
    assert force == pytest.approx(5e4 * float(cable["peak_deformation_m"]), rel=1e-6)
    assert float(damper["peak_force_N"]) == 0.0 < float(damper["peak_damper_force_N"])
    # The deformation of a link to the ground is minus the displacement of the floor.
    last = history[-1]
    assert float(last["link_2_deformation_m"]) == -float(last["floor_2_displacement_m"])
    summary = json.loads((folder / "out/summary.json").read_text())
    assert summary["attachments"][0]["peak_drift_m"] == pytest.approx(drift)
    assert {"peak_deformation_m", "peak_force_N"} <= set(summary["meanings"])
    assert "Attachment water tank on floor 1: stroke" in printed.stderr


def test_modes_are_those_of_the_complete_system(folder, tdint):
    printed = tdint("modes", "model.yaml", code=0)
    assert len(rows(printed.stdout)) == 3
    assert "the damping of the stories uses their modes alone" in printed.stderr.replace("\n", " ")
    shapes = tdint("modes", "model.yaml", "--shapes", code=0).stdout.splitlines()[0].split(",")
    assert shapes[-3:] == ["floor_1_shape", "floor_2_shape", "water_tank_shape"]


def test_figure_of_modes_shows_the_floors_without_attachments(folder):
    (axes,) = mode_picture(package.modes("model.yaml"), name="").axes
    shape = axes.lines[1]  # after the line at 0
    assert shape.get_ydata().tolist() == [0, 1, 2] and shape.get_xdata()[-1] == pytest.approx(1.0)


SHAKEN = """
name: shaken
units: {length: m, force: kN, mass: t}
stories:
  - mass: 100
    height: 3
    elements:
      - {name: frame, type: bilinear, stiffness: 5.0e+4, yield_force: 150, hardening: 5%}
      - {name: wall, type: linear, stiffness: 1.0e+4}
  - {mass: 100, height: 3, stiffness: 5.0e+4}
attachments:
  - {name: tank, floor: 1, mass: 4, stiffness: 600, dashpot: 3}
  - name: absorber
    floor: roof
    mass: 6
    stiffness: 900
    law: {type: bilinear, yield_force: 15, hardening: 5%}
links:
  - {name: lower, from: 2, to: ground, dashpot: 90}
  - {name: x-brace, from: ground, to: 2, stiffness: 2.0e+3, dashpot: 20}
damping: 3%
analysis: {dt: 0.02}
"""
TABLES = ("stories.csv", "elements.csv", "attachments.csv", "links.csv")


@pytest.fixture
def shaken(folder):
    """Model without excitation, and two ground motions of 2 s."""
    Path("m.yaml").write_text(SHAKEN)
    for name, seed in (("a", 1), ("b", 2)):
        motion = noise(samples=101, dt=0.02, peak=6.0, seed=seed)
        lines = [f"{0.02 * i:g},{value}" for i, value in enumerate(motion.acceleration)]
        Path(f"{name}.csv").write_text("\n".join(["time_s,acceleration_m_s2", *lines]))
    return folder


def tables(directory, names=TABLES):
    """Return the rows of tables of stories and devices in a directory."""
    return {name: rows(Path(directory, name).read_text()) for name in names}


def without_energies(line):
    """Return a row without the hysteretic energies of stories, which campaigns do not store."""
    return {name: cell for name, cell in line.items() if "hysteretic_energy_J" not in name}


@pytest.mark.parametrize("check", every(2, ["--no-check", "--check"]))
def test_campaigns_have_the_tables_of_single_runs(shaken, tdint, check):
    """Shards of which one is interrupted and continued, their merged store and the table of several
    runs contain the cells of the single runs, with building, record and scale before them."""
    expected = {name: [] for name in TABLES}
    for name in "ab":
        for scale in "12":
            out = name + scale
            tdint("run m.yaml", f"{name}.csv", "--scale", scale, check, "-o", out, code=0)
            head = {"building": "shaken", "record": f"{name}.csv", "component": "", "scale": scale}
            for table, lines in tables(out).items():
                expected[table] += [head | without_energies(line) for line in lines]
    assert [line["attachment"] for line in expected["attachments.csv"][:2]] == ["tank", "absorber"]
    tdint(f"run m.yaml a.csv b.csv --scale 1,2 {check} -o several", code=0)
    assert tables("several", TABLES[1:]) == {name: expected[name] for name in TABLES[1:]}
    Path("c.yaml").write_text(
        "buildings: {models: [m.yaml]}\nrecords: {files: [a.csv, b.csv]}\n"
        f"intensity: {{scales: [1, 2]}}\nanalysis: {{check: {str(check == '--check').lower()}}}\n"
        "outputs: {stories: true}\n"
    )
    tdint("campaign c.yaml -o part1 --shard 1/2 --max-runs 1", code=0)
    for shard in "12":
        tdint(f"campaign c.yaml -o part{shard} --shard {shard}/2", code=0)
    tdint("campaign merge part1 part2 -o merged", code=0)
    assert tables("merged") == expected


def test_limits_of_attachments_and_links(shaken, tdint):
    """A demand just below a limit is met, just above exceeded; a campaign uses the mean over the
    motions, of the device with the largest ratio to its limit."""
    strokes, forces = {"tank": [], "absorber": []}, []
    for name in "ab":
        tdint(f"run m.yaml {name}.csv --no-check -o {name}", code=0)
        for row in rows(Path(name, "attachments.csv").read_text()):
            strokes[row["attachment"]].append(float(row["peak_drift_m"]))
        damper, _ = rows(Path(name, "links.csv").read_text())
        forces.append(float(damper["peak_damper_force_N"]))
    mean = {name: sum(values) / 2 for name, values in strokes.items()}
    for factor in (0.999, 1.001):
        # The absorber is the first to exceed its limit. File units: m and kN.
        limits = {
            "attachment_stroke": {"absorber": f"{1e3 * factor * mean['absorber']} mm", "tank": 9},
            "levels": {"stop": {"link_force": {"lower": 2e-3 * forces[0], "others": 1e6}}},
        }
        Path("m.yaml").write_text(SHAKEN + yaml.safe_dump({"limits": limits}))
        Path("c.yaml").write_text(
            "buildings: {models: [m.yaml]}\nrecords: {files: [a.csv, b.csv]}\n"
        )
        name = f"out{factor}"
        printed = tdint("campaign c.yaml --require -o", name, code=5 if factor < 1.0 else 0)
        assert "mean attachment stroke" in printed.stderr
        stroke, force = json.loads(Path(name, "summary.json").read_text())["limits"]
        assert stroke["met"] == (factor > 1.0) and force["met"]
        assert stroke["attachment_stroke_m"] == pytest.approx(mean["absorber"])
        assert stroke["limit_attachment"] == "absorber"
        assert force["link_force_N"] == pytest.approx(sum(forces) / 2)
        assert force["limit_link"] == "lower" and force["level"] == "stop"
        (check,) = package.run("m.yaml", "a.csv", check=False).limit_checks("stop")
        assert check.ratio == pytest.approx(0.5) and check.place(check.story) == "lower"
    with pytest.raises(UsageError, match="contain no attachments and links"):
        package.run_many(["m.yaml"], ["a.csv"]).limit_checks()


@pytest.mark.parametrize(
    ("limit", "message"),
    [
        ("attachment_stroke: {tnk: 1}", "attachment 'tnk' not found; did you mean 'tank'?"),
        ("link_deformation: {tank: 1}", "link 'tank' not found; names: lower, x-brace, others"),
        ("link_force: {}", "is empty; give a mapping from names to limits"),
        ("attachment_stroke: -1 mm", "must be a number with its unit, such as 300 mm"),
    ],
)
def test_invalid_limits(shaken, tdint, limit, message):
    Path("m.yaml").write_text(f"{SHAKEN}limits: {{{limit}}}\n")
    assert message in " ".join(tdint("check m.yaml", code=3).stderr.split())


def test_floor_spectrum_of_an_attachment(shaken, tdint):
    """It equals the spectrum of its acceleration in the history."""
    options = "--no-check --floor-period 0.2,0.5 --floor-spectra"
    tdint(f"run m.yaml a.csv --history -o out {options} tank,roof", code=0)
    spectra = rows(Path("out/floor-spectra.csv").read_text())
    assert [row["floor"] for row in spectra] == ["tank", "tank", "2", "2"]
    column = "--column tank_absolute_acceleration_m_s2"
    printed = tdint(f"spectrum out/history.csv --units m/s^2 --period 0.2,0.5 {column}", code=0)
    expected = [float(row["psa_m_s2"]) for row in rows(printed.stdout)]
    assert [float(row["psa_m_s2"]) for row in spectra[:2]] == pytest.approx(expected, rel=1e-3)
    refused = tdint(f"run m.yaml a.csv -o other {options} tnk", code=2)
    assert "from 1 to 2, tank, absorber, or roof" in " ".join(refused.stderr.split())


def test_reversed_ends_reverse_the_sign_of_the_deformation(shaken):
    """Peaks are equal; the residual deformation is that of the history."""
    results = []
    for ends in ("from: ground, to: 2", "from: 2, to: ground"):
        Path("m.yaml").write_text(SHAKEN.replace("from: ground, to: 2", ends))
        response = package.run("m.yaml", "a.csv", history=True, check=False)
        residual = response.devices.stories.residual_drift
        np.testing.assert_array_equal(residual, response.history.devices.drift[-1])
        results.append((residual[3], response.devices.stories.peak_drift[3]))
    assert results[0][0] == -results[1][0] != 0.0 and results[0][1] == results[1][1]


def test_figure_and_report_show_attachments_and_links(shaken):
    response = package.run("m.yaml", "a.csv", history=True, check=False)
    panels = {axes.get_ylabel(): axes for axes in run_picture(response).axes}
    largest = response.devices.stories.peak_drift[:2].max()
    stroke = panels["stroke (m)"].lines[0].get_ydata()  # the largest stroke is the first line
    assert np.abs(stroke).max() == pytest.approx(largest, rel=1e-2)
    loop = panels["force of link (kN)"].lines[0]
    devices = response.history.devices
    total = devices.shear + devices.damper_force
    largest_force = np.abs(total[:, 2:]).max()
    assert np.abs(loop.get_ydata()).max() == pytest.approx(1e-3 * largest_force)
    plain = {**yaml.safe_load(SHAKEN.replace("e+", "e+0")), "attachments": None, "links": None}
    model = package.load_model({key: value for key, value in plain.items() if value is not None})
    figure = run_picture(package.run(model, "a.csv", history=True, check=False))
    assert not {"stroke (m)", "force of link (kN)"} & {axes.get_ylabel() for axes in figure.axes}
    table = device_model_table(package.load_model("m.yaml")).rows
    assert [row[:4] for row in table] == [
        ("tank", "floor 1", 4e3, 6e5),
        ("absorber", "floor 2", 6e3, 9e5),
        ("lower", "2 to ground", None, None),
        ("x-brace", "ground to 2", None, 2e6),
    ]
    assert table[1][4].startswith("bilinear") and table[2][5].startswith("9e+04 v")
    assert device_model_table(model) is None


ROWS = """
units: {length: m, force: kN, mass: t}
matrices:
  names: [deck, tip]
  mass: [300, 120]
  stiffness: [[9000, -3000], [-3000, 3000]]
  damping: [[40, 0], [0, 20]]
attachments: [{name: tmd, floor: tip, mass: 10, stiffness: 200, dashpot: 5}]
links: [{name: strut, from: deck, to: tip, dashpot: 40}, {from: ground, to: deck, stiffness: 100}]
excitation: {record: {file: motion.csv, units: m/s^2}}
"""


def test_tables_name_the_rows_of_devices(folder, tdint):
    (folder / "model.yaml").write_text(ROWS)
    (folder / "motion.csv").write_text(
        "time_s,acceleration\n" + "".join(f"{0.02 * i:.2f},{i % 7 - 3}\n" for i in range(60))
    )
    printed = tdint("run", "model.yaml", "-o", "out", "--history", code=0).stderr
    assert "Attachment tmd on row tip: stroke" in printed
    (tmd,) = rows((folder / "out/attachments.csv").read_text())
    strut, link = rows((folder / "out/links.csv").read_text())
    assert tmd["floor"] == "tip" and (strut["from"], strut["to"]) == ("deck", "tip")
    assert (link["from"], link["to"]) == ("ground", "deck")
    summary = json.loads((folder / "out/summary.json").read_text())
    assert summary["attachments"][0]["floor"] == "tip"
    history = rows((folder / "out/history.csv").read_text())
    strokes = [float(row["tmd_drift_m"]) for row in history]
    assert max(map(abs, strokes)) == pytest.approx(float(tmd["peak_drift_m"]), rel=0.02)
    for row in history:
        difference = float(row["tip_displacement_m"]) - float(row["deck_displacement_m"])
        assert float(row["strut_deformation_m"]) == pytest.approx(difference, abs=1e-11)
    modes = rows(tdint("modes", "model.yaml", "--shapes", code=0).stdout)
    assert {"deck_shape", "tip_shape", "tmd_shape"} <= modes[0].keys() and len(modes) == 3
    tdint.refused("not for rows of `matrices`", "modes", "model.yaml", "--transfer", code=2)
