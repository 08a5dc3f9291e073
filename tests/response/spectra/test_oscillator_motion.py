"""Tests of the motion of single oscillators against closed forms, SciPy and the spectra."""

import csv
import math

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.signal import lsim

from tdint.errors import UsageError
from tdint.ground_motion.record import Record
from tdint.response.spectra.elastic import oscillator_motion, spectrum
from tdint_cli.main import cli


def noise(samples=500, dt=0.02):
    return Record(
        np.random.default_rng(3).standard_normal(samples), dt, "", "", "HN1", "noise.mseed"
    )


@pytest.mark.parametrize("period", [0.05, 0.7, 8.0])
def test_motion_agrees_with_scipy_and_spectrum(period):
    record, damping, omega = noise(), 0.05, 2.0 * math.pi / period
    found = oscillator_motion(record, period, damping)
    system = (
        [[0.0, 1.0], [-(omega**2), -2.0 * damping * omega]],
        [[0.0], [-1.0]],
        np.eye(2),
        np.zeros((2, 1)),
    )
    _, motion, _ = lsim(system, record.acceleration, found.time)
    largest = np.max(np.abs(motion), axis=0)
    assert found.displacement / largest[0] == pytest.approx(motion[:, 0] / largest[0], abs=1e-9)
    assert found.velocity / largest[1] == pytest.approx(motion[:, 1] / largest[1], abs=1e-9)
    peaks = spectrum(record, np.array([period]), damping, maxima="samples")
    assert np.max(np.abs(found.displacement)) == pytest.approx(peaks.sd[0], rel=1e-9)
    assert np.max(np.abs(found.absolute_acceleration)) == pytest.approx(peaks.sa[0], rel=1e-9)


def test_invalid_period_is_refused():
    for period in (0.0, -1.0, math.inf):
        with pytest.raises(UsageError, match="period"):
            oscillator_motion(noise(), period)


def test_spectrum_command_writes_oscillator_histories(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.csv").write_text(
        "time (s),a (m/s^2)\n" + "".join(f"{0.02 * i:.2f},{math.sin(i)}\n" for i in range(50))
    )
    run = ["spectrum", "a.csv", "--oscillator", "0.5,1", "--damping", "2%,5%"]
    done = CliRunner().invoke(cli, [*run, "--history", "-o", "motion.csv"])
    assert done.exit_code == 0, done.output
    with (tmp_path / "motion.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 4 * 50 and (tmp_path / "motion.json").exists()
    expected = oscillator_motion(Record(np.sin(np.arange(50.0)), 0.02, "", "", "", ""), 1.0, 0.02)
    found = [
        float(row["displacement_m"])
        for row in rows
        if (row["period_s"], row["damping"]) == ("1", "0.02")
    ]
    assert found == pytest.approx(expected.displacement, rel=1e-9)
    for more in (
        (),
        ("--history=x.csv",),
        ("--history", "--period", "1"),
        ("--history", "--plot=x.png"),
    ):
        assert CliRunner().invoke(cli, [*run, *more]).exit_code == 2
