"""Tests of fits to the runs of a study, which equal fits to numbers that are counted by hand in its
table."""

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from facts import each_states, states
from tdint.csv_table import read_table
from tdint.errors import AnalysisError, ModelError, UsageError
from tdint.studies.fragility.fit_table import (
    FragilityRequest,
    fit_states,
    fit_table,
    fragility,
)
from tdint.studies.fragility.fits import fit_cloud, fit_stripes
from tdint.studies.fragility.fragility_function import Fragility
from tdint.studies.fragility.fragility_tables import fragility_table
from tdint.studies.fragility.measures import SuiteRuns, line, motions_of

CLOUD = [(0.1, 0.0042), (0.2, 0.008), (0.3, 0.009), (0.4, 0.018), (0.5, 0.016), (0.8, 0.03)]
LEVELS = np.array([0.5, 1.0, 2.0, 4.0])
MOTIONS = 12
RANDOM = np.random.default_rng(7)
DRIFT = (
    0.004 * LEVELS[:, None] ** 0.9 * np.exp(0.5 * RANDOM.standard_normal((LEVELS.size, MOTIONS)))
)
STATUS = np.where(DRIFT > 0.02, "collapsed", "done")
OVER = 0.008


def table(folder: Path, im: np.ndarray, status: np.ndarray = STATUS) -> str:
    file = folder / "runs.csv"
    rows = [
        f"a,{end},{'' if end == 'diverged' else repr(float(drift))},{intensity!r},pga,m/s^2"
        for end, drift, intensity in zip(
            status.ravel(), DRIFT.ravel(), im.ravel().tolist(), strict=True
        )
    ]
    file.write_text("\n".join(["building,status,peak_drift_ratio,im,im_name,unit", *rows]) + "\n")
    return str(file)


def test_runs_at_common_levels_are_fitted_as_stripes(tmp_path: Path) -> None:
    """Failed runs are omitted. For the bounds they are counted once as exceeding and once as not
    exceeding."""
    im = np.repeat(LEVELS[:, None], MOTIONS, axis=1)
    over = (DRIFT > OVER) | (STATUS == "collapsed")
    (found,) = fit_table(table(tmp_path, im), FragilityRequest(thresholds=(OVER,))).functions
    same = fit_stripes(LEVELS, over.sum(axis=1), [MOTIONS] * LEVELS.size)
    assert (found.fit, found.failed, found.bounds) == ("stripes", 0, (None, None))
    assert (found.theta, found.beta, found.runs) == pytest.approx(
        (same.theta, same.beta, same.runs)
    )
    lost = STATUS.copy()
    lost[2, :2] = lost[1, 5] = "diverged"
    result = fit_table(table(tmp_path, im, lost), FragilityRequest(thresholds=(OVER,)))
    (warning,) = result.warnings
    assert states(warning, f"{tmp_path / 'runs.csv'}: 3 of 48 runs ... omitted")
    known = lost != "diverged"
    (found,) = result.functions
    for function, hits, total in (
        (found, over & known, known),
        (found.bounds[0], (over & known) | ~known, np.ones_like(known)),
        (found.bounds[1], over & known, np.ones_like(known)),
    ):
        same = fit_stripes(LEVELS, hits.sum(axis=1), total.sum(axis=1))
        assert (function.theta, function.beta) == pytest.approx((same.theta, same.beta))
    assert found.failed == 3


@pytest.mark.parametrize(
    ("collapses", "keeps"),
    [
        ((0, 1, 4), False),  # 5 of 60 collapse: less than a tenth
        ((0, 1, 5), True),  # 6 of 60, exactly a tenth
        ((1, 2, 5), True),  # 8 of 60; the interval is kept although the median is above all levels
        ((14, 18, 20), True),  # 52 of 60
        ((15, 19, 20), True),  # 54 of 60, exactly nine tenths
        ((16, 19, 20), False),  # 55 of 60
    ],
)
def test_interval_is_omitted_if_collapses_are_rare_or_frequent(
    tmp_path: Path, collapses: tuple[int, ...], keeps: bool
) -> None:
    file = tmp_path / "counts.csv"
    rows = [f"{im},{count},20" for im, count in zip((0.1, 0.2, 0.4), collapses, strict=True)]
    file.write_text("\n".join(["im,collapses,records", *rows]) + "\n")
    (found,) = fit_table(str(file), FragilityRequest()).functions
    same = fit_stripes(np.array([0.1, 0.2, 0.4]), np.array(collapses), [20] * 3)
    assert (found.theta, found.beta) == pytest.approx((same.theta, same.beta))
    assert not 0.1 <= found.theta <= 0.4
    assert bool(np.all(np.isfinite(found.covariance))) is keeps


@pytest.mark.parametrize(
    ("motions", "fit"), [((3, 3), "stripes"), ((4, 3), "stripes"), ((4, 4, 4, 4, 2), "cloud")]
)
def test_stripes_of_type_require_three_motions_per_level(
    motions: tuple[int, ...], fit: str
) -> None:
    """Each type has four buildings, and all runs under one ground motion count once."""
    states = {"light": 0.01}
    pairs = [(level, motion) for level, count in enumerate(motions) for motion in range(count)]
    level, motion = np.repeat(np.array(pairs), 4, axis=0).T
    demand = 0.005 * 1.3**level * np.exp(0.3 * RANDOM.standard_normal(level.size))
    runs = SuiteRuns(1.0 + level, demand, motion, np.ones(level.size), ("pga", "m/s^2"))
    (found,) = fit_states(runs, states, FragilityRequest(), 0.4)
    assert isinstance(found, Fragility) and found.fit == fit
    (at_one,) = fit_states(replace(runs, im=np.ones(level.size)), states, FragilityRequest(), 0.4)
    assert "light: all records are at the intensity level 1" in str(at_one)
    # The levels of a campaign are never fitted as a cloud, unless it is requested.
    levels = replace(runs, has_levels=True)
    for data, request in ((runs, FragilityRequest(fit="stripes")), (levels, FragilityRequest())):
        if fit == "cloud":
            with pytest.raises(UsageError, match="no common intensity levels"):
                fit_states(data, states, request)
    (cloud,) = fit_states(levels, states, FragilityRequest(fit="cloud"))
    assert (isinstance(cloud, Fragility) and cloud.fit == "cloud") is (fit == "cloud")


def test_runs_at_individual_levels_are_fitted_as_cloud(tmp_path: Path) -> None:
    im = LEVELS[:, None] * np.exp(0.2 * RANDOM.standard_normal((LEVELS.size, MOTIONS)))
    (found,) = fit_table(table(tmp_path, im), FragilityRequest(thresholds=(OVER,))).functions
    fell = STATUS == "collapsed"
    (same,) = fit_cloud(im.ravel(), DRIFT.ravel(), (OVER,), collapsed=fell.ravel())
    assert (found.fit, found.theta, found.beta) == (
        "cloud",
        pytest.approx(same.theta),
        pytest.approx(same.beta),
    )
    with pytest.raises(UsageError, match=r"intensity levels; .*--fit cloud"):
        fit_table(table(tmp_path, im), FragilityRequest("stripes", (OVER,)))
    # Three runs are sufficient for a level, two are not.
    levels = np.repeat(LEVELS[:, None], MOTIONS, axis=1)
    for apart, fits in ((3, ["stripes"]), (2, [])):
        levels[0, :apart] = 0.4
        result = fit_table(table(tmp_path, levels), FragilityRequest(thresholds=(OVER,)))
        assert [found.fit for found in result.functions] == fits
        # All collapses are at the highest level: no cloud with collapses can be fitted.
        assert all("use --fit stripes" in str(error) for error in result.failures)
        levels[0] = LEVELS[0]


def test_drift_of_collapsed_runs_is_ignored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fits and counts do not depend on the drift at which a collapsed run stopped, even if it is a
    thousand times larger or below the threshold. The counts equal a count by hand in each sixth of
    the runs."""
    im = LEVELS[:, None] * np.exp(0.2 * RANDOM.standard_normal((LEVELS.size, MOTIONS)))
    (first,) = fit_table(table(tmp_path, im), FragilityRequest(thresholds=(OVER,))).functions
    for factor in (1e3, 1e-3):
        monkeypatch.setattr(
            sys.modules[__name__], "DRIFT", np.where(STATUS == "collapsed", factor * DRIFT, DRIFT)
        )
        (found,) = fit_table(table(tmp_path, im), FragilityRequest(thresholds=(OVER,))).functions
        assert (found.theta, found.beta) == (first.theta, first.beta)
        assert found.counted is not None and first.counted is not None
        assert np.array_equal(found.counted.fraction, first.counted.fraction)
    order = np.argsort(im.ravel())
    for number, sixth in enumerate(np.split(order, 6)):
        over = (DRIFT.ravel()[sixth] > OVER) | (STATUS.ravel()[sixth] == "collapsed")
        assert first.counted.fraction[number] == pytest.approx(np.mean(over), abs=1e-12)
        assert first.counted.runs[number] == 8
        assert first.counted.im[number] == pytest.approx(
            math.exp(np.mean(np.log(im.ravel()[sixth])))
        )


def test_function_that_contradicts_runs_causes_warning(tmp_path: Path) -> None:
    """A warning is printed if demands jump from far below to far above the threshold at a single
    intensity, because a regression line does not represent them. No warning is printed for a line
    with normal scatter."""
    x = np.geomspace(0.2, 20.0, 200)
    noise = RANDOM.standard_normal(x.size)
    jumping = np.where(x < 2.0, 0.002 * x**0.3, 0.02 * x**0.3) * np.exp(0.05 * noise)
    straight = 0.01 * x**0.8 * np.exp(0.4 * noise)
    for demand, count in ((jumping, 1), (straight, 0)):
        file = tmp_path / "cloud.csv"
        lines = (f"{im!r},{edp!r}" for im, edp in zip(x.tolist(), demand.tolist(), strict=True))
        file.write_text("\n".join(["im,edp", *lines]))
        result = fit_table(str(file), FragilityRequest(thresholds=(0.016,)))
        assert len(result.disagreements) == count, result.disagreements


def test_threshold_outside_demands_causes_warning(tmp_path: Path) -> None:
    """The threshold 2 (instead of 2 %) is far above all runs; the regression line is extrapolated,
    and a warning states this."""
    file = tmp_path / "cloud.csv"
    file.write_text("im,edp\n0.1,0.01\n0.2,0.02\n0.3,0.029\n")
    result = fit_table(str(file), FragilityRequest(thresholds=(0.001, 0.025, 0.03, 2.0)))
    assert each_states(
        result.disagreements,
        [
            "no run exceeds threshold 0.03, threshold 2: ... extrapolated",
            "every run exceeds threshold 0.001: ... extrapolated",
        ],
    )


def scattered(folder: Path, event: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the motion numbers, intensities and demands of two written tables of runs: 14 ground
    motions with two components at four levels each and correlated errors."""
    random = np.random.default_rng(11)
    motion = np.repeat(np.arange(14), 8)
    im = np.tile(np.repeat(LEVELS, 2), 14) * np.exp(0.2 * random.standard_normal(motion.size))
    edp = (
        0.004
        * im**0.9
        * np.exp(
            0.4 * random.standard_normal(14)[motion] + 0.2 * random.standard_normal(motion.size)
        )
    )
    for name, head in (("runs.csv", "im,peak_drift_ratio"), ("cloud.csv", "im,edp")):
        lines = [f"building,status,im_name,unit,record,component,{head}{',event' * event}"]
        for number, (k, x, d) in enumerate(
            zip(motion.tolist(), im.tolist(), edp.tolist(), strict=True)
        ):
            # With events, records have different names, and correlated errors are identified by the
            # event.
            record = f"r{number}" if event else f"r{k}.mseed"
            lines.append(
                f"a,done,pga,m/s^2,{record},{'HNE' if number % 2 else 'HNN'},{x!r},{d!r}{f',M{k}' * event}"  # noqa: E501
            )
        (folder / name).write_text("\n".join(lines) + "\n")
    return motion, im, edp


@pytest.mark.parametrize("event", [False, True])
def test_standard_errors_are_jackknife_estimates(tmp_path: Path, event: bool) -> None:
    """Standard errors of clouds of runs, of user-defined tables, and of the slopes in the
    comparison of measures equal jackknife estimates by hand. The information matrix assumes
    independent runs and gives half of these values."""
    motion, im, edp = scattered(tmp_path, event)
    request = FragilityRequest("cloud", (OVER,), pair_demand="separate")
    functions = [fit_table(str(tmp_path / name), request).functions[0]
                 for name in ("runs.csv", "cloud.csv")]  # fmt: skip
    (alone,) = fit_cloud(im, edp, (OVER,))
    jackknife_fits = [fit_cloud(im[motion != k], edp[motion != k], (OVER,))[0] for k in range(14)]
    for name, values in (
        ("theta_error", [math.log(fit.theta) for fit in jackknife_fits]),
        ("beta_error", [fit.beta for fit in jackknife_fits]),
    ):
        error = math.sqrt(13.0 * float(np.var(values)))
        assert [getattr(fit, name) for fit in functions] == pytest.approx([error, error], rel=1e-6)
    assert functions[0].theta_error > 1.5 * alone.theta_error
    slopes = [
        np.polyfit(np.log(im[motion != k]), np.log(edp[motion != k]), 1)[0] for k in range(14)
    ]
    found = line(np.log(im), np.log(edp), "pgv", motion)
    assert found.slope_error == pytest.approx(math.sqrt(13.0 * float(np.var(slopes))), rel=1e-9)


def test_capacities_of_one_record_count_as_one_motion(tmp_path: Path) -> None:
    """Two capacities of the same record count as one ground motion, so that the standard error
    equals the error with one capacity per record. The standard error of different motions is
    unchanged."""
    capacity = np.exp(0.4 * np.random.default_rng(12).standard_normal(9))
    rows = [f"{value!r},r{number}" for number, value in enumerate(capacity.tolist())]
    errors = {}
    for name, capacities in (("single", rows), ("twins", rows + rows)):
        (tmp_path / f"{name}.csv").write_text("\n".join(["capacity,record", *capacities]))
        errors[name] = (
            fit_table(str(tmp_path / f"{name}.csv"), FragilityRequest()).functions[0].theta_error
        )
    assert errors["single"] == pytest.approx(np.std(np.log(capacity), ddof=1) / 3.0)
    assert errors["twins"] == pytest.approx(errors["single"])


def test_few_exceedances_give_no_confidence_interval(tmp_path: Path) -> None:
    """The function has no confidence interval if three of 112 runs exceed 5 %, or if the median is
    above all intensities and an eighth of the runs exceed the threshold."""
    _, im, edp = scattered(tmp_path, False)
    high, middle = np.sort(edp)[-4], float(np.quantile(edp, 0.5))
    result = fit_table(
        str(tmp_path / "runs.csv"),
        FragilityRequest("cloud", (high, middle), pair_demand="separate"),
    )
    rare, usual = result.functions
    assert math.isnan(rare.theta_error) and math.isnan(rare.beta_error) and usual.theta_error > 0.0
    assert result.disagreements == [
        f"less than 10 % of the runs exceed threshold {high:g}: the median is extrapolated"
    ]
    low = im < float(np.quantile(im, 0.2))
    cells = "\n".join(
        f"{x!r},{d!r}" for x, d in zip(im[low].tolist(), edp[low].tolist(), strict=True)
    )
    (tmp_path / "low.csv").write_text(f"im,edp\n{cells}\n")
    eighth = float(np.quantile(edp[low], 0.88))
    result = fit_table(str(tmp_path / "low.csv"), FragilityRequest("cloud", (eighth,)))
    assert result.functions[0].theta > np.max(im[low]) and math.isnan(
        result.functions[0].theta_error
    )
    assert each_states(
        result.disagreements, [f"every intensity ... threshold {eighth:g}: ... extrapolated"]
    )


def test_failed_fits_are_reported_next_to_successful_fits(tmp_path: Path) -> None:
    file = table(
        tmp_path, np.repeat(LEVELS[:, None], MOTIONS, axis=1), np.full_like(STATUS, "done")
    )
    with pytest.raises(AnalysisError, match="threshold 10: "):
        fragility(file, 10.0)
    both = fragility(file, (OVER, 10.0))
    assert [fit.threshold for fit in both.functions] == [OVER]
    assert [str(fit)[:13] for fit in both.failures] == ["threshold 10:"]


@pytest.mark.parametrize(
    ("columns", "motions"),
    [
        (("record", "component", "motion"), [0, 0, 1, 0]),  # the table of a campaign
        (("record", "component"), [0, 1, 2, 0]),
        (("record",), [0, 1, 2, 0]),
    ],
)
def test_rows_are_assigned_to_motions(tmp_path, columns, motions):
    rows = [("a.txt", "HN1", "1"), ("b.txt", "HN2", "1"), ("c.txt", "HN1", "3"),
            ("a.txt", "HN1", "1-2")]  # fmt: skip
    lines = [",".join(columns), *(",".join(row[: len(columns)]) for row in rows)]
    file = tmp_path / "runs.csv"
    file.write_text("\n".join(lines) + "\n")
    assert motions_of(read_table(str(file), "a table of runs")).tolist() == motions


@pytest.mark.parametrize("by_type", [False, True])
def test_collapses_are_kept_if_all_thresholds_are_below_the_range(by_type: bool, tmp_path: Path):
    """A collapse exceeds the lower limit of the range of demands, even if this limit is above all
    thresholds."""
    im = LEVELS[:, None] * np.exp(0.2 * RANDOM.standard_normal((LEVELS.size, MOTIONS)))
    fell = STATUS == "collapsed"
    low = 0.006
    is_kept = fell | (low <= DRIFT)
    request = FragilityRequest("cloud", (0.5 * low,), (low, math.inf))
    found = fit_table(table(tmp_path, im), request).functions[0]
    if by_type:
        states = dict.fromkeys(["light"], 0.5 * low)
        demand = np.where(fell, math.inf, DRIFT).ravel()
        motion = np.arange(DRIFT.size)
        runs = SuiteRuns(im.ravel(), demand, motion, np.ones(im.size), ("pga", "m/s^2"))
        found = fit_states(runs, states, request)[0]
    (expected,) = fit_cloud(
        im[is_kept], DRIFT[is_kept], request.thresholds, collapsed=fell[is_kept]
    )
    assert (found.runs, found.censored) == (int(is_kept.sum()), int(fell.sum()))
    assert (found.theta, found.beta) == pytest.approx((expected.theta, expected.beta))


def test_a_rule_for_pairs_without_effect_is_reported(tmp_path: Path) -> None:
    """Capacities without the column pair_demand cannot be combined by another rule."""
    file = tmp_path / "capacities.csv"
    file.write_text("capacity,im_name,unit\n1.0,pga,g\n1.4,pga,g\n2.1,pga,g\n")
    assert not fit_table(str(file), FragilityRequest()).warnings
    (warning,) = fit_table(str(file), FragilityRequest(pair_demand="mean")).warnings
    assert "pair_demand" in warning and "mean" in warning
    rows = [f"{value},pga,g,larger" for value in (1.0, 1.4, 2.1)]
    file.write_text("\n".join(["capacity,im_name,unit,pair_demand", *rows]) + "\n")
    assert not fit_table(str(file), FragilityRequest(pair_demand="larger")).warnings
    with pytest.raises(UsageError, match="pair_demand larger"):
        fit_table(str(file), FragilityRequest(pair_demand="mean"))


@pytest.mark.parametrize(
    ("column", "cells"),
    [
        ("collapsed", ["no", "0", "false", "", "True", "yes"]),
        ("status", ["done", "done", "DONE", "done", "collapsed", "failed-story"]),
    ],
)
def test_collapses_of_a_table_of_others(tmp_path: Path, column: str, cells: list[str]) -> None:
    """`collapsed` and `status` count as in tables of tdint; the demands of collapses are not used,
    and may be empty."""
    im, edp = np.array(CLOUD).T
    edp[3] = 0.5  # the survivor with the largest demand: the collapse probability has a maximum
    order = [0, 1, 2, 4, 3, 5]
    im, edp = im[order], edp[order]
    fell = np.array([0, 0, 0, 0, 1, 1], bool)
    (right,) = fit_cloud(im, edp, [0.02], collapsed=fell)
    texts = [repr(float(value)) for value in edp]
    texts[5] = ""
    lines = [
        f"{level!r},{text},{cell}"
        for level, text, cell in zip(im.tolist(), texts, cells, strict=True)
    ]
    file = tmp_path / "cloud.csv"
    file.write_text("\n".join([f"im,edp,{column}", *lines]) + "\n")
    (found,) = fit_table(str(file), FragilityRequest(thresholds=(0.02,))).functions
    assert (found.theta, found.beta) == pytest.approx((right.theta, right.beta), rel=1e-12)
    # In tables, numbers of clouds are decimals, which a function without a cloud does not have.
    table = fragility_table([found, replace(found, cloud=None)])
    at = table.columns.index("collapsed")
    assert [row[at] for row in table.rows] == [2.0, None]
    assert type(table.rows[0][at]) is float
    file.write_text(f"im,edp,{column}\n0.1,0.01,perhaps\n")
    with pytest.raises(ModelError, match=f":2: {column} must be"):
        fit_table(str(file), FragilityRequest(thresholds=(0.02,)))
    file.write_text(f"im,edp,{column}\n0.1,,{cells[0]}\n")
    with pytest.raises(ModelError, match=":2: edp must be a positive number"):
        fit_table(str(file), FragilityRequest(thresholds=(0.02,)))


def test_failed_rows_of_a_table_of_others_are_omitted(tmp_path: Path) -> None:
    file = tmp_path / "cloud.csv"
    rows = [f"{im!r},{edp!r},done" for im, edp in CLOUD]
    file.write_text("\n".join(["im,edp,status", *rows, "0.9,,diverged"]) + "\n")
    (found,) = fit_table(str(file), FragilityRequest(thresholds=(0.02,))).functions
    (right,) = fit_cloud(*np.array(CLOUD).T, [0.02])
    assert (found.theta, found.beta, found.failed) == pytest.approx((right.theta, right.beta, 1))


def test_method_of_errors_is_named_where_errors_are(tmp_path: Path) -> None:
    """Stripes whose median is above all levels keep their errors, and the name of the method."""
    file = tmp_path / "stripes.csv"
    file.write_text("im,collapses,records\n0.3,0,40\n0.4,2,40\n0.5,5,40\n0.6,9,40\n0.7,13,40\n")
    (found,) = fit_table(str(file), FragilityRequest()).functions
    assert found.extrapolated and np.isfinite(found.covariance).all()
    assert found.error_method == "information"
