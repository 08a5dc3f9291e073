"""`tdint init` with real data (weights, story curves, motions), and the mode shapes of `tdint
modes`."""

from pathlib import Path

import numpy as np
import pytest

from csv_rows import rows
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


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        ("--weights 1,2y", 2, "2y"),
        ("--weights 0x3", 2, "0x3"),
    ],
)
def test_invalid_buildings_and_motions_are_refused(folder, tdint, line, code, message):
    tdint.refused(message, "init", "b.yaml", *line.split(), code=code)


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
