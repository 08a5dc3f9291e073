"""`tdint init` with real data (weights, story curves, motions), and the mode shapes of `tdint
modes`."""

from pathlib import Path

import numpy as np
import pytest

from csv_rows import rows
from tdint.ground_motion.reading.read import read_record
from tdint.model.building import assemble
from tdint.model.config.model_file import load_model
from tdint.units import STANDARD_GRAVITY


@pytest.mark.parametrize(("units", "newton"), [("si", 1e3), ("us", 4448.2216152605)])
def test_weights_and_period_define_a_building(folder, tdint, units, newton):
    """The period agrees with the eigenvalues of dense matrices, and the first mode is a straight
    line."""
    tdint("init f.yaml --period 1.1 --weights", "4200, 3x3900,3400", "--units", units, code=0)
    model = load_model("f.yaml")
    masses = np.array([story.mass for story in model.stories])
    assert masses == pytest.approx(
        np.array([4200, 3900, 3900, 3900, 3400]) * newton / STANDARD_GRAVITY, rel=1e-9
    )
    k = np.array([story.stiffness for story in model.stories] + [0.0])
    matrix = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    values, vectors = np.linalg.eigh(matrix / np.sqrt(np.outer(masses, masses)))
    assert 2.0 * np.pi / np.sqrt(values[0]) == pytest.approx(1.1, rel=1e-8)
    shape = vectors[:, 0] / np.sqrt(masses)
    assert shape / shape[-1] == pytest.approx(np.arange(1, 6) / 5.0, abs=1e-7)


FROM_CURVES = ("init", "b.yaml", "--weights")


def curves(file: str, *stories: tuple[list[float], list[float]]) -> None:
    lines = ["story,drift_mm,shear_kN"]
    for number, (drift, shear) in enumerate(stories, start=1):
        lines += [
            f"{number},{d!r},{np.interp(d, drift, shear).item()!r}"
            for d in np.linspace(0.0, 80.0, 41).tolist()
        ]
    Path(file).write_text("\n".join(lines) + "\n")


def test_fitted_laws_reproduce_their_pushover_curves(folder, tdint):
    curves("two.csv", ([0, 12, 80], [0, 600, 940]), ([0, 8, 80], [0, 480, 912]))
    result = tdint(*FROM_CURVES, "4000,3500", "--from-pushover", "two.csv", code=0)
    assert "Misfit of the stories" in result.stderr
    for story, stiffness, strength in zip(
        load_model("b.yaml").stories, (5e7, 6e7), (6e5, 4.8e5), strict=True
    ):
        assert (story.stiffness, story.law.parameters[0]) == pytest.approx(
            (stiffness, strength), rel=1e-5
        )
        assert story.law.parameters[1] == pytest.approx(0.1, rel=1e-4)
    curves("three.csv", ([0, 10, 40, 80], [0, 1000, 1400, 1400]))
    tdint(
        *FROM_CURVES,
        "4000",
        "--from-pushover",
        "three.csv",
        "--law",
        "trilinear",
        "--overwrite",
        code=0,
    )
    (story,) = load_model("b.yaml").stories
    assert story.stiffness == pytest.approx(1e8, rel=1e-5)
    assert story.law.parameters[:3] == pytest.approx((1e6, 1.4e6, 0.04), rel=1e-4)


def test_a_curve_without_a_corner_is_fitted_by_a_valid_law(folder, tdint):
    """The hardening ratio of a law must be less than 1. For a straight line and for a curve with
    increasing slope, the fit is just below this limit."""
    curves("line.csv", ([0, 80], [0, 800]), ([0, 40, 80], [0, 400, 1000]))
    tdint("init", "b.yaml", "--weights", "4000,3500", "--from-pushover", "line.csv", code=0)
    for story in load_model("b.yaml").stories:
        assert story.law.parameters[1] == 0.999
        assert story.stiffness == pytest.approx(1e7, rel=1e-6)


def test_a_falling_curve_is_fitted_by_a_multilinear_law(folder, tdint):
    """The law of the model reproduces the curve, including the part after its maximum shear, and
    the model runs; hysteresis loops reload along straight lines."""
    drift, shear = [0, 10, 40, 60, 80], [0, 1000, 1400, 700, 500]
    curves("fall.csv", (drift, shear), (drift, [2 * force for force in shear]))
    tdint(*FROM_CURVES, "2x4000", "--from-pushover", "fall.csv", "--law", "multilinear", code=0)
    for factor, story in zip((1.0, 2.0), load_model("b.yaml").stories, strict=True):
        points = np.array(story.law.parameters[:8]).reshape(4, 2)
        assert points[:, 0] == pytest.approx(1e-3 * np.array(drift[1:]), rel=1e-3)
        assert points[:, 1] == pytest.approx(1e3 * factor * np.array(shear[1:]), rel=1e-3)
    assert len(tdint("law", "b.yaml", "--drift", "20mm", "--story", "1").stdout.splitlines()) > 10
    tdint("run", "b.yaml", "-o", "out", code=0)


BAD_CURVES = {
    "few.csv": "story,drift_mm,shear_kN\n1,0,0\n1,1,1\n",
    "second.csv": "story,drift_mm,shear_kN\n2,0,0\n2,1,1\n2,2,2\n2,3,3\n",
    "units.csv": "story,drift,shear\n1,0,0\n",
}


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        ("--weights 4000 --from-pushover few.csv", 3, "at least 4 points"),
        ("--weights 4000 --from-pushover second.csv", 3, "story"),
        ("--weights 4000 --from-pushover units.csv", 3, "drift_m"),
        ("--motion saw:pga=1g", 2, "artificial ground motion 'saw' not found"),
        ("--motion sine:frequency=1.5,duration=20,pga=0.1", 2, "with its unit"),
        (
            "--motion sine:frequency=-1,duration=20,pga=0.1g",
            2,
            "frequency must be a positive number",
        ),
        ("--motion sine:frequency=1", 2, "sine requires duration, pga"),
        ("--motion pulse:period=1,velocity=1,pga=2g", 2, "pulse has no parameter 'pga'"),
        ("--weights 1,2y", 2, "2y"),
        ("--weights 0x3", 2, "0x3"),
        ("--from-pushover few.csv", 2, "--from-pushover"),
        ("--weights 1 --type C1", 2, "--type"),
    ],
)
def test_invalid_buildings_and_motions_are_refused(folder, tdint, line, code, message):
    for name, text in BAD_CURVES.items():
        Path(name).write_text(text)
    tdint.refused(message, "init", "b.yaml", *line.split(), code=code)


@pytest.mark.parametrize(
    ("motion", "ends", "phase"),
    [
        ("sine:frequency=1.5,duration=18,pga=0.1g", 23, lambda t: 3.0 * t),
        ("sweep:first=1,last=5,duration=10,pga=0.1g", 20, lambda t: 2.0 * (t + 0.2 * t**2)),
    ],
    ids=["sine", "sweep"],
)
def test_artificial_motions_for_teaching(folder, tdint, motion, ends, phase):
    """The motions end with 5 s of rest and have a duration of at least 20 s."""
    tdint("init", "f.yaml", "--motion", motion, code=0)
    assert "-0" not in Path("f-motion.txt").read_text().splitlines()
    record = read_record("f-motion.txt")
    t = record.dt * np.arange(record.acceleration.size)
    assert t[-1] == pytest.approx(ends)
    wave = np.where(
        t <= float(motion.partition("duration=")[2].partition(",")[0]),
        np.sin(np.pi * phase(t)),
        0.0,
    )
    assert record.acceleration == pytest.approx(0.1 * STANDARD_GRAVITY * wave, abs=1e-6)
    tdint("run", "f.yaml", "-q", code=0)


def test_shapes_of_modes(folder, tdint, drawn):
    """The shapes are 1 at the roof, or have a participation factor of 1 and sum to 1 at
    each floor."""
    tdint("init", "f.yaml", "--weights", "4200,2x3900,3400")
    by_roof = rows(tdint("modes", "f.yaml", "--shapes", "roof", "--plot=m.png").stdout)
    assert [float(row["floor_4_shape"]) for row in by_roof] == pytest.approx([1.0] * 4)
    assert rows(tdint("modes", "f.yaml", "--shapes").stdout) == by_roof
    assert Path("m.png").stat().st_size > 10_000
    by_participation = rows(tdint("modes", "f.yaml", "--shapes", "participation").stdout)
    for floor in range(1, 5):
        name = f"floor_{floor}_shape"
        assert sum(float(row[name]) for row in by_participation) == pytest.approx(1.0)
        for roof_row, participation_row in zip(by_roof, by_participation, strict=True):
            assert float(participation_row[name]) == pytest.approx(
                float(roof_row["participation"]) * float(roof_row[name]), abs=1e-9
            )


def test_modes_have_damping_ratios_with_p_delta(folder, tdint):
    """The damping ratio is the ratio of the uncoupled mode: phi^T C phi / (2 omega)."""
    tdint("init", "f.yaml", "--weights", "4200,2x3900,3400")
    Path("f.yaml").write_text(Path("f.yaml").read_text().replace("p_delta: false", "p_delta: true"))
    result = tdint("modes", "f.yaml")
    assert "damping couples the modes because of P-delta, which reduces" in result.stderr
    building = assemble(load_model("f.yaml"))
    modes = building.modes()
    for row, omega, shape in zip(rows(result.stdout), modes.omega, modes.shapes.T, strict=True):
        own = shape @ building.damping_matrix() @ shape / (2.0 * omega)
        assert float(row["damping"]) == pytest.approx(own, rel=1e-9)
