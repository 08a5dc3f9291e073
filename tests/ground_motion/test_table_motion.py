"""Displacement or velocity of the ground as excitation, against closed forms and `solve_ivp`."""

import io

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tdint
from tdint.errors import ModelError, RecordError
from tdint.model.config.model_file import load_model
from tdint.response.arguments import model_record

STEP = 0.01
TIME = STEP * np.arange(501)
MODEL = """
stories: [{mass: 700, height: 3, stiffness: 4.1e5}, {mass: 520, height: 3, stiffness: 2.9e5}]
damping: {rayleigh: {mass: 0.4, stiffness: 0.002}}
plausibility: off, test
"""


def motion(t):
    """Displacement, velocity and acceleration of a table that starts at rest: A sin^3(w t)."""
    size, w = 0.02, 3.9
    s, c = np.sin(w * t), np.cos(w * t)
    return size * s**3, 3 * size * w * s**2 * c, 3 * size * w**2 * (2 * s * c**2 - s**3)


def write(path, column, values):
    lines = [f"Time (s),{column}", *(f"{t:.4f},{x:.9e}" for t, x in zip(TIME, values, strict=True))]
    path.write_text("\n".join(lines) + "\n")


def loaded(excitation):
    return load_model(io.StringIO(f"{MODEL}excitation: {{{excitation}}}\n"))


@pytest.mark.parametrize(
    ("key", "column", "order"),
    [("displacement", "Displacement (m)", 0), ("velocity", "Velocity (m/s)", 1)],
)
def test_response_to_a_table_with_known_motion(tmp_path, monkeypatch, key, column, order):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "table.csv", column, motion(TIME)[order])
    model = loaded(f"{key}: {{file: table.csv}}")
    response = tdint.run(model, duration=TIME[-1], check=False)
    mass, stiffness = np.diag([700.0, 520.0]), np.array([[7.0e5, -2.9e5], [-2.9e5, 2.9e5]])
    damping = 0.4 * mass + 0.002 * stiffness

    def rate(t, y):
        force = stiffness @ y[:2] + damping @ y[2:]
        return [*y[2:], *(-np.linalg.solve(mass, force) - motion(t)[2])]

    solution = solve_ivp(
        rate, (0, TIME[-1]), np.zeros(4), "DOP853", rtol=1e-9, atol=1e-12, dense_output=True
    )
    u = solution.sol(np.linspace(0, TIME[-1], 20_001))
    drifts = np.abs([u[0], u[1] - u[0]]).max(axis=1)
    assert response.stories.peak_drift == pytest.approx(drifts, rel=1e-4)


def test_the_ground_moves_through_the_samples(tmp_path, monkeypatch):
    # The double integral of the acceleration, linear between its samples, is the displacement.
    monkeypatch.chdir(tmp_path)
    u = 0.01 * (1.0 - np.cos(7.0 * TIME)) + 1e-4 * np.random.default_rng(3).normal(size=TIME.size)
    write(tmp_path / "table.csv", "Displacement (m)", u)
    a = model_record(loaded("displacement: table.csv")).acceleration
    change = STEP**2 / 6.0 * (a[:-2] + 4.0 * a[1:-1] + a[2:])
    assert change == pytest.approx(np.diff(u, 2), rel=1e-6, abs=1e-9)


def test_a_start_with_velocity_is_noted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "table.csv", "Displacement (m)", 0.01 * np.sin(6.0 * TIME))
    notes = model_record(loaded("displacement: table.csv")).notes
    assert "starts with a velocity of 0.06 m/s" in " ".join(notes)


def test_other_quantities_are_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "table.csv", "Acceleration (m/s^2)", motion(TIME)[2])
    with pytest.raises(RecordError, match=r"needs a displacement, but .* acceleration; use"):
        model_record(loaded("displacement: table.csv"))
    with pytest.raises(ModelError, match="do not fit the quantity displacement"):
        loaded("displacement: {file: table.csv, units: g}")
    with pytest.raises(ModelError, match="give either `record` or `displacement`, not both"):
        loaded("displacement: table.csv, record: table.csv")
