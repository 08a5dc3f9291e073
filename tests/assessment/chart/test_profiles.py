"""Tests of performance profiles in closed form, of sets of problems, and of a ranking that was
computed by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import chain

import numpy as np
import pytest

from building_cases import noise, ten_bilinear, ten_linear
from tdint import performance_profiles, run, to_dict
from tdint.assessment.chart.chart_figures import profile_picture
from tdint.assessment.chart.performance_profiles import (
    PARTS,
    PEAKS,
    STANDARD,
    TOLERANCES,
    FieldProblem,
    Measured,
    PeakErrors,
    field_chart,
    measure_problem,
    read_problems,
)
from tdint.assessment.chart.problem import pose
from tdint.assessment.chart.work_precision import (
    PerformanceProfile,
    Point,
    performance_ratios,
    within,
)
from tdint.errors import AnalysisError, ModelError, UsageError
from tdint.methods.catalogue import parse

NAN, INF = math.nan, math.inf


# ---- The logic, on numbers


def test_performance_ratio_is_cost_over_minimum_of_problem():
    costs = np.array([[1.0, 2.0, NAN], [4.0, 2.0, 8.0], [NAN, NAN, NAN]])
    np.testing.assert_array_equal(
        performance_ratios(costs, [True] * 3), [[1.0, 2.0, INF], [2.0, 1.0, 4.0], [INF] * 3]
    )
    # The cost of another program does not change the minimum.
    np.testing.assert_array_equal(
        performance_ratios(costs, [True, False, False]),
        [[1.0, 2.0, INF], [1.0, 0.5, 2.0], [INF] * 3],
    )


def test_profile_counts_problems_solved_within_factor():
    profile = PerformanceProfile("peak_drift", 0.01, "a", (1.0, 1.05, 3.0, INF), 4)
    assert [profile.within(factor) for factor in (0.9, 1.0, 1.1, 2.0, 3.0, 1e9)] == [
        0,
        1,
        2,
        2,
        3,
        3,
    ]
    assert (profile.problems, profile.solved, profile.median, profile.worst) == (4, 3, 2.025, 3.0)
    none = PerformanceProfile("peak_drift", 0.01, "a", (INF, INF), 2)
    assert (none.solved, none.median) == (0, INF) and math.isnan(none.worst)


def points(line, order, cost, error=1.0, fails=()):
    """Return the points of a method with errors error * part^order and costs cost / part."""
    return [
        Point(line, part, round(1 / part), "diverged", line=line)
        if part in fails
        else Point(
            line, part, round(1 / part), "done", errors=PeakErrors(*3 * (error * part**order,)),
            times=(cost / part,), line=line,
        )
        for part in PARTS
    ]  # fmt: skip


def measured(*lines, name="one", gap=0.0):
    return Measured(
        name, "noise", "", 1, 1.0, 1.0, NAN, 0, "", PeakErrors(*3 * (gap,)), tuple(chain(*lines))
    )


def test_small_error_at_large_step_by_chance_is_ignored():
    line = points("a", 2, 1.0)
    line[0] = replace(line[0], errors=PeakErrors(0.0, 0.0, 0.0))  # 16 samples, by chance
    assert [point.dt for point in within(line, "a", "peak_drift", 0.05)] == sorted(
        p for p in PARTS if p**2 <= 0.05
    )
    assert within(line, "b", "peak_drift", 0.05) == []


def test_ratios_of_methods_of_two_orders_agree_with_formulas():
    """One method has order 2 and cost 1 per step, the other order 4 and cost 3. For a tolerance e,
    the step is the largest part <= sqrt(e) and e^(1/4), respectively."""
    chart = field_chart(
        [measured(points("two", 2, 1.0), points("four", 4, 3.0), points("none", 0, 1.0))]
    )
    found = {
        (profile.tolerance, profile.method): profile.ratios[0]
        for profile in chart.profiles
        if profile.quantity == "peak_drift"
    }
    for tolerance in TOLERANCES:
        costs = [
            cost / max((part for part in PARTS if part**order <= tolerance), default=NAN)
            for order, cost in ((2, 1.0), (4, 3.0))
        ]
        for line, cost in zip(("two", "four"), costs, strict=True):
            assert found[tolerance, line] == pytest.approx(
                INF if math.isnan(cost) else cost / np.nanmin(costs)
            )
        assert found[tolerance, "none"] == INF
    assert found[0.0001, "two"] == INF  # 1/16 has an error of 4e-3
    assert chart.lines == ["two", "four", "none"]


def test_problems_that_methods_do_not_solve_are_named_with_the_outcome():
    collapsed = [replace(point, outcome="collapsed", errors=None) for point in points("a", 2, 1.0)]
    chart = field_chart(
        [
            measured(points("a", 2, 1.0), points("b", 4, 1.0), name="solved"),
            measured(collapsed, points("b", 2, 1.0, fails=PARTS), name="weak"),
            measured(points("a", 2, 1.0), points("b", 0, 1.0), name="coarse"),
        ]
    )
    assert chart.unsolved() == [
        "weak, noise: collapsed with a; diverged with b",
        "coarse, noise: inaccurate with b",
    ]
    (legend,) = profile_picture(chart, target="peak-drift").legends
    footnote = " ".join(legend.get_title().get_text().split())
    assert "Not solved within 10 %: weak, noise: collapsed with a" in footnote


def test_problems_with_inaccurate_reference_are_excluded():
    chart = field_chart(
        [measured(points("a", 4, 1.0), gap=1e-3), measured(points("a", 4, 1.0), gap=1e-9)]
    )
    problems = {
        profile.tolerance: profile.problems
        for profile in chart.profiles
        if profile.quantity == "peak_absolute_acceleration"
    }
    assert problems == {0.1: 2, 0.03: 2, 0.01: 2, 0.003: 1, 0.001: 1, 0.0001: 1}
    with pytest.raises(AnalysisError, match="no reference solution is accurate enough"):
        field_chart([measured(points("a", 4, 1.0), gap=1.0)]).leaders()


def test_leaders_are_coarse_fine_and_safest():
    """One method is fast and inaccurate, another is slow and reliable, and a third solves only some
    of the problems."""
    both = [
        points("coarse", 1, 1.0, error=1e-2),
        points("sure", 4, 5.0, error=1e-6),
        points("fine", 4, 2.0, error=0.1),
    ]
    blow = [
        points("coarse", 1, 1.0, fails=PARTS),
        points("sure", 4, 8.0, error=1e-6),
        points("fine", 4, 2.0, error=0.1),
    ]
    chart = field_chart(
        [
            measured(*both),
            measured(*both),
            measured(*blow),
            measured(*both, points("exact", 9, 1e-9)),
        ]
    )
    leaders = chart.leaders()
    assert leaders.safest == "sure"
    assert leaders.coarse in ("coarse", "sure")
    # it does not support all problems, and its share counts all problems
    assert "exact" not in leaders
    declined = [profile for profile in chart.profiles if profile.method == "exact"]
    assert {(p.problems, p.solved, p.taken, p.median) for p in declined} == {(4, 1, 1, 1.0)}
    assert (chart.named("exact"), chart.named("sure")) == ("exact (1 of 4)", "sure")


def test_lines_by_tolerance_do_not_change_profiles():
    """A line with the total time of a search for a tolerance changes no ratio and is not
    recommended."""
    by_steps, by_tolerance = points("a", 2, 1.0), points("a by tolerance", 9, 1e-9)
    alone, beside = (
        field_chart([measured(by_steps)]),
        field_chart([measured(by_tolerance, by_steps, points("x/b", 2, 1.0))]),
    )
    assert beside.lines == ["a", "a by tolerance", "x/b"] and beside.leaders() == ("a", "a", "a")
    assert [p for p in beside.profiles if p.method == "a"] == list(alone.profiles)


def test_other_programs_do_not_change_ratios():
    own_points, program_points = points("a", 2, 1.0), points("prog/b", 2, 0.25)
    alone, beside = (
        field_chart([measured(own_points)]),
        field_chart([measured(own_points, program_points), measured(own_points)]),
    )
    own_ratios = {(p.quantity, p.tolerance): p.ratios for p in alone.profiles}
    for profile in beside.profiles:
        if profile.method == "a":
            assert profile.ratios == 2 * own_ratios[profile.quantity, profile.tolerance]
        else:
            assert profile.ratios in ((0.25, INF), (INF, INF)) and profile.taken == 1


def test_skipped_runs_do_not_count_as_unsolved():
    """Time steps below a half were not run: no problem is solved within 0.1 %, and one within 1
    %."""
    line = points("prog/b", 2, 1.0, error=0.01)
    for i, point in enumerate(line):
        if point.dt < 0.5:
            line[i] = replace(point, outcome="not-run", errors=None, times=())
    blow = points("prog/b", 2, 1.0, error=0.01, fails=PARTS)
    own_points = points("a", 2, 1.0)
    chart = field_chart([measured(own_points, line), measured(own_points, blow)])
    found = {
        profile.tolerance: (profile.problems, profile.solved, profile.taken, profile.not_run)
        for profile in chart.profiles
        if (profile.quantity, profile.method) == ("peak_drift", "prog/b")
    }
    assert found[0.01] == (2, 1, 2, 0)
    assert found[0.001] == (1, 0, 1, 1)
    assert all(profile.not_run == 0 for profile in chart.profiles if profile.method == "a")


def test_inaccurate_line_of_peer_is_excluded_from_profiles():
    apart = points("openseespy/generalized-alpha", 2, 1.0)
    chart = field_chart([measured(points("a", 2, 1.0), apart)])
    assert chart.lines == ["a"]
    assert {profile.method for profile in chart.profiles} == {"a"}


# ---- Sets of problems


def test_standard_problem_set():
    standard = read_problems(STANDARD)
    assert len(standard) == 36
    assert (
        len({problem.name for problem in standard}) == 12
        and len({problem.motion for problem in standard}) == 3
    )
    assert all(problem.reason for problem in standard)
    near = next(
        problem
        for problem in standard
        if (problem.name, problem.motion) == ("bilinear", "near-fault")
    )
    assert near.posed.building.stories == 10
    assert near.posed.samples * near.posed.interval == pytest.approx(28.32)


FAULTY = """
records:
  a: {file: motion.mseed, component: HNE, units: m/s^2}
  b: {component: HNE}
problems:
  - {name: one, model: {stories: [{mass: 1, stiffnes: 10}]}, scales: {a: 0, c: 1}}
  - {model: none.yaml}
"""


def test_all_errors_of_problem_file_have_positions(tmp_path):
    file = tmp_path / "faulty.yaml"
    file.write_text(FAULTY)
    with pytest.raises(ModelError) as caught:
        read_problems(file)
    message = str(caught.value)
    for part in (
        "4:6: records.b.file: is missing",
        "stiffnes",
        "scales.a: must not be zero",
        "scales.c: unknown key",
    ):
        assert part in message, message


def test_units_of_a_record_of_a_problem_file(tmp_path):
    np.savetxt(tmp_path / "plain.txt", noise(samples=97).acceleration, header="dt = 0.01 s")
    peaks = []
    for units in ("m/s^2", "g"):
        (tmp_path / "own.yaml").write_text(
            f"records: {{a: {{file: plain.txt, units: {units}}}}}\n"
            "problems: [{name: one, model: {stories: [{mass: 1, stiffness: 9}]}, scales: {a: 2}}]\n"
        )
        (problem,) = read_problems(tmp_path / "own.yaml")
        peaks.append(np.abs(problem.posed.record.acceleration).max())
    assert peaks[0] == pytest.approx(2.0 * noise(samples=97).pga)
    assert peaks[1] == pytest.approx(9.80665 * peaks[0])


def test_models_and_problems_exclude_each_other():
    for arguments in ({}, {"models": [ten_linear()], "problems": STANDARD}):
        with pytest.raises(UsageError, match="either models"):
            performance_profiles(**arguments)


# ---- Problems


@pytest.mark.long
def test_errors_agree_with_runs_with_fine_steps():
    """The reference runs use average acceleration with small time steps, which is only used to
    confirm the stored reference."""
    building, record = ten_bilinear(), noise(samples=161, peak=6.0)
    methods = [parse(name) for name in ("newmark-average", "impulse4", "moment4")]
    found = measure_problem(
        FieldProblem("one", "noise", "", pose(building, record)), methods, repeats=1
    )
    assert found.gap.worst < 2e-4
    fine = run(building, record, method="newmark-average", dt=record.dt / 128).stories
    done = [
        point for point in found.points if point.errors is not None and point.dt < 8.5 * record.dt
    ]
    assert len(done) > 2 * len(methods)
    for point in done:
        peaks = run(building, record, method=point.method, dt=point.dt).stories
        again = [np.max(np.abs(getattr(peaks, name) / getattr(fine, name) - 1.0)) for name in PEAKS]
        np.testing.assert_allclose(
            [point.error(name) for name in PEAKS], again, atol=1e-3, rtol=1e-6
        )


@pytest.mark.long
def test_performance_profiles_of_several_records():
    """For one building under two motions, the profiles have columns and a line, and the ratios
    start at 1."""
    records = [noise(samples=97), noise(samples=97, seed=8)]
    methods = ("newmark-average", "impulse4", "exact")
    chart = performance_profiles(ten_linear(), records, method=methods, tolerances=(0.01, 0.1))
    assert repr(chart) == "<FieldChart of 3 methods, 2 problems>"
    table = to_dict(chart)
    assert len(table["method"]) == len(PEAKS) * len(TOLERANCES) * 4
    assert chart.lines[3:] == ["impulse4 by tolerance"]
    chosen = [point for point in chart.measured[0].points if point.line == chart.lines[3]]
    assert [point.method for point in chosen] == ["impulse4 within 0.1", "impulse4 within 0.01"]
    assert all(
        0.0 < point.error("peak_drift") <= e for point, e in zip(chosen, (0.1, 0.01), strict=True)
    )
    assert all(
        1 <= solved <= 2
        for solved, e in zip(table["solved"], table["tolerance"], strict=True)
        if e == 0.1
    )
    assert min(ratio for profile in chart.profiles for ratio in profile.ratios) == 1.0
