"""Fits of the table of a study's runs: those of the numbers in it, counted by hand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tdint.campaign.fragility.fit_table import FragilityRequest, fit_table, fragility
from tdint.campaign.fragility.fits import fit_cloud, fit_stripes
from tdint.errors import AnalysisError, UsageError

LEVELS = np.array([0.5, 1.0, 2.0, 4.0])
MOTIONS = 12
RANDOM = np.random.default_rng(7)
DRIFT = 0.004 * LEVELS[:, None] ** 0.9 * np.exp(0.5 * RANDOM.standard_normal((LEVELS.size, MOTIONS)))
STATUS = np.where(DRIFT > 0.02, "collapsed", "done")
OVER = 0.008


def table(folder: Path, im: np.ndarray, status: np.ndarray = STATUS) -> str:
    file = folder / "runs.csv"
    rows = [
        f"a,{end},{'' if end == 'diverged' else repr(float(drift))},{intensity!r},pga,m/s^2"
        for end, drift, intensity in zip(status.ravel(), DRIFT.ravel(), im.ravel().tolist(), strict=True)
    ]
    file.write_text("\n".join(["building,status,peak_drift_ratio,im,im_name,unit", *rows]) + "\n")
    return str(file)


def test_runs_at_common_levels_are_stripes(tmp_path: Path) -> None:
    """And what fails is left out, and counted either way for the bounds."""
    im = np.repeat(LEVELS[:, None], MOTIONS, axis=1)
    over = (DRIFT > OVER) | (STATUS == "collapsed")
    (found,) = fit_table(table(tmp_path, im), FragilityRequest(thresholds=(OVER,))).functions
    same = fit_stripes(LEVELS, over.sum(axis=1), [MOTIONS] * LEVELS.size)
    assert (found.fit, found.failed, found.bounds) == ("stripes", 0, (None, None))
    assert (found.theta, found.beta, found.records) == pytest.approx((same.theta, same.beta, same.records))
    lost = STATUS.copy()
    lost[2, :2] = lost[1, 5] = "diverged"
    result = fit_table(table(tmp_path, im, lost), FragilityRequest(thresholds=(OVER,)))
    (warning,) = result.warnings
    assert warning.startswith(f"{tmp_path / 'runs.csv'}: 3 of 48 runs have no result and are left out, which leans")
    known = lost != "diverged"
    (found,) = result.functions
    for one, hits, total in (
        (found, over & known, known),
        (found.bounds[0], (over & known) | ~known, np.ones_like(known)),
        (found.bounds[1], over & known, np.ones_like(known)),
    ):
        same = fit_stripes(LEVELS, hits.sum(axis=1), total.sum(axis=1))
        assert (one.theta, one.beta) == pytest.approx((same.theta, same.beta))
    assert found.failed == 3


def test_runs_at_levels_of_their_own_are_a_cloud(tmp_path: Path) -> None:
    im = LEVELS[:, None] * np.exp(0.2 * RANDOM.standard_normal((LEVELS.size, MOTIONS)))
    (found,) = fit_table(table(tmp_path, im), FragilityRequest(thresholds=(OVER,))).functions
    (same,) = fit_cloud(im.ravel(), DRIFT.ravel(), (OVER,), (STATUS == "collapsed").ravel())
    assert (found.fit, found.theta, found.beta) == ("cloud", pytest.approx(same.theta), pytest.approx(same.beta))
    with pytest.raises(UsageError, match="the runs do not stand at common levels of intensity; use --fit cloud"):
        fit_table(table(tmp_path, im), FragilityRequest("stripes", (OVER,)))
    # Three runs make a level, two do not.
    whole = np.repeat(LEVELS[:, None], MOTIONS, axis=1)
    for apart, fit in ((3, "stripes"), (2, "cloud")):
        whole[0, :apart] = 0.4
        (found,) = fit_table(table(tmp_path, whole), FragilityRequest(thresholds=(OVER,))).functions
        assert found.fit == fit
        whole[0] = LEVELS[0]


def test_one_run_without_a_result_is_told(tmp_path: Path) -> None:
    lost = STATUS.copy()
    lost[0, 0] = "diverged"
    im = LEVELS[:, None] * np.exp(0.2 * RANDOM.standard_normal((LEVELS.size, MOTIONS)))
    result = fit_table(table(tmp_path, im, lost), FragilityRequest(thresholds=(OVER,)))
    assert result.warnings == (f"{tmp_path / 'runs.csv'}: 1 of 48 runs have no result and are left out",)
    assert [one.failed for one in result.functions] == [1]
    assert math.isfinite(result.functions[0].theta)


def test_what_cannot_be_fitted_is_told_where_nothing_can(tmp_path: Path) -> None:
    file = table(tmp_path, np.repeat(LEVELS[:, None], MOTIONS, axis=1), np.full_like(STATUS, "done"))
    with pytest.raises(AnalysisError, match="threshold 10: "):
        fragility(file, 10.0)
    both = fragility(file, (OVER, 10.0))
    assert [one.threshold for one in both.functions] == [OVER]
    assert [str(one)[:13] for one in both.failures] == ["threshold 10:"]
