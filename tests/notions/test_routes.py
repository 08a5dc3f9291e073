"""Each notion of src/NOTIONS.md has the same value by all routes: Python functions, commands,
tables, JSON files and campaigns, for ten kinds of buildings in SI and US units."""

import csv
import io
import json
import math
import re
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

import tdint
from separate_streams import runner
from tdint.response.runs.demands import demands
from tdint_cli.main import cli

DT, SAMPLES = 0.02, 251
SI = "units: {length: m, force: kN, mass: t}\n"
YIELDING = (
    "stories: [{repeat: 3, mass: 60, height: 3.2, stiffness: 2.5e4, law: {type: bilinear, "
    "yield_force: 150, hardening: 3%}}]\n"
)
BUILDINGS = {
    "ordinary": SI + YIELDING + "damping: 5%\n",
    "dashpots": SI
    + YIELDING.replace("stiffness: 2.5e4", "stiffness: 2.5e4, dashpot: 200")
    + "damping: 3%\n",
    "devices": "units: {length: in, force: kip}\n"
    "stories: [{repeat: 3, weight: 130, height: 126, stiffness: 170, dashpot: .8, law: {type: "
    "bilinear, yield_force: 60, hardening: 5%}}]\n"
    "damping: 3%\n"
    "attachments: [{name: tmd, floor: roof, weight: 12, stiffness: 2.2, dashpot: .06}]\n"
    "links:\n  - {name: damper, from: ground, to: 2, dashpot: 1.5}\n"
    "  - {name: brace, from: 1, to: 3, stiffness: 60, law: {type: bilinear, yield_force: 14, "
    "hardening: 2%}}\n",
    "isolated": SI
    + "stories:\n  - {mass: 70, height: 0.3, isolator: true, stiffness: 5.0e3, law: {type: "
    "bilinear, yield_force: 60, hardening: 10%}}\n"
    "  - {repeat: 2, mass: 60, height: 3.2, stiffness: 4e4}\ndamping: 3%\n",
    "collapse": SI
    + YIELDING.replace("yield_force: 150, hardening: 3%", "yield_force: 60, hardening: 1%")
    + "damping: 3%\np_delta: true\ncollapse_drift: 2%\n",
    "inerters": SI
    + "stories: [{repeat: 3, mass: 60, height: 3.2, stiffness: 2.5e4, inertance: 10}]\n"
    "damping: 3%\n",
    "flexural": SI
    + "stories: [{repeat: 3, mass: 60, height: 3.2, flexural: {EI: 2.0e6, GA: 4e5}}]\n"
    "base: {rotation: 3.0e6}\ndamping: {modal: 4%}\n",
    "matrix": SI + "stories: [{mass: 100, height: 3}, {mass: 90, height: 3}, {mass: 80, height: "
    "3}]\nstiffness_matrix: [[90000, -48000, 9000], [-48000, 60000, -25000], [9000, -25000, "
    "17000]]\ndamping: {rayleigh: {ratio: 4%, modes: [1, 2]}}\n",
    "elements": SI + "stories:\n  - repeat: 2\n    mass: 60\n    height: 3.2\n    dashpot: "
    "{coefficient: 150, brace: 4.0e4}\n    elements:\n      - {name: frame, stiffness: 2.0e4, "
    "type: bilinear, yield_force: 120, hardening: 3%}\n      - {name: rest, stiffness: 5.0e3, "
    "type: linear}\ndamping: 3%\np_delta: true\n",
    "one": SI + "stories: [{mass: 60, height: 3.2, stiffness: 1.0e4, law: {type: bilinear, "
    "yield_force: 80, hardening: 3%}}]\ndamping: 5%\n",
}
"""Model files by the kind of building; `devices` is in US units."""

DIRECTIONS = ("x", "y")
ONE_DIRECTION = {"isolated"}
"""Buildings that two directions refuse: isolators that yield."""

UNITS = {
    "peak_drift": "_m", "peak_drift_ratio": "", "residual_drift": "_m", "peak_shear": "_N",
    "peak_damper_force": "_N", "peak_total_shear": "_N", "ductility": "",
    "peak_displacement": "_m", "peak_velocity": "_m_s",
    "peak_absolute_acceleration": "_m_s2",
}  # fmt: skip
"""Ends of the columns of story quantities."""

NOTIONS = Path(__file__).parents[2] / "src" / "NOTIONS.md"
HERE = "tests/notions/test_routes.py"


class Values:
    """Values of a building by notion, place and route. A route whose name starts with < is a lower
    bound, because it contains only the ends of the time steps."""

    def __init__(self) -> None:
        self.values = defaultdict(dict)

    def put(self, notion, place, route, value):
        """Store a value; an empty cell and None are nan."""
        if isinstance(value, str) and re.fullmatch(r"[-+.\deE]*", value):
            value = float(value) if value else math.nan
        self.values[notion, str(place)][route] = math.nan if value is None else value

    def put_stories(self, route, source, row=...):
        """Store story quantities of an object with arrays."""
        for name in UNITS:
            for story, value in enumerate(np.atleast_1d(getattr(source, name)[row]), start=1):
                self.put(name, story, route, float(value))

    def put_errors(self, route, source, row=...):
        """Store estimated errors of story quantities."""
        for name in UNITS:
            for story, value in enumerate(np.atleast_1d(getattr(source, name)[row]), start=1):
                self.put("error estimate", f"{name} {story}", route, float(value))

    def put_table(self, route, table):
        """Store the rows of a table of stories."""
        for row in table:
            for name, end in UNITS.items():
                if (column := f"{name}{end}") in row:
                    self.put(name, row["story"], route, row[column])
                    if f"{column}_error" in row:
                        place = f"{name} {row['story']}"
                        self.put("error estimate", place, route, row[f"{column}_error"])
            if "hysteretic_energy_J" in row:
                self.put("hysteretic energy", row["story"], route, row["hysteretic_energy_J"])

    def put_run(self, route, row):
        """Store the cells of a row of a table of runs."""
        for column, notion in RUN_COLUMNS.items():
            if column in row:
                self.put(notion, "building", route, row[column])

    def disagreements(self, tolerance=2e-9):
        """Return the notions whose routes differ, with their values."""
        return [
            (key, routes) for key, routes in self.values.items() if not _agree(routes, tolerance)
        ]


RUN_COLUMNS = {
    "peak_roof_displacement_m": "roof displacement",
    "peak_base_shear_N": "base shear",
    "peak_drift_ratio": "largest drift ratio",
    "peak_drift_m": "largest drift",
    "peak_isolator_displacement_m": "isolator displacement",
    "residual_drift_ratio": "largest residual drift ratio",
    "peak_absolute_acceleration_m_s2": "largest floor acceleration",
    "energy_error": "energy error",
    "steps": "steps",
    "dt_s": "time step",
    "status": "status",
    "sa_t1_m_s2": "spectral acceleration",
    "pga_m_s2": "peak ground acceleration",
    "collapse_time_s": "collapse time",
}
"""Notions of the columns of runs.csv."""

DEMANDS = {
    "roof_displacement": "roof displacement",
    "base_shear": "base shear",
    "total_base_shear": "total base shear",
    "drift": "largest drift",
    "drift_ratio": "largest drift ratio",
    "isolator_displacement": "isolator displacement",
    "residual_drift_ratio": "largest residual drift ratio",
    "peak_absolute_acceleration": "largest floor acceleration",
}
"""Notions of the attributes of demands and of the peaks in summary.json."""


def _agree(routes, tolerance):
    """Return True if the values agree within a relative tolerance, and bounds are not exceeded."""
    exact = [value for route, value in routes.items() if not route.startswith("<")]
    first = exact[0]
    if isinstance(first, str):
        return set(exact) == {first}
    least = [value for route, value in routes.items() if route.startswith("<")]
    numbers = np.array(exact, float)
    if np.isnan(numbers).any():
        return bool(np.isnan(numbers).all())
    size = np.max(np.abs(numbers))
    return bool(
        np.ptp(numbers) <= tolerance * size + 1e-13
        and all(value <= size * (1.0 + 1e-9) + 1e-13 for value in least)
    )


def rows_of(text):
    return list(csv.DictReader(io.StringIO(text)))


def command(*words):
    """Run a command in this process and return its standard output."""
    result = runner().invoke(cli, [str(word) for word in words], prog_name="tdint")
    assert result.exit_code == 0, (words, result.stderr)
    return result.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Directory with the models, and two motions of two components as AT2 files in g."""
    folder = tmp_path_factory.mktemp("routes")
    for name, text in BUILDINGS.items():
        (folder / f"{name}.yaml").write_text(f"name: {name}\n{text}")
    time = DT * np.arange(SAMPLES)
    for number, peak in ((1, 0.45), (2, 0.6)):
        noise = np.random.default_rng(number).normal(size=SAMPLES)
        motion = np.convolve(noise, np.hanning(12), "same") * np.sin(np.pi * time / time[-1]) ** 2
        motion *= peak / np.max(np.abs(motion))
        rows = ["".join(f"{x:15.7E}" for x in motion[i : i + 5]) for i in range(0, SAMPLES, 5)]
        zeros = ["".join(f"{0.0:15.7E}" for _ in motion[i : i + 5]) for i in range(0, SAMPLES, 5)]
        write_motion(folder / f"RSN{number}_A000.AT2", rows)
        for axis in DIRECTIONS:
            (folder / axis).mkdir(exist_ok=True)
            moved, still = ("000", "090") if axis == "x" else ("090", "000")
            write_motion(folder / axis / f"RSN{number}_A{moved}.AT2", rows)
            write_motion(folder / axis / f"RSN{number}_A{still}.AT2", zeros)
    for name in BUILDINGS.keys() - ONE_DIRECTION:
        text = f"name: {name}\n{BUILDINGS[name]}excitation: {{azimuth: 0}}\n"
        (folder / f"both-{name}.yaml").write_text(text)
    return folder


def write_motion(path, rows):
    """Write a PEER file in g."""
    path.write_text(
        f"PEER NGA STRONG MOTION DATABASE RECORD\nTest, 1/1/2020, Station, {path.stem[-3:]}\n"
        f"ACCELERATION TIME SERIES IN UNITS OF G\nNPTS=  {SAMPLES}, DT=   {DT:.4f} SEC,\n"
        + "\n".join(rows)
        + "\n"
    )


@pytest.fixture(scope="module", params=BUILDINGS)
def values(request, folder):
    """All values of a building."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        found = Values()
        model = tdint.load_model(f"{request.param}.yaml")
        record = tdint.read_record("RSN1_A000.AT2")
        by_python(found, model, record)
        by_run(found, request.param, model)
        by_campaign(found, request.param)
        by_period(found, request.param, model, record)
        for axis in DIRECTIONS if request.param not in ONE_DIRECTION else ():
            by_two_directions(found, request.param, axis)
        return found


def by_python(found, model, record):
    """Store the values of `run`, `run_case`, a sequence of one event, and many runs."""
    many = tdint.run_many([model], [record], check=True)
    for route, result in (
        ("run", tdint.run(model, record, history=True)),
        ("run_case", tdint.run_case(tdint.prepare(model, record))),
        ("sequence of one", tdint.run_sequence(tdint.prepare(model), [record])),
    ):
        found.put_stories(route, result.stories)
        if result.check:
            found.put_errors(route, result.check.errors)
        for notion, value in (
            ("status", result.status), ("time step", result.dt), ("steps", result.steps),
            ("energy error", result.energy.error),
            ("collapse time", result.collapse.time if result.collapse else None),
        ):  # fmt: skip
            found.put(notion, "building", route, value)
        for name, notion in DEMANDS.items():
            found.put(notion, "building", route, getattr(demands(result.stories), name).value)
        for story, value in enumerate(result.hysteretic_energy, start=1):
            found.put("hysteretic energy", story, route, float(value))
        if route == "run":
            histories(found, model, result)
        if result.devices is not None:
            devices(found, route, result)
    found.put_stories("run_many", many.stories, 0)
    if many.errors is not None:
        found.put_errors("run_many", many.errors, 0)
    for notion, values in (
        ("status", many.status), ("time step", many.dt), ("steps", many.steps),
        ("energy error", many.energy_error),
    ):  # fmt: skip
        found.put(notion, "building", "run_many", values.tolist()[0])


def histories(found, model, response):
    """Store the largest values at time steps, and values at the end of histories."""
    history, count = response.history, len(model.stories)
    for name, attribute in (
        ("peak_drift", "drift"), ("peak_shear", "shear"), ("peak_total_shear", "total_shear"),
        ("peak_displacement", "displacement"), ("peak_velocity", "velocity"),
        ("peak_absolute_acceleration", "absolute_acceleration"),
    ):  # fmt: skip
        for story, value in enumerate(np.abs(getattr(history, attribute)).max(axis=0)[:count], 1):
            found.put(name, story, "< history", float(value))
    for name in ("input", "kinetic", "viscous", "dampers", "strain", "hysteretic", "braces"):
        found.put("energy", name, "run", getattr(response.energy, name))
        found.put("energy", name, "history", float(getattr(history.energy, name)[-1]))


DEVICE = {
    "peak_drift": "peak_drift_m", "residual_drift": "residual_drift_m",
    "peak_shear": "peak_shear_N", "peak_damper_force": "peak_damper_force_N",
}  # fmt: skip


def devices(found, route, response):
    """Store strokes, deformations and forces of attachments and links."""
    parts = [*response.model.attachments, *response.model.links]
    for i, part in enumerate(parts):
        for name in DEVICE:
            value = float(getattr(response.devices.stories, name)[i])
            found.put("device", f"{part.name} {name}", route, value)
        energy = float(response.devices.dissipated_energy[i])
        found.put("device energy", part.name, route, energy)


def device_tables(found, route, folder):
    """Store the tables of attachments and links of a directory."""
    for file, key in (("attachments", "attachment"), ("links", "link")):
        if not (folder / f"{file}.csv").exists():
            continue
        for row in rows_of((folder / f"{file}.csv").read_text()):
            named = {
                re.sub("deformation", "drift", re.sub("peak_force", "peak_shear", column)): cell
                for column, cell in row.items()
            }
            for name, column in DEVICE.items():
                if column in named:
                    found.put("device", f"{row[key]} {name}", route, named[column])
            if "dissipated_energy_J" in named:
                found.put("device energy", row[key], route, named["dissipated_energy_J"])


def by_run(found, name, model):
    """Store the files of `tdint run`, and the row of a run of several motions."""
    out = Path(f"run-{name}")
    command("run", f"{name}.yaml", "RSN1_A000.AT2", "-o", out, "-q")
    found.put_table("stories.csv", rows_of((out / "stories.csv").read_text()))
    device_tables(found, "attachments.csv, links.csv", out)
    summary = json.loads((out / "summary.json").read_text())
    for attribute, notion in DEMANDS.items():
        (value,) = (
            value
            for key, value in summary["peaks"].items()
            if re.fullmatch(rf"{attribute}(_m|_N|_m_s2)?", key)
        )
        found.put(notion, "building", "summary.json", value)
    for key, notion in (("status", "status"), ("dt_s", "time step"), ("steps", "steps")):
        found.put(notion, "building", "summary.json", summary[key])
    found.put("period", "building", "summary.json", summary["building"]["t1_s"])
    found.put(
        "spectral acceleration", "building", "summary.json", summary["building"]["sa_t1_m_s2"]
    )
    found.put("peak ground acceleration", "building", "summary.json", summary["record"]["pga_m_s2"])
    for name_of_energy, value in summary["energy"].items():
        notion = name_of_energy.removesuffix("_J")
        if ("energy", notion) in found.values:
            found.put("energy", notion, "summary.json", value)
    files = ["RSN1_A000.AT2", "RSN2_A000.AT2"]
    first, _ = rows_of(command("run", f"{name}.yaml", *files, "-q"))
    found.put_run("run of two motions", first)


def by_campaign(found, name):
    """Store the tables of a campaign of one building and one motion, and its measures."""
    Path(f"{name}.yml").write_text(
        f"buildings: {{models: [{name}.yaml]}}\nrecords: {{files: [RSN1_A000.AT2]}}\n"
        "outputs: {stories: true}\n"
    )
    out = Path(f"campaign-{name}")
    command("campaign", f"{name}.yml", "-o", out, "-q", "--im", "sa,pga")
    (row,) = rows_of((out / "runs.csv").read_text())
    found.put_run("runs.csv", row)
    for row in rows_of((out / "stories.csv").read_text()):
        for quantity, end in UNITS.items():
            if (column := f"{quantity}{end}") in row:
                found.put(quantity, row["story"], "stories.csv of a campaign", row[column])
    device_tables(found, "tables of a campaign", out)
    (row,) = rows_of((out / "measures.csv").read_text())
    found.put("spectral acceleration", "building", "measures.csv", row["sa_t1_m_s2"])
    found.put("peak ground acceleration", "building", "measures.csv", row["pga_m_s2"])


def by_period(found, name, model, record):
    """Store the period and the damping ratio of the first mode, and the spectral acceleration."""
    modes, overview = tdint.modes(model), tdint.check(f"{name}.yaml")
    (checked,) = rows_of(command("check", f"{name}.yaml", "-q"))
    first = rows_of(command("modes", f"{name}.yaml", "-q"))[0]
    for route, period in (
        ("modes", float(modes.period[0])), ("check in Python", overview.period),
        ("check", checked["t1_s"]), ("tdint modes", first["period_s"]),
    ):  # fmt: skip
        found.put("period", "building", route, period)
    for route, value in (
        ("modes", modes.damping[0]), ("check in Python", overview.damping),
        ("check", checked["t1_damping"]), ("tdint modes", first["damping"]),
    ):  # fmt: skip
        # Digits beyond these are rounding of the products of large stiffnesses (isolators)
        found.put("damping ratio", "building", route, round(float(value), 10))
    acceleration = float(tdint.spectrum(record, [modes.period[0]], 0.05).psa[0])
    found.put("spectral acceleration", "building", "spectrum", acceleration)
    found.put("peak ground acceleration", "building", "record", record.pga)


def by_two_directions(found, name, axis):
    """Store the values of the same building in two directions, of which the other one is at rest:
    `run`, `run_many`, a campaign, and the tables of the commands."""
    model, route = tdint.load_model(f"both-{name}.yaml"), f"two directions, {axis} moves"
    files = [f"{axis}/RSN1_A000.AT2", f"{axis}/RSN1_A090.AT2"]
    response = tdint.run(model, tuple(files))
    many = tdint.run_many([model], [tuple(files)], check=True)
    found.put_stories(route, response.stories)
    found.put_stories(f"{route}, run_many", many.stories, 0)
    for notion, value in (
        ("status", response.status), ("time step", response.dt), ("steps", response.steps),
        ("energy error", response.energy.error),
        ("collapse time", response.collapse.time if response.collapse else None),
    ):  # fmt: skip
        found.put(notion, "building", route, value)
    for attribute, notion in DEMANDS.items():
        found.put(notion, "building", route, getattr(demands(response.stories), attribute).value)
    if response.devices is not None:
        moved = response.directions[DIRECTIONS.index(axis)]
        devices(found, route, moved)
        for quantity in DEVICE:  # absolute values of both directions
            values = (getattr(part.devices.stories, quantity) for part in (moved, response))
            np.testing.assert_array_equal(*map(np.abs, values))
    # Errors of drift ratios beside devices are those of drifts in two directions.
    ratios = "peak_drift_ratio"
    for quantity in UNITS if response.devices is None else UNITS.keys() - {ratios}:
        values = getattr(response.check.errors, quantity), getattr(many.errors, quantity)[0]
        for kind, errors in zip(("", ", run_many"), values, strict=True):
            for story, value in enumerate(errors.tolist(), start=1):
                found.put("error estimate", f"{quantity} {story}", route + kind, value)
    out = Path(f"run-{name}-{axis}")
    command("run", f"both-{name}.yaml", *files, "-o", out, "-q")
    table = rows_of((out / "stories.csv").read_text())
    for part in (axis, "resultant"):
        cells = [row for row in table if row["direction"] == part]
        for row in cells if response.devices is not None and part == "resultant" else ():
            del row[f"{ratios}_error"]
        found.put_table(f"stories.csv, {part} of {route}", cells)
    Path(f"{name}-{axis}.yml").write_text(
        f"buildings: {{models: [both-{name}.yaml]}}\nrecords: {{files: [{', '.join(files)}]}}\n"
    )
    command("campaign", f"{name}-{axis}.yml", "-o", f"campaign-{name}-{axis}", "-q")
    (row,) = rows_of((Path(f"campaign-{name}-{axis}") / "runs.csv").read_text())
    # The intensities of a pair with a component at rest are 0.
    assert float(row["pga_m_s2"]) == float(row["sa_t1_m_s2"]) == 0.0
    del row["pga_m_s2"], row["sa_t1_m_s2"]
    found.put_run(f"runs.csv, {route}", row)


def test_all_routes_agree(values):
    """Numbers agree to printed digits, errors of estimates included."""
    assert values.disagreements() == []
    several = [key for key, routes in values.values.items() if len(routes) > 1]
    assert len(several) > 30


def test_each_notion_of_this_file_in_the_table_has_routes(values):
    """Notions without another test in the table have routes here."""
    listed = {
        row[0]
        for line in NOTIONS.read_text().splitlines()
        if line.startswith("| ") and line.endswith("| |")
        for row in [[cell.strip() for cell in line.strip("|").split("|")]]
    }
    found = {notion for notion, _ in values.values}
    # Only buildings with devices, and buildings without matrices, have these.
    assert listed - {"device", "device energy", "hysteretic energy"} <= found
    assert found <= listed
