"""Incremental dynamic analysis: closed forms, brackets, censoring, failed runs and stored runs."""

import io
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import tdint
from building_cases import model, story
from tdint import load_model, spectrum
from tdint.errors import ModelError, UsageError
from tdint.ground_motion.horizontals import Horizontals
from tdint.ground_motion.record import Record
from tdint.model.building import assemble
from tdint.response.pairs import Place
from tdint.response.runs.batch import Subject
from tdint.response.runs.run_values import RUN
from tdint.studies.campaign.chunks import Batch, RunRow
from tdint.studies.ida import ida_report
from tdint.studies.ida.ida import IdaSettings, _elastic_scale, ida
from tdint.studies.ida.ida_curve import (
    IdaCurve,
    IdaRun,
    LevelSearch,
    Mainshock,
    PairCurve,
    below_collapse,
    capacity_fractiles,
    damaged,
)
from tdint.studies.ida.ida_tables import capacity_table, limit_capacities
from tdint.studies.motions.intensity import pga

FRAME = Path(__file__).parents[3] / "configs" / "collapse-prone-frame.yaml"


def motion(seed=0, size=600, dt=0.02):
    """Return a pulse in noise, which is strong enough for any building once it is scaled."""
    random = np.random.default_rng(seed)
    t = np.arange(size) * dt
    noise = np.convolve(random.standard_normal(size), np.hanning(9), mode="same")
    return Record(
        np.exp(-((t - 5.0) ** 2)) * np.sin(5.0 * t + seed) + 0.2 * noise * np.hanning(size),
        dt,
        "",
        "",
        "HN1",
        f"{seed}.m",
    )


@pytest.fixture(scope="module")
def frame():
    return load_model(FRAME)


@pytest.fixture(scope="module")
def study(frame):
    return ida(frame, [motion(seed) for seed in range(4)], jobs=2)


def curve(*runs, collapse_drift=0.1):
    """Return a curve of runs given as (im, drift ratio), with inf for collapse and nan for a failed
    run."""
    runs_of_curve = [
        IdaRun(
            im,
            im,
            "collapsed" if math.isinf(d) else "not-converged" if math.isnan(d) else "done",
            min(d, 0.11),
        )
        for im, d in runs
    ]
    return IdaCurve(motion(), tuple(runs_of_curve), collapse_drift)


def test_ida_curve_of_linear_building_is_straight():
    """The drift ratio of one story is Sa / (omega^2 h) at every level, with the exact Sa of the
    spectrum."""
    omega, height = 2.0 * math.pi / 0.8, 3.0
    building = model(
        [story(1.0, omega**2, dashpot=2.0 * 0.05 * omega, height=height)], method="exact"
    )
    found = ida(building, [motion(1)])
    (ida_curve,) = found.curves
    assert found.measure.name == "sa(0.8)"
    assert len(ida_curve.stable) > 15
    for run in ida_curve.stable:
        # The run determines its peaks on a cubic between steps of T/40, and the spectrum at the
        # exact times of the maxima.
        assert run.drift_ratio == pytest.approx(run.im / (omega**2 * height), rel=1e-5)
        assert run.scale * spectrum(ida_curve.record, np.array([0.8]), 0.05).psa[
            0
        ] == pytest.approx(run.im, rel=1e-12)
    capacity = 0.1 * omega**2 * height
    assert ida_curve.collapse.lower <= capacity * (1 + 1e-5)
    assert ida_curve.collapse.upper >= capacity * (1 - 1e-5)
    assert ida_curve.capacity(0.02).capacity == pytest.approx(0.02 * omega**2 * height, rel=1e-5)
    assert not ida_curve.resurrection


def test_collapse_brackets_have_requested_precision(study):
    for ida_curve in study.curves:
        assert 1.0 < ida_curve.collapse.upper / ida_curve.collapse.lower <= 1.05
        assert ida_curve.collapse.lower == ida_curve.stable[-1].im
        assert ida_curve.collapse.upper == min(run.im for run in ida_curve.runs if run.collapsed)
        assert sum(run.im > ida_curve.collapse.upper for run in ida_curve.runs) >= 2


def test_levels_fill_curves(study):
    """Neighboring drifts differ by less than 20 %, unless the levels are closer than the
    bracket."""
    for ida_curve in study.curves:
        for low, high in pairwise(ida_curve.stable):
            ratio = max(low.drift_ratio, high.drift_ratio) / min(low.drift_ratio, high.drift_ratio)
            assert ratio <= 1.2 or high.im <= 1.05 * low.im
        assert ida_curve.stable[0].drift_ratio < 0.01


def test_maximum_intensity_censors_capacities(frame):
    found = ida(frame, [motion(0)], pga(), IdaSettings(max_im=0.8, thresholds=(0.001, 0.05)))
    (ida_curve,) = found.curves
    assert ida_curve.collapse.censored
    assert max(run.im for run in ida_curve.runs) == ida_curve.collapse.capacity == 0.8
    assert math.isnan(ida_curve.collapse.upper)
    assert [ida_curve.capacity(t).censored for t in found.thresholds] == [False, True, True]
    assert np.isinf(capacity_fractiles(found.curves, np.array([0.09]))).all()


@pytest.mark.parametrize(
    ("runs", "threshold", "found"),
    [
        ([(1.0, 0.01), (2.0, 0.04), (3.0, math.inf)], 0.02, (math.sqrt(2.0), 1.0, 2.0)),
        ([(1.0, 0.01), (2.0, 0.04), (3.0, math.inf)], 0.005, (0.5, 0.0, 1.0)),
        ([(1.0, 0.01), (2.0, 0.04), (2.2, math.inf)], 0.08, (math.sqrt(4.4), 2.0, 2.2)),
        (
            [(1.0, 0.01), (2.0, 0.03), (3.0, 0.015), (4.0, 0.04), (5.0, math.inf)],
            0.02,
            (2.0 ** (math.log(2.0) / math.log(3.0)), 1.0, 2.0),
        ),
    ],
    ids=[
        "straight on logarithmic axes",
        "below the first run",
        "not to diverged run",
        "the first counts",
    ],
)
def test_capacity_at_threshold(runs, threshold, found):
    crossing = curve(*runs).capacity(threshold)
    assert (crossing.capacity, crossing.lower, crossing.upper) == pytest.approx(found)


def test_a_capacity_is_interpolated_linearly_from_a_level_without_demand():
    """A link with slack has no force in weak motions, and zero has no logarithm."""
    curves = [
        replace(
            curve(),
            runs=tuple(
                IdaRun(im, im, "done", 0.01 * im, limit_ratios=(ratio,))
                for im, ratio in ((1.0, 0.0), (2.0, ratio), (4.0, 4.0 * ratio))
            ),
        )
        for ratio in (2.0, 4.0)
    ]
    found = [item.limit_capacity(0, "link_force") for item in curves]
    assert [item.capacity for item in found] == [1.5, 1.25]
    assert [(item.lower, item.upper) for item in found] == [(1.0, 2.0)] * 2
    pairs = [PairCurve.combine_components(*curves, demand) for demand in ("larger", "mean")]
    assert [pair.limit_capacity(0, "link_force").capacity for pair in pairs] == [1.25, 4.0 / 3.0]


def test_the_capacity_of_a_pair_is_unknown_if_that_of_a_component_is():
    known, unknown = curve((1.0, 0.01), (2.0, math.inf)), curve((2.0, math.inf))
    for parts in ((known, unknown), (unknown, known)):
        pair = PairCurve.combine_components(*parts, "larger")
        assert math.isnan(pair.collapse.capacity)


def test_resurrection_is_detected():
    assert not curve((1.0, 0.01), (2.0, math.inf), (3.0, math.inf)).resurrection
    again = curve((1.0, 0.01), (2.0, math.inf), (3.0, 0.05))
    assert again.resurrection
    assert (again.collapse.lower, again.collapse.upper) == (1.0, 2.0)


def test_failed_run_does_not_count_as_collapse():
    ida_curve = curve((1.0, 0.01), (2.0, math.nan), (3.0, 0.02), (4.0, math.nan))
    assert ida_curve.collapse.censored
    assert (ida_curve.collapse.capacity, ida_curve.capacity(0.015).upper) == (3.0, 3.0)


def drive(levels, building, most=200):
    """Perform the runs of a building that is given as a function from the level to status and
    drift."""
    runs = []
    while (level := levels.next(runs)) is not None:
        runs.append(IdaRun(level, level, *building(level)))
        assert len(runs) < most
    return runs


def test_search_finds_collapse_below_first_collapse():
    """The building also collapses in a narrow range below levels without a collapse, and levels
    that fill the curve detect this range."""

    def building(im):
        if im > 6.0 or 1.45 < im < 1.9:
            return "collapsed", 0.1
        return "done", 0.002 * im ** (3.0 if im > 1.2 else 1.0)

    found = IdaCurve(motion(), tuple(drive(LevelSearch(0.3), building)), 0.1)
    assert found.resurrection
    assert 1.4 < found.collapse.lower <= 1.45 <= found.collapse.upper <= 1.5


def test_search_avoids_levels_of_failed_runs():
    lost = []

    def building(im):
        if 2.0 < im < 2.08:
            lost.append(im)
            return "not-converged", math.nan
        return ("collapsed", 0.1) if im >= 2.08 else ("done", 0.01 * im)

    runs = drive(LevelSearch(0.3), building)
    assert lost
    stable = max(run.im for run in runs if run.stable)
    assert stable <= 2.0
    assert len(runs) < 60


@pytest.mark.parametrize("ratio", [1.06, 1.4, 30.0])
def test_bracket_with_failed_run_is_divided_elsewhere(ratio):
    """The new levels are at a quarter and then at three quarters of the logarithmic width, for any
    width of the bracket."""
    runs = [IdaRun(2.0, 2.0, "done", 0.02), IdaRun(2.0 * ratio, 2.0 * ratio, "collapsed", 0.1)]
    for exponent in (0.5, 0.25, 0.75):
        level = LevelSearch(1.0).next(runs)
        assert level == pytest.approx(2.0 * ratio**exponent, rel=1e-12)
        runs.append(IdaRun(level, level, "not-converged", math.nan))


@pytest.mark.parametrize(("drift", "part"), [(0.02, 0.4), (0.0105, 1.0 / 1.5), (0.5, 0.1)])
def test_search_continues_to_lowest_threshold(drift, part):
    """The next level is four fifths of the level at which a linear building has the threshold
    drift. The reduction is at least a third and at most a factor of ten."""
    runs = [IdaRun(2.0, 2.0, "done", drift), IdaRun(2.04, 2.04, "collapsed", 0.1)]
    assert LevelSearch(1.0, lowest_drift=0.01).next(runs) == pytest.approx(2.0 * part, rel=1e-12)


def test_search_decreases_too_high_start():
    runs = drive(
        LevelSearch(8.0), lambda im: ("collapsed", 0.1) if im > 1.0 else ("done", 0.05 * im)
    )
    stable = [run.im for run in below_collapse(runs)]
    assert 0.95 <= stable[-1] <= 1.0


def test_repeated_runs_are_marked(frame, monkeypatch):
    """A run with a result after a repetition with a smaller time step counts; a run without a
    result counts neither as stable nor as collapsed."""
    original = Batch.results

    def results(self, runs):
        rows = original(self, runs)
        pga = rows.runs[0].pga
        if 1.0 < pga < 1.3:
            rows.runs[0] = rows.runs[0].changed(repeats=2)
        if 2.0 < pga < 2.2:
            lost = RunRow(0, *runs[0], Place(), (None,) * len(RUN))
            rows.runs[0] = lost.changed(dt=0.0025, status="diverged", pga=pga, repeats=3)
        return rows

    monkeypatch.setattr(Batch, "results", results)
    (ida_curve,) = ida(frame, [motion(0)], pga()).curves
    mended, lost = (
        [run for run in ida_curve.runs if low < run.im < high]
        for low, high in ((1.0, 1.3), (2.0, 2.2))
    )
    assert mended
    assert all(run.stable and run.finer == 2 for run in mended)
    assert lost
    assert all(run.status == "diverged" and math.isnan(run.drift_ratio) for run in lost)
    assert ida_curve.collapse.lower > 2.2


def test_residual_drift_is_taken_at_rest(frame):
    """After the record, the building comes to rest, and the residual drift equals that of a run
    until rest."""
    settings = IdaSettings(max_im=1.5, thresholds=())
    short = replace(motion(0), acceleration=motion(0).acceleration[:260])
    cut, rested = (
        ida(frame, [short], pga(), replace(settings, until_rest=until_rest)).curves[0].runs[-1]
        for until_rest in (False, True)
    )
    assert cut.im == rested.im
    assert rested.drift_ratio >= cut.drift_ratio
    single = tdint.run(frame, short.scaled(rested.scale), until_rest=True).stories
    assert rested.residual_drift_ratio == pytest.approx(
        np.max(np.abs(single.residual_drift) / single.height)
    )
    assert abs(cut.residual_drift_ratio - rested.residual_drift_ratio) > 0.05 * rested.drift_ratio


def test_fractiles_of_one_and_three_curves():
    drifts = np.array([0.02])
    curves = [curve((im, 0.02), (2.0 * im, math.inf)) for im in (1.0, 2.0, 8.0)]
    assert capacity_fractiles(curves[:1], drifts)[:, 0] == pytest.approx([1.0, 1.0, 1.0])
    low, middle, high = capacity_fractiles(curves, drifts)[:, 0]
    assert (low, middle, high) == pytest.approx((2.0**0.32, 2.0, 2.0 * 4.0**0.68))


@pytest.mark.long
def test_components_of_pair_are_run_at_levels_of_pair(frame):
    first, second = motion(0), replace(motion(1), component="HN2")
    pair = Horizontals(first, second)
    single, both = (
        ida(frame, motions, pga(), pair="rotd100") for motions in ([first, second], [pair])
    )
    assert (single.im_name, both.im_name) == ("pga", "rotd100-pga")
    for apart, together in zip(single.curves, both.curves, strict=True):
        ratio = pga().of(pair, "rotd100") / apart.record.pga
        assert together.collapse.capacity == pytest.approx(
            ratio * apart.collapse.capacity, rel=0.05
        )
        assert all(
            run.im == pytest.approx(run.scale * pga().of(pair, "rotd100")) for run in together.runs
        )


def test_stored_runs_at_outdated_levels_are_repeated(tmp_path, frame, monkeypatch):
    """If a later version selects other levels, the rows of both versions would be mixed."""
    settings = IdaSettings(precision=0.3)
    with monkeypatch.context() as before:
        before.setattr("tdint.studies.ida.ida_curve._HUNT", 1.4)
        ida(frame, [motion(0)], pga(), settings, folder=tmp_path)
    again = ida(frame, [motion(0)], pga(), settings, folder=tmp_path)
    assert again.resumed == 0
    assert same_runs(again, ida(frame, [motion(0)], pga(), settings))
    assert ida(frame, [motion(0)], pga(), settings, folder=tmp_path).resumed == 1


def same_runs(first, second):
    """Return True if two studies have the same runs to the last bit; errors that were not estimated
    are nan in both."""
    return repr([curve.runs for curve in first.curves]) == repr(
        [curve.runs for curve in second.curves]
    )


def test_invalid_arguments_are_refused(frame):
    records = [motion(0)]
    for settings, message in (
        (IdaSettings(precision=0.0), "precision"),
        (IdaSettings(max_im=0.0), "maximum intensity"),
    ):
        with pytest.raises(UsageError, match=message):
            ida(frame, records, settings=settings)
    with pytest.raises(UsageError, match="specified twice"):
        ida(frame, [*records, *records])
    with pytest.raises(UsageError, match="at least one record"):
        ida(frame, [])
    stories = (*frame.stories[:-1], replace(frame.stories[-1], height=None))
    with pytest.raises(ModelError, match="add the height of story 4"):
        ida(replace(frame, stories=stories, p_delta=False), records)


def test_mainshock_has_component_of_record_or_single_component():
    east, north = (replace(motion(9), component=name) for name in ("HNE", "HNN"))
    record = replace(motion(0), component="HNN")
    assert Mainshock((east, north), (0.01,)).before(record) is north
    assert Mainshock((east,), (0.01,)).before(record) is east
    with pytest.raises(
        UsageError,
        match=r"no component HNZ for the aftershock 0\.m.*components: HNE, HNN; select one",
    ):
        Mainshock((east, north), (0.01,)).before(replace(record, component="HNZ"))


def test_mainshock_reaches_its_drift_after_the_end_of_a_short_record():
    """The maximum drift under a pulse of a tenth of the period is in free vibration."""
    bilinear = {"type": "bilinear", "yield_force": 4e5, "hardening": 0.05}
    yielding = {"mass": 1e5, "height": 3.0, "stiffness": 4e6, "law": bilinear}
    building = load_model({"stories": [yielding], "damping": 0.05})
    pulse = Record(np.sin(np.linspace(0.0, np.pi, 11)), 0.01, "", "", "HN1", "pulse.m")
    state = damaged(Subject(building, "impulse4"), pulse, 0.02, first_factor=1.0, dt=None)
    reached = tdint.run(building, state.record, until_rest=True).stories.peak_drift_ratio
    assert reached == pytest.approx(0.02, rel=1e-3)


@pytest.mark.parametrize("drift", [0.0, -0.1, math.nan])
def test_collapse_drift_must_be_positive(frame, drift):
    with pytest.raises(UsageError, match="collapse drift"):
        ida(frame, [motion()], settings=IdaSettings(collapse_drift=drift, thresholds=()))


def test_a_building_of_isolators_has_no_drift_ratio():
    """A height of an isolator would not help, so that the message does not request it."""
    isolator = {"mass": 10, "stiffness": 4e4, "height": 3.0, "isolator": True}
    with pytest.raises(ModelError, match="all stories are isolators") as refused:
        ida(load_model({"stories": [isolator]}), [motion()])
    assert "height of story" not in str(refused.value)


def test_first_scale_is_that_of_the_stories_beside_attachments_and_links():
    """A light, stiff attachment and a weak dashpot do not change the first mode."""
    chain = """
units: {length: m, force: kN, mass: t}
stories: [{repeat: 3, mass: 100, height: 3.5, stiffness: 6.0e4, law: {type: bilinear,
  yield_force: 300, hardening: 5%}}]
plausibility: off, test
"""
    devices = """
attachments: [{name: tank, floor: 1, mass: 1.0e-6, stiffness: 10}]
links: [{from: ground, to: 2, dashpot: 1.0e-6}]
"""
    scales = [
        _elastic_scale(assemble(load_model(io.StringIO(text))), motion(), 0.1)
        for text in (chain, chain + devices)
    ]
    assert scales[1] == pytest.approx(scales[0], rel=1e-6)


@pytest.mark.parametrize("pair", [False, True])
def test_capacities_of_a_linear_building_are_proportional_to_limits(tmp_path, pair):
    """In a linear building, the intensity at a limit is the intensity of any run times the limit
    divided by the demand of the run; of a pair, that of the component with the larger demand."""
    lines = """
units: {length: m, force: kN, mass: t}
stories: [{repeat: 2, mass: 100, height: 3, stiffness: 4.0e+4}]
damping: 5%
attachments: [{name: tank, floor: 1, mass: 2, stiffness: 300, dashpot: 3}]
links: [{name: damper, from: ground, to: 2, dashpot: 100}]
limits:
  attachment_stroke: 0.2
  levels: {twice: {attachment_stroke: {tank: 0.4}, link_force: 50}}
"""
    (tmp_path / "m.yaml").write_text(lines)
    first = motion(1)
    second = replace(motion(2), source="1.m", component="HN2")
    motions = [Horizontals(first, second, "")] if pair else [first]
    study = ida(tmp_path / "m.yaml", motions, pga(), folder=tmp_path / "study")
    (curve,) = study.motion_curves
    (*_, stroke, twice, force) = capacities = limit_capacities(study, curve)
    assert [item.limit for item in capacities] == [
        "attachment_stroke", "twice: attachment_stroke", "twice: link_force",
    ]  # fmt: skip
    assert twice.capacity == pytest.approx(2.0 * stroke.capacity, rel=1e-3)
    expected = []
    for record in (first, second) if pair else (first,):
        peaks = tdint.run(tmp_path / "m.yaml", record, check=False).devices.stories
        intensity = pga().of(motions[0], study.pair or "")
        ratios = peaks.peak_drift[0] / 0.2, peaks.peak_damper_force[1] / 5e4
        expected.append([intensity / ratio for ratio in ratios])
    assert [stroke.capacity, force.capacity] == pytest.approx(
        np.min(expected, axis=0).tolist(), rel=1e-3
    )
    # A continued study reads the strokes from its store.
    again = ida(tmp_path / "m.yaml", motions, pga(), folder=tmp_path / "study")
    assert again.resumed == len(again.curves)
    # The threshold of a limit is NaN, which differs from itself.
    assert repr(limit_capacities(again, again.motion_curves[0])) == repr(capacities)
    reported, _ = ida_report._capacities(study)
    at = reported.columns.index("attachment_stroke")
    assert reported.rows[0][at : at + 3] == (stroke.capacity, twice.capacity, force.capacity)
    (header, *rows) = capacity_table(again).csv().decode().splitlines()
    assert "limit" in header.split(",") and len(rows) == len(again.thresholds) + 3
