"""One suite with a collapse, a failed run, a pair, a single component and a record listed twice has
the same counts, medians and fractiles in every study."""

import math

import numpy as np
import pytest

from csv_rows import rows
from peer_files import write_at2
from tdint.fractiles import fractiles
from tdint.model.status import FALLEN
from tdint.studies.campaign import chunks
from tdint.studies.ida.ida_curve import IdaCurve, IdaRun, PairCurve, capacity_fractiles
from tdint.studies.sensitivity.sensitivity import PEAKS, _medians
from tdint.studies.store.opening import open_existing

MODEL = """name: {name}
units: {{length: m, force: kN, mass: t}}
stories: [{{mass: 100, height: 3, stiffness: {stiffness}}}]
damping: 5%
"""
STUDY = """name: one suite
buildings: {models: [weak.yaml, strong.yaml]}
records: {files: [set/]}
intensity: {factors: factors.csv}
analysis: {method: exact}
"""
# Recording, component, amplitude in g, factor
SUITE = [
    ("RSN1_A", "000", 0.10, 1.0),
    ("RSN1_A", "090", 0.16, 1.0),
    ("RSN2_B", "000", 0.20, 1.0),
    ("RSN3_C", "000", 0.30, 1.0),
    ("RSN3_C", "000", 0.30, 1.5),
    ("RSN4_D", "000", 0.12, 1.0),
    ("RSN4_D", "090", 0.50, 1.0),
    ("RSN5_E", "000", 0.40, 1.0),
]


@pytest.fixture
def suite(folder, tdint, monkeypatch):
    """Run the suite; the second component of D collapses, and E has no result."""
    (folder / "set").mkdir()
    lines = ["record,component,factor"]
    time = np.arange(400) * 0.01
    for name, component, amplitude, factor in SUITE:
        values = amplitude * np.sin(9.0 * time) * np.exp(-((time - 2.0) ** 2))
        file = f"{name}{component}.AT2"
        write_at2(folder / "set" / file, f"{name}, {component}", values)
        lines.append(f"set/{file},,{factor}")
    (folder / "factors.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    for name, stiffness in (("weak", 9e3), ("strong", 2e4)):
        (folder / f"{name}.yaml").write_text(MODEL.format(name=name, stiffness=stiffness))
    (folder / "study.yaml").write_text(STUDY, encoding="utf-8")
    row = chunks.Batch._row

    def changed(self, job, status, *collapse, **values):
        if abs(self.motions[job.run.motion].pga - 0.5 * 9.80665) < 0.4:
            status = FALLEN[0]
        elif abs(self.motions[job.run.motion].pga - 0.4 * 9.80665) < 0.3:
            return row(self, job, "diverged")
        return row(self, job, status, *collapse, **values)

    monkeypatch.setattr(chunks.Batch, "_row", changed)
    arguments = ("--baseline", "weak", "--report", "report.html")
    return tdint("campaign", "study.yaml", "-o", "out", *arguments, code=0)


def test_one_suite_has_one_set_of_counts_and_fractiles(folder, tdint, suite):
    runs = [row for row in rows((folder / "out/runs.csv").read_text()) if row["building"] == "weak"]
    assert [row["motion"] for row in runs] == ["1", "1", "3", "4-1", "4-2", "5", "5", "7"]
    drift = [float(row["peak_drift_ratio"] or "nan") for row in runs]
    # A pair has the larger demand; D is a collapse and E has no result.
    demands = np.array([max(drift[:2]), *drift[2:5], math.inf])
    low, median, high = fractiles(demands)
    assert median == np.sort(demands)[2] and high == math.inf

    profile = next(
        row
        for row in rows((folder / "out/profiles.csv").read_text())
        if (row["building"], row["quantity"]) == ("weak", "peak_drift_ratio")
    )
    assert [profile[name] for name in ("runs", "collapsed", "failed")] == ["6", "1", "1"]
    found = [float(profile[name]) for name in ("p16", "median", "p84")]
    assert found == pytest.approx([low, median, high])
    ratio = rows((folder / "out/ratios.csv").read_text())[0]
    counts = ("motions", "collapsed", "failed", "baseline_collapsed", "baseline_failed")
    assert [ratio[name] for name in counts] == ["4", "1", "1", "1", "1"]
    assert "of 6 ground motions, 1 collapsed and 1 failed" in suite.stderr
    assert "1 of 6, 1 failed" in (folder / "report.html").read_text()

    with open_existing(folder / "out") as store:
        level, peaks = _medians(store)[0, 0]
    drift_index = [peak.name for peak in PEAKS].index("peak_drift_ratio")
    assert peaks[drift_index] == pytest.approx(median) and level.counts == (4, 1, 1)

    cloud = ("fragility", "out", "--by", "building", "--fit", "cloud", "--im", "pga")
    functions = rows(tdint(*cloud, "--threshold", "1%", code=0).stdout)
    weak = next(row for row in functions if row["building"] == "weak")
    # Five motions have a result, of which one is a collapse; they belong to four recordings.
    assert [weak[name] for name in ("runs", "censored", "motions")] == ["5", "1", "4"]


def test_ida_has_the_same_counts_and_fractiles():
    """Capacities of linear curves are proportional to the inverse of the demands at one level; a
    motion without collapse below the largest level is above every capacity."""
    demands = {"a1": 0.010, "a2": 0.016, "b": 0.020, "c": 0.030, "d1": 0.006}

    def curve(*runs):
        found = [IdaRun(im, im, "collapsed" if d > 1 else "done", min(d, 0.11)) for im, d in runs]
        return IdaCurve(None, tuple(found), 0.1)

    curves = {name: curve((0.5, 0.5 * d), (1.0, d)) for name, d in demands.items()}
    pair = PairCurve.combine_components(curves["a1"], curves["a2"], "larger")
    other = PairCurve.combine_components(
        curves["d1"], curve((0.5, 0.004), (0.6, math.inf)), "larger"
    )
    motions = [pair, curves["b"], curves["c"], other]
    capacities = [item.capacity(0.005).intensity for item in motions]
    assert capacities[:3] == pytest.approx([0.005 / 0.016, 0.25, 0.005 / 0.030])
    assert 0.5 < capacities[3] < 0.6  # the collapse of a component, before the drift of the other
    found = capacity_fractiles(motions, np.array([0.005]))[:, 0]
    assert found == pytest.approx(fractiles(np.array(capacities)))
    # A capacity above the largest level is above every value.
    found = capacity_fractiles([*motions, curve((0.5, 1e-3), (1.0, 2e-3))], np.array([0.005]))
    assert found[2, 0] == math.inf and found[1, 0] == pytest.approx(0.005 / 0.016)


def test_ida_refuses_a_record_listed_twice(folder, tdint, suite):
    file = "set/RSN2_B000.AT2"
    tdint.refused("specified twice", "ida", "weak.yaml", file, file, "-o", "i", code=2)
