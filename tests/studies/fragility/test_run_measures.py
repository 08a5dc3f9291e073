"""Intensity measures of runs compared with closed forms and independent calculations, and the
comparison of measures."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from tdint.errors import AnalysisError, ModelError, UsageError
from tdint.ground_motion.measures import cumulative_absolute_velocity_above, measure
from tdint.ground_motion.record import Record
from tdint.response.spectra.elastic import spectrum
from tdint.response.spectra.inelastic import constant_strength
from tdint.studies.fragility.measures import compare_measures, line, run_measure
from tdint.units import STANDARD_GRAVITY


def noise(seed=0, samples=400, dt=0.02, peak=2.0):
    values = np.random.default_rng(seed).standard_normal(samples) * np.sin(
        np.linspace(0.0, math.pi, samples)
    )
    return Record(peak * values / np.abs(values).max(), dt, "", "", "HN1", f"{seed}.mseed")


def test_cav5_of_ramp():
    """For a ramp from 0 to 0.2 m/s^2 in 4 s, the part above 0.05 is (0.2^2 - 0.05^2) / 2 over the
    slope."""
    ramp = Record(np.linspace(0.0, 0.2, 9), 0.5, "", "", "", "")
    assert measure(ramp).cav5 == pytest.approx(0.5 * (0.04 - 0.0025) / 0.05, rel=1e-12)
    flat = Record(np.full(11, 0.05), 0.1, "", "", "", "")
    assert measure(flat).cav5 == pytest.approx(0.05, rel=1e-12)
    assert measure(Record(np.full(11, 0.049), 0.1, "", "", "", "")).cav5 == 0.0


@pytest.mark.parametrize("threshold", [0.01, 0.05, 0.7])
def test_cav_above_threshold_agrees_with_fine_grid(threshold):
    record = noise(1)
    fine = 4000
    t = (np.arange((record.acceleration.size - 1) * fine) + 0.5) / fine
    values = np.abs(np.interp(t, np.arange(record.acceleration.size), record.acceleration))
    expected = np.sum(values[values >= threshold]) * record.dt / fine
    found = cumulative_absolute_velocity_above(record, threshold)
    assert found == pytest.approx(expected, rel=1e-4)
    assert cumulative_absolute_velocity_above(record, 0.0) == pytest.approx(
        measure(record).cav, rel=1e-12
    )


@pytest.mark.parametrize(
    "name",
    [
        "pga", "pgv", "pgd", "arias", "cav", "cav5", "d5-75", "d5-95", "sa", "sa:0.5", "sa-avg",
        "sa-avg:0.2:2:9",
    ],
)  # fmt: skip
def test_measure_of_scaled_motion(name):
    """The measure is multiplied by a power of the factor, as for the scaled motion."""
    record, measure = noise(2), run_measure(name)
    assert measure.of(record, -1.7, 0.8) == pytest.approx(
        measure.of(record.scaled(1.7), 1.0, 0.8), rel=1e-9
    )


def test_spectral_measures_agree_with_spectra():
    record = noise(3)
    periods = np.geomspace(0.2, 2.0, 50)
    psa = spectrum(record, np.array([0.5, 0.8]), 0.05).psa
    assert run_measure("sa:0.5").of(record, 2.0, 0.8) == pytest.approx(2.0 * psa[0])
    assert (
        run_measure("sa").of(record, 2.0, 0.8)
        == run_measure("sa:T1").of(record, 2.0, 0.8)
        == pytest.approx(2 * psa[1])
    )
    average = np.prod(spectrum(record, periods, 0.05).psa) ** (1.0 / 50.0)
    assert run_measure("sa-avg:0.2:2").of(record, 1.0, 0.8) == pytest.approx(average, rel=1e-9)
    assert run_measure("sa-avg").of(record, 1.0, 0.5) == pytest.approx(
        run_measure("sa-avg:0.1:1.5").of(record, 1.0, 9.0), rel=1e-9
    )


def test_inelastic_displacement_agrees_with_constant_strength_spectrum():
    """If the strength is not reached, the measure is the elastic Sd. A factor on the motion divides
    the strength."""
    record, period = noise(4), 0.8
    elastic = spectrum(record, np.array([period]), 0.05).sd[0]
    assert run_measure("sdi:0.8:1000%").of(record, 1.0, 9.0) == pytest.approx(elastic, rel=1e-6)
    needed = (2.0 * math.pi / period) ** 2 * elastic / STANDARD_GRAVITY
    strength = round(0.3 * needed, 6)
    weaker = constant_strength(record, np.array([period]), [strength / 1.7], 0.05)[0].sd[0]
    found = run_measure(f"sdi:T1:{strength}").of(record, 1.7, period)
    assert found == pytest.approx(1.7 * weaker, rel=1e-6)
    assert abs(found / (1.7 * elastic) - 1.0) > 0.01


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("pgx", "'pgx'; did you mean 'pg"), ("pga:1", "unknown intensity measure"),
        ("sa:0", "must be a positive number"), ("sa:x", "expected sa"), ("sdi", "expected sdi"),
        ("sdi:1", "expected sdi"), ("sdi:1:-1", "must be positive"),
        ("sdi:1:0", "must be positive"), ("sa-avg:1", "expected sa-avg"),
        ("sa-avg:2:1", "expected sa-avg"),
    ],
)  # fmt: skip
def test_unknown_measures_are_refused(text, message):
    with pytest.raises(UsageError, match=message):
        run_measure(text)


def test_too_short_period_leaves_cell_empty():
    assert math.isnan(run_measure("sdi:1e-6:0.1").of(noise(5), 1.0, 1.0))


def test_regression_line_agrees_with_least_squares():
    rng = np.random.default_rng(6)
    x, magnitude = rng.standard_normal(40), rng.uniform(5.0, 8.0, 40)
    y = 0.3 + 1.4 * x + 0.2 * magnitude + 0.1 * rng.standard_normal(40)
    each = np.arange(40)  # each run is under another motion
    found = line(x, y, "pgv", each)
    design = np.column_stack([np.ones(40), x])
    solution, residual, *_ = np.linalg.lstsq(design, y, rcond=None)
    beta = math.sqrt(residual[0] / 38.0)
    slopes = [np.polyfit(np.delete(x, i), np.delete(y, i), 1)[0] for i in each]
    error = math.sqrt(39.0 * float(np.var(slopes)))
    reported = (found.slope, found.beta, found.slope_error, found.proficiency)
    assert reported == pytest.approx((solution[1], beta, error, beta / solution[1]), rel=1e-9)
    assert found.r_squared == pytest.approx(np.corrcoef(x, y)[0, 1] ** 2, rel=1e-9)
    exact = line(x, 2.0 * x + 1.0, "pgv", each)
    assert (exact.slope, exact.beta) == pytest.approx((2.0, 0.0), abs=1e-12)


def test_too_few_runs_and_constant_measure_are_refused():
    with pytest.raises(AnalysisError, match="at least 3 completed runs, got 2"):
        line(np.zeros(2), np.zeros(2), "pgv", np.arange(2))
    with pytest.raises(AnalysisError, match="the same value in all runs"):
        line(np.zeros(3), np.arange(3.0), "pgv", np.arange(3))


def folder_of(tmp_path: Path, buildings=("a",)) -> Path:
    """Return a directory with runs whose drift is exactly pgv^1.5, the last of which collapsed."""
    rng = np.random.default_rng(7)
    header = ["building", "record", "component", "scale", "sample"]
    runs, measures = (
        [[*header, "status", "peak_drift_ratio", "sa_t1_m_s2"]],
        [[*header, "pgv_cm_s"]],
    )
    for building in buildings:
        for i in range(12):
            pgv, scale = 10.0 + 90.0 * rng.random(), 1.0 + i % 2
            status = "collapsed" if i == 11 else "done"
            runs.append(
                [building, f"{i}.csv", "X", scale, 0, status, pgv**1.5 * 1e-4, 1.0 + rng.random()]
            )
            measures.append([building, f"{i}.csv", "X", scale, 0, pgv])
    for name, rows in (
        ("runs.csv", runs),
        ("measures.csv", [measures[0], *reversed(measures[1:])]),
    ):
        with (tmp_path / name).open("w", newline="") as stream:
            csv.writer(stream).writerows(rows)
    return tmp_path


def test_best_measure_is_listed_first(tmp_path):
    best, other = compare_measures(folder_of(tmp_path), ["sa", "pgv"])
    assert (best.im, best.unit, best.runs, best.left_out) == ("pgv", "cm/s", 11, 1)
    assert (best.slope, best.beta) == pytest.approx((1.5, 0.0), abs=1e-9)
    assert other.beta > 0.1


def test_inconsistent_tables_are_refused(tmp_path):
    folder_of(tmp_path)
    lines = (tmp_path / "measures.csv").read_text().splitlines()
    (tmp_path / "measures.csv").write_text("\n".join(lines[:5]) + "\n")
    with pytest.raises(ModelError, match=r"row of the run a .* is missing"):
        compare_measures(tmp_path, ["sa", "pgv"])
    with pytest.raises(ModelError, match=r"column building .*, got "):
        compare_measures(folder_of(tmp_path, ("a", "b")), ["sa", "pgv"])
