"""Spectral matching: derivatives compared with differences, the quadratic program compared with
SciPy, and properties of matched motions."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize

import tdint
from building_cases import noise
from tdint.errors import ModelError, RecordError, UsageError
from tdint.ground_motion.horizontals import Horizontals
from tdint.ground_motion.reading.suites import components
from tdint.kernels.oscillators.extremes import OSCILLATOR, TIME, VALUE
from tdint.response.spectra.target import read_target, read_targets
from tdint.studies.motions import matching_problem
from tdint.studies.motions.matching import _spectra
from tdint.studies.motions.matching_problem import MatchingProblem, SparseRows, solve_program

TARGET = "asce7:sds=0.6,sd1=0.4,tl=8"


@pytest.fixture(scope="module")
def motion():
    """A motion as strong motions are, of 8 s."""
    rng = np.random.default_rng(3)
    rough = rng.normal(size=801) * np.sin(np.pi * np.linspace(0.0, 1.0, 801)) ** 2
    return replace(noise(peak=2.0), acceleration=noise(peak=2.0).acceleration + rough)


@pytest.fixture(scope="module")
def matched(motion):
    return tdint.match(motion, TARGET, periods=(0.2, 1.0))


@pytest.fixture(scope="module")
def pair(motion):
    """Return a pair with a different second component."""
    rough = (
        np.random.default_rng(4).normal(size=801) * np.sin(np.pi * np.linspace(0.0, 1.0, 801)) ** 2
    )
    second = replace(motion, acceleration=rough + 0.5 * motion.acceleration[::-1], component="HN2")
    return Horizontals(replace(motion, component="HN1"), second)


def problem_of(motion, periods):
    """Return a problem whose target is the spectrum of the motion, and the samples of all
    components."""
    samples = np.array([record.acceleration for record in components(motion)])
    wanted = _spectra(motion, periods, [0.05])[0]
    damping = np.full(periods.size, 0.05)
    return MatchingProblem(samples, 0.01, periods, wanted=wanted, damping=damping), samples


@pytest.mark.parametrize("case", ["motion", "pair"])
def test_maximum_extremes_equal_spectrum(request, case):
    """By another kernel: that of the spectra, exact between samples, of pairs over 180
    directions."""
    problem, samples = problem_of(request.getfixturevalue(case), np.geomspace(0.1, 3.0, 25))
    found, largest = problem.extremes(samples, 0.9 * problem.wanted)
    np.testing.assert_allclose(largest[0], problem.wanted, rtol=2e-4)
    size = np.linalg.norm(found[VALUE:], axis=0)
    assert np.all(size > 0.9 * problem.wanted[found[OSCILLATOR].astype(int)] * (1.0 - 1e-9))
    np.testing.assert_allclose(size[largest[1].astype(int)], largest[0], rtol=1e-15)


@pytest.mark.parametrize("case", ["motion", "pair"])
def test_derivatives_of_extremes_agree_with_differences(request, case):
    """Without an envelope, the row of an extreme is its change divided by the target for a change
    of the band-limited samples. The first samples are excluded, because rows also extend before the
    motion, where the envelope is zero."""
    problem, samples = problem_of(request.getfixturevalue(case), np.geomspace(0.1, 2.0, 12))
    problem.envelope = np.ones_like(problem.envelope)
    found, largest = problem.extremes(samples, 0.99 * problem.wanted)
    columns = largest[1].astype(int)
    values = found[VALUE:, columns]
    rows = problem.rows(
        found[OSCILLATOR, columns].astype(int),
        found[TIME, columns],
        values / np.linalg.norm(values, axis=0),
    )
    change = 1e-5 * np.random.default_rng(1).normal(size=samples.shape)
    change[:, :300] = 0.0
    after, before = (
        problem.extremes(samples + part * problem.filtered(change), 0.9 * problem.wanted)[1][0]
        for part in (1.0, -1.0)
    )
    changes = problem.wanted * rows.times(change.ravel())[: columns.size]
    np.testing.assert_allclose(
        changes, 0.5 * (after - before), rtol=2e-3, atol=1e-7
    )  # rows are of single precision


def test_quadratic_program_agrees_with_scipy():
    """Multipliers of equalities free, of inequalities none above zero."""
    rng = np.random.default_rng(7)
    for _ in range(5):
        rows = rng.normal(size=(12, 40))
        gram, short, equal = rows @ rows.T / 40.0, rng.normal(size=12), np.arange(12) < 5
        found = solve_program(gram, short, equal, np.full(12, 1e-3))
        matrix = gram + 1e-3 * np.eye(12)
        bounds = LinearConstraint(np.eye(12)[~equal], -np.inf, 0.0)
        best = minimize(
            lambda m, matrix=matrix, short=short: 0.5 * m @ matrix @ m - short @ m,
            np.zeros(12),
            jac=lambda m, matrix=matrix, short=short: matrix @ m - short,
            constraints=[bounds],
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 500},
        ).x
        objectives = [0.5 * m @ matrix @ m - short @ m for m in (found, best)]
        assert objectives[0] == pytest.approx(objectives[1], rel=5e-3, abs=5e-3)


@pytest.mark.long
def test_motion_is_matched_to_target(motion):
    """The exact spectrum agrees at other periods, and the ground displacement ends at the value of
    the scaled seed."""
    matched = tdint.match(motion, TARGET, periods=(0.1, 2.0))
    periods = np.geomspace(0.11, 1.9, 333)
    deviation = tdint.spectrum(matched.record, periods).psa / matched.target.at(periods) - 1.0
    before = tdint.spectrum(matched.before, periods).psa / matched.target.at(periods) - 1.0
    assert np.max(np.abs(deviation)) < 0.08 < np.max(np.abs(before))
    assert np.mean(np.abs(deviation)) < 0.01 and matched.mean_misfit < 0.01
    after, seed = (path.displacement for path in matched.motions)
    assert abs(after[-1] - seed[-1]) < 0.02 * np.max(np.abs(seed))
    assert matched.record.dt == motion.dt and "matched to" in matched.record.processing[-1]
    assert matched.factor * motion.acceleration == pytest.approx(matched.before.acceleration)
    columns = matched.to_dict()
    assert (
        columns["largest_misfit"][0] == matched.largest_misfit
        and columns["change"][0] == matched.change
    )
    figure = matched.plot()
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == [
        "target",
        "scaled seed",
        "matched",
    ]


@pytest.mark.long
def test_peaks_after_the_end_of_a_seed_are_matched(motion, matched):
    """A seed that is cut in its strong part gets zeros over half the longest period. Without them
    the largest misfit is 1.5."""
    cut = replace(motion, acceleration=motion.acceleration[:400])
    result = tdint.match(cut, TARGET, periods=(0.2, 3.0))
    assert result.largest_misfit < 0.02
    assert result.record.acceleration.size == 551
    assert "padded with zeros, 0 s before and 1.51 s after" in result.record.processing
    assert matched.record.acceleration.size == motion.acceleration.size


def test_pair_is_matched_in_rotd100(pair):
    """The maximum over all directions agrees at other periods, and both components have the same
    factor."""
    matched = tdint.match(pair, TARGET, periods=(0.1, 2.0))
    periods = np.geomspace(0.11, 1.9, 77)
    deviation = (
        tdint.rotated_spectrum(matched.record, periods, percentiles=[100]).psa[0]
        / matched.target.at(periods)
        - 1.0
    )
    assert np.max(np.abs(deviation)) < 0.02
    assert [part.after.component for part in matched.parts] == ["HN1", "HN2"]
    assert matched.parts[1].before.acceleration == pytest.approx(
        matched.factor * pair.second.acceleration
    )
    (ratio, _), (before, correlation) = matched.directions
    assert 1.0 < ratio < np.sqrt(2.0) and 1.0 < before < np.sqrt(2.0)
    assert correlation == pytest.approx(
        np.corrcoef(pair.first.acceleration, pair.second.acceleration)[0, 1]
    )
    assert matched.to_dict()["component"] == ["HN1", "HN2"]


@pytest.mark.long
def test_suite_match_fits_mean_and_keeps_scatter(motion, pair):
    """Each motion is matched to its own share of the target."""
    motions = [
        motion,
        pair.second,
        replace(motion, acceleration=pair.second.acceleration[::-1] * 3.0),
    ]
    matches = tdint.match_suite(motions, TARGET, periods=(0.5, 0.9))
    after, before = (
        np.array([getattr(match, name) for match in matches]) for name in ("psa", "seed_psa")
    )
    deviation = np.mean(after, axis=0) / read_target(TARGET).at(matches[0].periods) - 1.0
    assert (
        np.mean(np.abs(deviation))
        < 0.005
        < np.mean(np.abs(np.mean(before, axis=0) / np.mean(after, axis=0) - 1.0))
    )
    scatter = [np.mean(np.std(np.log(psa), axis=0, ddof=1)) for psa in (after, before)]
    assert scatter[0] == pytest.approx(scatter[1], abs=0.01)


@pytest.mark.parametrize("periods", [(2.0, 0.1), (0.0, 1.0), (0.1, np.inf)])
def test_invalid_period_range_is_refused(motion, periods):
    with pytest.raises(UsageError, match="range of periods"):
        tdint.match(motion, TARGET, periods=periods)


def test_sparse_rows_agree_with_dense_matrix(monkeypatch):
    """Rows with different starts and lengths, in several blocks, give the products of a dense
    matrix."""
    monkeypatch.setattr(matching_problem, "_BLOCK", 7)
    rng = np.random.default_rng(0)
    size, starts, lengths = 30, np.array([0, 3, 12, 25, 0]), [30, 5, 18, 5, 9]
    lines = [rng.normal(size=length).astype(np.float32) for length in lengths]
    directions = rng.normal(size=(5, 2))
    dense = np.zeros((5, 2, size))
    for row, start, line, direction in zip(dense, starts, lines, directions, strict=True):
        row[:, start : start + line.size] = direction[:, None] * line
    dense = dense.reshape(5, -1)
    rows = SparseRows(size, starts, lines, directions)
    np.testing.assert_allclose(rows.products(), dense @ dense.T, rtol=1e-5, atol=1e-5)
    change, multipliers = rng.normal(size=2 * size), rng.normal(size=5)
    np.testing.assert_allclose(rows.times(change.astype(np.float32)), dense @ change, rtol=1e-5)
    np.testing.assert_allclose(
        rows.sum(multipliers.astype(np.float32)), multipliers @ dense, rtol=1e-5, atol=1e-6
    )


def test_products_of_rows_are_symmetric_within_memory_limit():
    """The matrix, its directions, and a triangle in single precision are in memory, no copies."""
    count, size = 1000, 64
    rng = np.random.default_rng(7)
    lines = [rng.normal(size=size).astype(np.float32) for _ in range(count)]
    rows = SparseRows(size, np.zeros(count, int), lines, np.ones((count, 1)))
    tracemalloc.start()
    products = rows.products()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    np.testing.assert_array_equal(products, products.T)
    assert peak < 2.6 * products.nbytes


def test_memory_of_free_vibrations_does_not_grow_with_record(motion):
    """A free vibration is stored until it has decayed: ten times the record needs less than twice
    the memory."""
    periods = np.geomspace(0.1, 2.0, 20)
    sizes = []
    for times in (4, 40):
        samples = np.tile(motion.acceleration, times)[None, :]
        problem = MatchingProblem(
            samples, 0.01, periods, wanted=np.ones(20), damping=np.full(20, 0.05)
        )
        sizes.append(sum(line.nbytes for line in problem.free_vibrations))
    assert sizes[1] < 2.0 * sizes[0]


@pytest.mark.long
def test_motion_is_matched_at_several_damping_ratios(motion, tmp_path):
    """The targets are the spectra of a real motion, so that a motion can match them at all ratios.

    The motion that is matched at 5 % alone does not match the target at 1 %.
    """
    ratios, periods = (0.05, 0.01), (0.5, 0.9)
    target = tmp_path / "target.csv"
    other = replace(motion, acceleration=1.5 * motion.acceleration[::-1])
    grid = np.geomspace(0.1, 3.0, 200)
    lines = ["damping,period_s,psa_m_s2"]
    for ratio in ratios:
        psa = tdint.spectrum(other, grid, damping=ratio).psa
        lines += [
            f"{ratio},{period:.17g},{value:.17g}" for period, value in zip(grid, psa, strict=True)
        ]
    target.write_text("\n".join(lines))
    both = tdint.match(motion, str(target), periods=periods, damping=ratios)
    alone = tdint.match(motion, str(target), periods=periods, damping=0.05)
    checked = np.geomspace(*periods, 300)
    errors = [
        [
            np.mean(np.abs(tdint.spectrum(matched.record, checked, damping=ratio).psa / aim - 1.0))
            for ratio, aim in zip(
                ratios, (t.at(checked) for t in read_targets(str(target), ratios)), strict=True
            )
        ]
        for matched in (both, alone)
    ]
    assert max(errors[0]) < 0.03 < errors[1][1]
    assert [spectrum.damping for spectrum in both.by_damping] == list(ratios)
    assert list(both.to_dict()["damping"]) == list(ratios)
    assert "damping" not in alone.to_dict()


def test_targets_for_several_damping_ratios(tmp_path):
    """Eurocode 8 reduces its plateau by sqrt(10 / (5 + xi)); other sources need a column."""
    source = "ec8:type=1,soil=B,ag=0.2g"
    twenty, five = read_targets(source, (0.2, 0.05))
    assert twenty.at(0.3) / five.at(0.3) == pytest.approx(np.sqrt(10.0 / 25.0))
    assert (twenty.damping, five.damping) == (0.2, 0.05)
    for refused in (TARGET, f"{source},damping=5%"):
        with pytest.raises(UsageError, match="single damping ratio, got 2"):
            read_targets(refused, (0.02, 0.05))
    for name in ("ec8", "asce7"):
        with pytest.raises(UsageError, match=f"'{name}'.*: {name} requires"):
            read_targets(name, (0.02, 0.05))
    table = tmp_path / "target.csv"
    table.write_text("damping,period_s,sa_g\n.02,.1,1\n.02,1,2\n.05,.1,.5\n.05,1,1\n")
    two, five = read_targets(str(table), (0.02, 0.05))
    np.testing.assert_allclose(two.psa, 2.0 * five.psa)
    with pytest.raises(ModelError, match=r"0\.03 not found; .* 0\.02, 0\.05"):
        read_targets(str(table), (0.03,))


@pytest.mark.parametrize("ratios", [[], [0.05, 0.05]])
def test_invalid_damping_ratios_are_refused(motion, ratios):
    with pytest.raises(UsageError, match="distinct ratios"):
        tdint.match(motion, TARGET, damping=ratios)


def test_match_reports_progress(motion):
    calls = []
    tdint.match(
        motion, TARGET, periods=(0.5, 0.6), progress=lambda done, total: calls.append((done, total))
    )
    assert calls[0] == (0, calls[-1][1]) and calls[-1][0] == calls[-1][1]


def test_number_of_controlled_extremes_is_limited(motion):
    """Stationary noise has many extremes above a quarter of its spectrum. Only the largest extremes
    are controlled, including the maximum at each period."""
    noisy = replace(motion, acceleration=np.random.default_rng(5).normal(size=4000))
    periods = np.geomspace(0.1, 1.0, 20)
    problem, samples = problem_of(noisy, periods)
    problem.wanted = 0.25 * problem.wanted
    found, largest = problem.extremes(samples, 0.8 * problem.wanted)
    assert found.shape[1] > 20 * periods.size
    oscillators, times, _, _, equal = problem.equations(found, largest)
    assert oscillators.size == 6 * periods.size
    assert np.sum(equal) == periods.size and set(oscillators[equal]) == set(range(periods.size))
    sizes = np.abs(found[VALUE]) / problem.wanted[found[OSCILLATOR].astype(int)]
    smallest = np.min(sizes[np.isin(found[TIME], times[~equal])])
    assert np.sum(sizes > smallest) <= 6 * periods.size


def test_motion_without_peaks_is_refused(motion):
    ramp = replace(motion, acceleration=np.linspace(0.0, 3.0, 800), source="ramp.csv")
    with pytest.raises(RecordError, match=r"ramp\.csv HN1: cannot be matched: .*has no peak"):
        tdint.match(ramp, TARGET, periods=(0.1, 2.0))


def test_spectra_extend_beyond_matched_range(matched, pair):
    """From half of the shortest period to twice the longest; of a pair RotD100 and both
    components."""
    periods = matched.shown_periods
    assert periods[0] == pytest.approx(0.1) and periods[-1] == pytest.approx(2.0)
    ((after, before),) = matched.spectra_at(periods)
    np.testing.assert_allclose(after, tdint.spectrum(matched.record, periods).psa)
    np.testing.assert_allclose(before, matched.factor * tdint.spectrum(matched.seed, periods).psa)
    both = replace(matched, record=pair, seed=pair)
    pair_spectra, *component_spectra = both.spectra_at(periods)
    for (psa, _), record in zip(component_spectra, components(pair), strict=True):
        np.testing.assert_allclose(psa, tdint.spectrum(record, periods).psa)
        assert np.all(pair_spectra[0] >= psa * (1.0 - 1e-3))
