"""`tdint methods` and `tdint modes`."""

import pytest

from csv_rows import rows


def test_modes(folder, tdint):
    result = tdint("modes", "-", stdin=(folder / "shaken.yaml").read_bytes(), code=0)
    (warning,) = result.stderr.splitlines()
    assert warning.startswith("Warning: unusual mass of a floor")
    table = rows(result.stdout)
    assert [row["mode"] for row in table] == ["1", "2"]
    assert [float(row["damping"]) for row in table] == pytest.approx([0.05, 0.05])
    assert float(table[-1]["cumulative_mass_ratio"]) == pytest.approx(1.0)
    assert float(table[0]["period_s"]) * float(table[0]["frequency_hz"]) == pytest.approx(1.0)
    tdint.refused("Error: missing.yaml: file not found", "modes", "missing.yaml", code=3)


def test_each_mode_has_its_own_ratio_of_coupled_damping(folder, tdint):
    """The first ratio equals the ratio that `tdint check` reports."""
    result = tdint("modes", "forced.yaml", code=0)
    first, second = (float(row["damping"]) for row in rows(result.stdout))
    checked = rows(tdint("check", "forced.yaml").stdout)
    assert abs(first - float(checked[0]["t1_damping"])) < 1e-9 * first < second
    assert "\nnote: damping couples the modes because of dashpots; each" in result.stderr
