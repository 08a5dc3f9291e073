"""`tdint stability`, `tdint overshoot` and `tdint order`: rows, messages, figures, exit codes."""

import json
import math

import numpy as np
import pytest
import scipy.integrate

from csv_rows import rows
from facts import each_states, states
from selection import every
from tdint.assessment.order.order import LOADS, STORY_LAWS
from tdint.methods.catalogue import catalogue, parse
from tdint_cli.assessment import order

COMMANDS = ("stability", "overshoot", "order")
SMALL = {
    "stability": ("--dt-over-t", "0.01:1:5"),
    "overshoot": ("--steps", "3"),
    "order": ("--load", "record"),
}
ALL = [parse(name).label for name in catalogue()]


def column(result, name: str) -> list[str]:
    return [row[name] for row in rows(result.stdout)]


@pytest.mark.parametrize(
    "name",
    every(
        2,
        [pytest.param(name, marks=[pytest.mark.long] * (name == "stability")) for name in COMMANDS],
    ),
)
def test_all_methods_with_default_parameters(tdint, name):
    result = tdint(name, *SMALL[name], code=0)
    assert list(dict.fromkeys(column(result, "method"))) == ALL
    assert "nan" not in result.stdout


def test_a_label_is_the_typed_specification(working_directory, tdint, folder):
    """Parameters are separated by colons. Commas are accepted with a note about the recommended
    notation."""
    typed = "newmark:beta=1/4:gamma=0.50"
    assert set(
        column(
            tdint("stability", *SMALL["stability"], "--method", f"{typed},impulse4", code=0),
            "method",
        )
    ) == {typed, "impulse4"}
    old = tdint("stability", *SMALL["stability"], "--method", "newmark:beta=1/4,gamma=0.50", code=0)
    assert set(column(old, "method")) == {typed}
    assert old.stderr.count(f"recommended notation is {typed}") == 1
    tdint("run", "shaken.yaml", "-q", "--method", typed, "-o", "out", code=0)
    summary = json.loads((working_directory / "out" / "summary.json").read_text())
    assert (summary["method"], summary["method_parameters"]) == (
        typed,
        {"beta": 0.25, "gamma": 0.5},
    )
    (row,) = rows(tdint("methods", typed, code=0).stdout)
    assert row["parameters"] == "beta=0.25 in [0 to 1]; gamma=0.5 in [0.5 to 1]"


def test_a_table_with_the_suffix_of_a_workbook_causes_a_warning(working_directory, tdint):
    command = ("stability", *SMALL["stability"], "--method", "newmark")
    assert (
        "Warning: -o x.xlsx: the table is written as CSV"
        in tdint(*command, "-o", "x.xlsx", code=0).stderr
    )
    assert (working_directory / "x.xlsx").read_text() == tdint(*command).stdout


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["-o", "x.png", "--plot", "x.png"], 6, "x.png: two outputs have this file name"),
        (["-o", ""], 2, "-o must not be empty"),
        (["--method", "newmrk"], 2, "'newmrk'; did you mean 'newmark'? (known: impulse, "),
        (["--method", "wilson:beta=1"], 2, "wilson ... 'beta'; ... theta in [1, 10]"),
        (["--method", "hht:alpha=0.1"], 2, "alpha must be in [-0.333333, 0], got 0.1"),
        (
            ["--method", "newmark", "--method", "bathe:gamma=1"],
            2,
            "gamma must be in (0, 1), got 1.0",
        ),
    ],
)
def test_invalid_arguments_are_refused(working_directory, tdint, name, arguments, code, message):
    tdint.refused(message, name, *SMALL[name], *arguments, code=code)


@pytest.mark.parametrize(
    "line",
    [
        *(f"stability --damping {value}" for value in ("inf", "-0.1", "nan")),
        *(
            f"stability --dt-over-t {value}"
            for value in ("1:0.1:5", "0.1:1:1", "0.1:1", "0:1:5", "0.1:inf:5", "nan")
        ),
        *(f"stability --dt-over-t {value}" for value in ("0.1:1:1e3", "1e7", "1e-7:1:3")),
        *(f"overshoot --dt-over-t {value}" for value in ("0", "inf", "1e7")),
        "overshoot --damping nan",
        "overshoot --steps 0",
        "order --load sinus",
        "order --law bilinear",
        "order --frequency-ratio -1",
        "order --frequency-ratio 0.2:11:3",
    ],
)
def test_values_out_of_range_are_refused(tdint, line):
    tdint.refused(f"Invalid value for '{line.split()[1]}'", *line.split())


# ---- stability


def test_the_default_steps(tdint):
    steps = [float(step) for step in column(tdint("stability", "--method", "newmark"), "dt_over_t")]
    np.testing.assert_allclose(steps, np.geomspace(1e-3, 1e3, 400), rtol=1e-11)
    assert column(
        tdint("stability", "--method", "newmark", "--dt-over-t", "0.25"), "dt_over_t"
    ) == ["0.25"]


def test_critical_steps_are_reported(tdint):
    """The critical steps of each method and damping ratio do not depend on the steps of the
    table."""
    methods = ("--method", "central-difference,newmark-average,rk5", "--damping", "0,0.05")
    result = tdint("stability", *SMALL["stability"], *methods)
    none = "none up to omega dt 1e4"
    assert [line.split(maxsplit=2) for line in result.stderr.splitlines()] == [
        ["method", "damping", "critical omega dt"],
        ["central-difference", "0", "2.00000"], ["central-difference", "0.05", "2.00000"],
        ["newmark-average", "0", none], ["newmark-average", "0.05", none],
        ["rk5", "0", "0.997191"], ["rk5", "0.05", "2.40256"],
    ]  # fmt: skip


@pytest.mark.long
def test_beta_scan(working_directory, tdint):
    """If beta differs slightly from 1/144, the impulse method is unstable in a narrow band near
    √12. The table contains steps within this band."""
    call = "stability --method gauss4 --beta-scan --dt-over-t 0.01:1:9 --plot x.svg"
    result = tdint(call, code=0)
    critical = dict(line.split(maxsplit=2)[::2] for line in result.stderr.splitlines()[1:])
    none = "none up to omega dt 1e4"
    expected = {
        "1/120": "3.16228", "1/143": "3.45205", "1/144": none, "1/145": "3.46410",
        "1/160": "3.46410",
    }  # fmt: skip
    labels = {beta: parse(f"impulse:beta={beta}").label for beta in expected}
    assert critical == {"gauss4": none} | {labels[beta]: limit for beta, limit in expected.items()}
    for beta in ("1/143", "1/145"):
        radii = [
            float(row["spectral_radius"])
            for row in rows(result.stdout)
            if row["method"] == labels[beta] and 3.4 < 2.0 * math.pi * float(row["dt_over_t"]) < 3.5
        ]
        assert max(radii) == pytest.approx(1.004, abs=5e-4)
    steps = [float(row["dt_over_t"]) for row in rows(result.stdout) if row["method"] == "gauss4"]
    assert steps == sorted(steps)
    picture = (working_directory / "x.svg").read_text(encoding="utf-8")
    assert "impulse:beta=1/145" in picture and "√12" in picture


# ---- overshoot


def test_overshoot_messages(tdint):
    methods = ("newmark-average", "generalized-alpha", "wilson", "cr", "rk5")
    lines = tdint("overshoot", "--method", ",".join(methods)).stderr.splitlines()
    assert lines[0] == "Powers of omega dt in the first time step, for omega dt to infinity:"
    assert [line.split(maxsplit=5) for line in lines[3:]] == [
        ["newmark-average", "0.0", "0.0", "-2.0", "0.0", "none"],
        ["generalized-alpha", "0.0", "2.0", "-2.0", "0.0", "velocity"],
        ["wilson", "2.0", "2.0", "0.0", "0.0", "displacement and velocity"],
        ["cr", "0.0", "-2.0", "0.0", "0.0", "displacement"],
        ["rk5", "6.0", "6.0", "4.0", "6.0", "unstable"],
    ]
    assert lines[2].split() == ["exact", "motion", "0.0", "1.0", "-1.0", "0.0"]
    assert "zero" in tdint("overshoot", "--method", "exact", "--damping", "0.05").stderr


def test_overshoot_in_nonlinear_motion(working_directory, tdint):
    """The messages contain the maximum overshoot of each method and the omitted methods."""
    options = ("--method", "newmark-average,moment4,exact", "--law", "softening", "--plot", "x.png")
    result = tdint("overshoot", *options, code=0)
    table = rows(result.stdout)
    assert {(row["law"], row["displacement_power"], row["velocity_power"]) for row in table} == {
        ("softening", "", "")
    }
    largest = max(
        abs(float(row["displacement"])) for row in table if row["method"] == "newmark-average"
    )
    lines = result.stderr.splitlines()
    assert states(lines[0], "note: exact: omitted, ... linear buildings only")
    cells = {line.split()[0]: line.split(maxsplit=5)[1:] for line in lines[3:]}
    assert cells["newmark-average"] == [
        "1", "0.391", f"{largest:.3g}", "1.63", "displacement and velocity",
    ]  # fmt: skip
    assert cells["moment4"][-1] == "none"


# ---- order


@pytest.mark.long
def test_order_over_the_frequency_ratio(working_directory, tdint, monkeypatch):
    """The order is computed at fifteen frequency ratios by default. A reference solution with a
    tolerance of 1e-8 suffices, because the errors exceed 1e-5."""
    solve = scipy.integrate.solve_ivp
    coarse = {"rtol": 1e-8, "atol": 1e-9}
    monkeypatch.setattr(
        scipy.integrate,
        "solve_ivp",
        lambda *arguments, **options: solve(*arguments, **options | coarse),
    )
    result = tdint("order", "--method", "central-difference", "--plot", "x.png", code=0)
    # The summary has one line per method, below the header.
    assert [line.split()[:2] for line in result.stderr.splitlines()[1:]] == [
        ["central-difference", "2.00"]
    ]
    table = rows(result.stdout)
    np.testing.assert_allclose(
        [float(row["frequency_ratio"]) for row in table], np.geomspace(0.2, 5.0, 15), rtol=1e-11
    )
    assert {(row["method"], row["load"], row["law"]) for row in table} == {
        ("central-difference", "harmonic", "linear")
    }
    for quantity in (
        "displacement_order",
        "velocity_order",
        "acceleration_order",
        "algorithmic_acceleration_order",
    ):
        np.testing.assert_allclose([float(row[quantity]) for row in table], 2.0, atol=0.1)


@pytest.mark.parametrize(
    ("command", "law"), [("order --load free", "polynomial"), ("overshoot", "hardening")]
)
def test_methods_that_do_not_support_the_law_are_reported(tdint, command, law):
    call = (*command.split(), "--law", law, "--method")
    result = tdint(*call, "exact,newmark-average", code=0)
    assert set(column(result, "method")) == {"newmark-average"}
    assert states(result.stderr.splitlines()[0], "note: exact: omitted, ... linear buildings only")
    tdint.refused(f"Error: exact ... linear buildings only ... --law {law}\n", *call, "exact")


def test_rounding_errors_are_reported_as_the_reason_of_a_missing_order(
    working_directory, tdint, drawn
):
    result = tdint("order --method exact --method newmark --load record --plot x.svg")
    summary = [line.split() for line in result.stderr.splitlines()[1:3]]
    assert [line[0] for line in summary] == ["exact", "newmark"]
    assert summary[0][1:] == ["-"] * 4 and summary[1][1] == "2.00"
    assert each_states(
        result.stderr.splitlines()[3:], ["note: exact: no order, ... rounding errors"]
    )
    assert column(result, "displacement_order")[0] == ""
    assert "errors are rounding" in (working_directory / "x.svg").read_text(encoding="utf-8")


def test_a_failing_method_does_not_prevent_the_others(tdint, monkeypatch):
    from tdint.assessment.order import order as accuracy
    from tdint.errors import AnalysisError

    measure = accuracy.observed_order

    def fail(integrator, problem):
        if integrator.label == "houbolt":
            raise AnalysisError("houbolt failed with dt 0.02 s")
        return measure(integrator, problem)

    monkeypatch.setattr(accuracy, "observed_order", fail)
    result = tdint("order", "--load", "free", "--method", "houbolt", "--method", "park", code=5)
    assert column(result, "method") == ["park"]
    assert result.stderr.splitlines()[1].startswith("park ")
    assert result.stderr.splitlines()[2:] == ["Error: houbolt failed with dt 0.02 s"]
    failed = tdint("order", "--load", "free", "--method", "houbolt")
    assert (failed.exit_code, failed.stdout) == (5, "")


def test_the_choices_equal_the_options_of_the_library():
    choices = {
        parameter.name: getattr(parameter.type, "choices", None)
        for parameter in order.command.params
    }
    assert set(choices["load"]) == set(LOADS)
    assert set(choices["law"]) == set(STORY_LAWS)


@pytest.mark.parametrize(
    "command",
    [("stability", "--dt-over-t", "0.1"), pytest.param(("overshoot",), marks=pytest.mark.slow)],
    ids=" ".join,
)
def test_figures_show_a_selection_of_the_methods(working_directory, tdint, command):
    """The table contains all methods; the figure contains a selection, or all methods with
    --all."""
    table = tdint(*command, "--plot=few.svg").stdout
    tdint(*command, "--plot=all.svg", "--all")
    selection, all_methods = (
        (working_directory / f"{name}.svg").read_text(encoding="utf-8") for name in ("few", "all")
    )
    for name in ("houbolt", "wilson"):
        assert name in table and name in all_methods and name not in selection
    assert "newmark-average" in selection
