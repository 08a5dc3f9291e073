"""The benchmark page is what its program writes: sections, problems, methods, pictures."""

import importlib.util
import math
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tdint.assessment.chart.performance_profiles import (
    PARTS,
    PEAKS,
    STANDARD,
    Measured,
    PeakErrors,
    read_problems,
)
from tdint.assessment.chart.work_precision import Point
from tdint.methods.catalogue import DEFAULT_METHOD

HERE = Path(__file__).parent
specification = importlib.util.spec_from_file_location("benchmark_page", HERE / "run.py")
run = importlib.util.module_from_spec(specification)
sys.modules[specification.name] = run  # dataclasses ask for it
specification.loader.exec_module(run)
PAGE = run.PAGE.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def stored():
    """Stored entries, their conditions, and the chart of all entries."""
    entries, conditions = run.raw_points.load()
    return entries, conditions, run.complete_chart(entries, conditions)


def made_up(name="linear", motion="near-fault", lines=("impulse4", "newmark-average")):
    """A problem on which the error of each method is its step squared, in per cent."""
    points = [
        Point(
            line,
            0.01 * part,
            100,
            "done",
            200,
            errors=PeakErrors(*3 * (0.01 * part**2,)),
            times=(1e-3 / part,),
            line=line,
        )
        for line in lines
        for part in PARTS
    ]
    return Measured(
        name,
        motion,
        "why",
        3,
        0.01,
        9.0,
        4.2,
        7,
        "moment4",
        PeakErrors(1e-9, 1e-9, 1e-9),
        tuple(points),
    )


@pytest.mark.long
def test_page_of_made_up_points():
    entries = [run.Entry(made_up(), "2026-01-01", 0.5, 1.0)]
    shown = [(f"{name}.png", name) for name in (*PEAKS, *(name for name, _ in run.CHARTS))]
    page = run.page(entries, 36, shown, run.conditions_of(entries))
    assert "35 of 36 problems were not measured" in page
    assert "|`impulse4`|1/1.00/1.0/0|" in page  # as dear as the other one at each tolerance
    assert "load 0.5 to 0.5" in page
    assert (
        "|peak total shear, 3 %|linear, near-fault|1.0|1|1 %|2.0|5.00|`impulse4`|1|1 %|2.0|5.00|"
        in page
    )


@pytest.mark.parametrize("errors", [None, PeakErrors(math.nan, math.nan, math.nan)])
def test_what_is_not_solved_is_counted(errors):
    failing = made_up()
    points = tuple(replace(p, errors=errors) if p.line == "impulse4" else p for p in failing.points)
    chart = run.field_chart([replace(failing, points=points)])
    assert "|`impulse4`|**3**|" in run.failures(chart)
    assert "|`newmark-average`|0|" in run.failures(chart)
    assert "|`impulse4`|0/-/-/1|" in run.tables_of_profiles(chart)


@pytest.mark.long
def test_the_page_is_written_from_the_stored_points(stored):
    """The committed page is equal to the page of the CSV files, without a run, and the default
    method is the one that src/tdint/methods/README.md recommends by these points."""
    entries, conditions, chart = stored
    leading = run.page_tables.leading_methods([chart], 0.0)
    assert leading[0] == chart.leaders().safest == DEFAULT_METHOD
    shown = [one[:2] for one in run.pictures(chart)]
    assert run.page(entries, len(read_problems(STANDARD)), shown, conditions) == PAGE


def test_ratios_of_errors_and_the_cheapest_method_of_made_up_points():
    """With errors of the step squared and equal times, both methods cost the same; a program whose
    errors are twice as large has the ratio 2."""
    peer = "openseespy/newmark-average"
    one = made_up(lines=("impulse4", "newmark-average", peer))
    points = tuple(
        replace(p, errors=PeakErrors(*(2.0 * e for e in vars(p.errors).values())))
        if p.line == peer
        else replace(p, times=(2.0 * p.times[0],))
        if p.line == "newmark-average"
        else p
        for p in one.points
    )
    chart = run.field_chart([replace(one, points=points)])
    found = run.page_tables.ratios_of_errors(chart, peer, "peak_drift")
    assert set(found) == {"linear"}
    assert found["linear"] == pytest.approx([2.0] * sum(part <= 1.0 for part in PARTS))
    assert run.page_tables.cheapest(chart.measured, 0.01) == ["impulse4"]
    assert run.page_tables.mean_costs(chart.measured, 0.01) == pytest.approx(
        {"impulse4": 1.0, "newmark-average": 2.0}
    )


def chart_with_slow(method, factor):
    """Return the results of a machine that needs `factor` times as long for a method."""
    problem = made_up()
    points = tuple(
        replace(p, times=(factor * p.times[0],)) if p.line == method else p for p in problem.points
    )
    return run.field_chart([replace(problem, points=points)])


def test_a_method_that_leads_on_one_machine_is_in_the_verdict():
    charts = [chart_with_slow(name, 3.0) for name in ("newmark-average", "impulse4")]
    leading_methods = run.page_tables.leading_methods
    assert leading_methods(charts[:1], 0.0) == ["impulse4"]
    assert leading_methods(charts[1:], 0.0) == ["newmark-average"]
    assert leading_methods(charts, 0.0) == ["impulse4", "newmark-average"]
    counts = run.page_tables.describe_methods(charts[0], ["impulse4", "gauss4"], 0.0)
    assert re.fullmatch(r"`impulse4` \(\d+ cases\) and `gauss4` \(0 cases\)", counts)


def test_verdicts_of_two_machines_are_compared():
    """One machine needs twice the time for one method, the other machine for the other method."""
    first, second = (chart_with_slow(name, 2.0) for name in ("newmark-average", "impulse4"))
    equal = run.page_tables.compare_verdicts(first, first)
    assert "equal in 36 of 36 cells" in equal
    assert "in 6 of 6 cases, and at most 1.00 times" in equal
    other = run.page_tables.compare_verdicts(first, second)
    assert "equal in 36 of 36 cells" in other
    assert "in 0 of 6 cases, and at most 2.00 times" in other


def test_stored_points_are_read_as_they_were(tmp_path):
    entry = run.Entry(made_up(), "2026-01-01", 0.5, 1.0)
    run.raw_points.store([entry], run.conditions_of([entry]), tmp_path)
    (read,), conditions = run.raw_points.load(tmp_path)
    reason = read.measured.reason
    rounded = [run.raw_points.point_row(entry.measured, point) for point in entry.measured.points]
    again = [run.raw_points.point_row(read.measured, point) for point in read.measured.points]
    assert again == rounded and len(again) == 2 * len(PARTS)
    assert run.raw_points.problem_row(read) == run.raw_points.problem_row(entry)
    assert reason and (read.day, read.load, read.seconds) == ("2026-01-01", 0.5, 1.0)
    assert conditions.versions == run.conditions_of([entry]).versions
    assert conditions.kernels == run.digest_of_all()


def test_times_of_former_kernels_are_marked():
    """The sentence is on the page if the kernels are not those of the measurement."""
    measured = run.conditions_of([run.Entry(made_up(), "2026-01-01", 0.5, 1.0)])
    assert run._age(measured) == ""
    former = replace(measured, kernels="0" * 12, commit="abc1234")
    assert "have changed since abc1234" in run._age(former)
    assert "have changed since this measurement" in run._age(replace(former, kernels="", commit=""))


def test_table_of_wind_is_that_of_its_program():
    """Mean and standard deviation of the wind speed follow from the table of the model."""
    import loads

    stored = np.loadtxt(loads.CONFIGS / "wind-tower.csv", delimiter=",", skiprows=1)
    assert np.abs(stored - loads.wind()).max() < 0.0051
    within = (stored[:, 0] > loads.RAMP) & (stored[:, 0] < loads.DURATION - loads.RAMP)
    for force, speed in zip(stored[within, 1:].T, loads.SPEEDS.values(), strict=True):
        u = np.sqrt(force / loads.DRAG)
        assert u.mean() == pytest.approx(speed, abs=0.3 * loads.TURBULENCE)
        assert u.std() == pytest.approx(loads.TURBULENCE, rel=0.25)
