"""`tdint examples`: rows, messages, figures, exit codes."""

import re

import numpy as np
import pytest
from matplotlib.figure import Figure

from csv_rows import rows
from tdint.assessment.examples.paper_examples import DT, ExampleMotion, ExampleRun
from tdint.grids import parse_grid
from tdint_cli.assessment import examples as commands

FILES = {
    "1": ["example-1-errors.csv", "example-1-errors.json", "figure-07.png", "figure-08.png"],
    "2": [
        "example-2-errors.csv", "example-2-errors.json", "figure-10.png", "figure-11.png",
        "figure-12.png",
    ],
    "3": [
        "example-3-errors.csv",
        "example-3-errors.json",
        "figure-14.png",
        "figure-15.png",
        "figure-16.png",
    ],
}  # fmt: skip
NUMBERED = re.compile(r"Figure (\d+)(:|, redrawn:) ")
CAPTIONS = (
    "spectral radii, damping ratio 0", "spectral radii, damping ratio 5 %",
    "period elongations", "numerical damping", "amplitude decay",
    "order of accuracy over ω₀ / ω",
)  # fmt: skip
"""Captions of the first figures of the paper."""


@pytest.mark.long
@pytest.mark.parametrize("numbers", ["1", pytest.param("1 2 3", marks=pytest.mark.slow)])
def test_examples_with_their_figures(working_directory, tdint, numbers, drawn):
    examples = numbers.split()
    result = tdint("examples", *examples, "-o", "paper", code=0)
    assert "nan" not in result.stdout
    table = rows(result.stdout)
    assert [row["example"] for row in table] == [number for number in examples for _ in range(10)]
    assert {row["dt_s"] for row in table} == {"0.02"}
    assert sorted(path.name for path in (working_directory / "paper").iterdir()) == sorted(
        name for number in examples for name in FILES[number]
    )
    for number in examples:
        name, _, *figures = FILES[number]
        assert rows(working_directory / "paper" / name) == [
            row for row in table if row["example"] == number
        ]
        assert all(
            (working_directory / "paper" / figure).read_bytes().startswith(b"\x89PNG")
            for figure in figures
        )
    ranked = sorted(
        (row for row in table if row["rank"] and row["example"] == "1"),
        key=lambda row: int(row["rank"]),
    )
    assert [row["rank"] for row in ranked] == ranks_of(ranked, "displacement_m_error")
    assert (
        "Paper: the proposed method has the smallest error, the central difference the"
        in result.stderr
    )
    if "3" in examples:
        assert (
            "The reference solution of the paper (newmark-linear, dt 0.002 s) differs by 4.3e-05 m"
            in result.stderr
        )


@pytest.mark.long
def test_all_figures_of_the_paper(working_directory, tdint, monkeypatch):
    """Titles and curves of the figures of methods, buildings and examples are checked. The examples
    show displacements and |u - u_exact|, and the building shows its masses and forces."""
    # 2 instead of 15 ratios; the stability figures need all 600 steps.
    monkeypatch.setattr(commands, "_RATIOS", parse_grid("0.5:2:2"))
    drawn = []
    save = Figure.savefig
    monkeypatch.setattr(
        Figure,
        "savefig",
        lambda drawn_figure, *arguments, **options: (
            drawn.append(drawn_figure) or save(drawn_figure, *arguments, **options)
        ),
    )
    result = tdint("examples", "2", "-o", "paper", "--figures", "--reference", "finer", code=0)
    assert "only in a drawing that is not available to us" in " ".join(result.stderr.split())
    names = [
        path.name
        for path in sorted((working_directory / "paper").iterdir())
        if path.suffix == ".png"
    ]
    assert names == [
        "beta-scan.png",
        *(f"figure-{number:02d}.png" for number in (*range(1, 7), *range(9, 13))),
    ]
    titles = {
        int(found[1]): figure
        for figure in drawn
        if (found := NUMBERED.match(figure.get_suptitle()))
    }
    assert sorted(titles) == [*range(1, 7), *range(9, 13)]
    for number, caption in enumerate(CAPTIONS, start=1):
        assert caption in titles[number].get_suptitle()
        labels = [
            text.get_text().strip().partition(":")[0]
            for text in titles[number].legends[0].get_texts()
        ]
        five = ["impulse", "central-difference", "newmark-linear", "newmark-average", "wilson"]
        assert sorted(labels) == sorted([*five, "impulse4", "moment4"])
        lines = titles[number].axes[0].get_lines()[:7]
        assert max(line.get_linewidth() for line in lines[5:]) < min(
            line.get_linewidth() for line in lines[:5]
        )
    assert "redrawn" in titles[9].get_suptitle()
    assert (
        min(len(line.split()) for figure in drawn for line in figure.get_suptitle().splitlines())
        > 1
    )
    (scan,) = (figure for figure in drawn if "Not in the paper" in figure.get_suptitle())
    beta = scan.axes[0].get_lines()
    assert [float(line.get_ydata().max()) > 1.0 + 1e-6 for line in beta[:5]] == [
        True, True, False, True, True,
    ]  # fmt: skip
    texts = [text.get_text() for text in titles[9].axes[0].texts]
    assert {"10 kg", "8 kg", "150 cos 6t N", "100 sin 4t N"} <= set(texts)

    example_figures = [titles[number] for number in (10, 11, 12)]
    # The titles are compared without line breaks.
    suptitles = [" ".join(figure.get_suptitle().split()) for figure in example_figures]
    assert [title.rpartition(") ")[2] for title in suptitles] == [
        "displacement u, floor 1, dt 0.02 s",
        "displacement u, floor 2, dt 0.02 s",
        "|u - u_exact|, floor 2, dt 0.02 s; u_exact: rk5, dt 0.0025 s",
    ]
    second, errors = (
        [line.get_ydata() for line in figure.axes[0].get_lines()] for figure in example_figures[1:]
    )
    exact, *methods, _ = second  # The last line marks the peak.
    assert len(methods) == 7
    for found, error in zip(methods, errors, strict=False):
        assert np.array_equal(error, np.abs(found - exact))


def ranks_of(ranked, column):
    """Return the ranks of rows: errors that exceed the smallest error of a group by at most 5 %
    have its rank."""
    errors = sorted(float(row[column]) for row in ranked)
    ranks = {}
    first = 0
    for index, error in enumerate(errors):
        if error > 1.05 * errors[first]:
            first = index
        ranks[error] = str(first + 1)
    return [ranks[float(row[column])] for row in ranked]


def test_norms_and_the_order_of_the_methods(tdint):
    """The maximum is at least the rms error, the rms error at least the mean. Errors within 5 % are
    equal; with several floors, the error of the floor that the paper draws is listed also."""
    result = tdint("examples", "1", "2", "--method", "impulse,central-difference", code=0)
    names = ("displacement_m_error", "displacement_rms_m_error", "displacement_mean_m_error")
    for row in rows(result.stdout):
        maximum, rms, mean = (float(row[name]) for name in names)
        assert maximum > rms > mean > 0.0
    first, second = result.stderr.split("Example 2: ")
    assert "  maximum: impulse = central-difference\n" in first and "floor" not in first
    assert "  rms: central-difference = impulse\n" in first
    assert "  maximum, floor 2: impulse < central-difference\n" in second
    # Errors of a motion in closed form: 3 m and 4 m at two of the four times.
    motion = ExampleMotion(np.arange(2.0), *np.array([[[3.0, 0.0], [0.0, -4.0]]] * 3))
    zero = ExampleMotion(np.arange(2.0), *np.zeros((3, 2, 2)))
    run = ExampleRun(3, "any", "", 1.0, "done", motion, zero, zero)
    norms = [run.error("displacement", norm=norm) for norm in ("maximum", "rms", "mean")]
    assert norms == [4.0, 2.5, 1.75]
    assert run.error("displacement", norm="maximum", floor=1) == 3.0


@pytest.mark.long
def test_ranks_by_a_finer_reference(tdint):
    """Methods are ranked by their errors relative to a finer reference solution. The test of the
    figures checks ranks by the reference of the paper."""
    table = rows(tdint("examples", "1", "--reference", "finer").stdout)
    ranked = sorted((row for row in table if row["rank"]), key=lambda row: int(row["rank"]))
    assert [row["rank"] for row in ranked] == ranks_of(ranked, "finer_displacement_m_error")
    assert [row["rank"] for row in ranked[:4]] == ["1", "2", "2", "4"]
    assert {row["method"].partition(":")[0] for row in ranked[1:3]} == {
        "impulse",
        "central-difference",
    }
    assert {row["variant"] for row in table if not row["rank"]} == {
        "start with u(-dt) = 0",
        "load linear between the steps",
        "load constant in each step",
    }


def test_selected_methods_and_steps(tdint):
    result = tdint("examples", "2", "1", "1", "--method", "bathe", "--dt", "0.05", "--dt", "0.04")
    table = rows(result.stdout)
    assert [(row["example"], row["dt_s"]) for row in table] == [
        ("1", "0.05"), ("1", "0.04"), ("2", "0.05"), ("2", "0.04"),
    ]  # fmt: skip
    assert "The paper:" not in result.stderr


def test_the_format_of_the_figures(working_directory, tdint):
    starts = {"pdf": b"%PDF", "svg": b"<?xml"}
    for name, start in starts.items():
        tdint("examples", "1", "--method", "impulse", "--format", name, "-o", name, code=0)
        figures = sorted((working_directory / name).glob(f"figure-*.{name}"))
        assert [figure.stem for figure in figures] == ["figure-07", "figure-08"]
        assert all(figure.read_bytes().startswith(start) for figure in figures)


def test_a_run_without_a_result_has_empty_cells_and_no_figure(working_directory, tdint):
    result = tdint("examples", "2", "--method", "exact", "--dt", "0.02", "-o", "out", code=0)
    (row,) = rows(result.stdout)
    assert (row["outcome"], row["displacement_m_error"], row["rank"]) == ("refused", "", "")
    assert "exact has no result: refused" in result.stderr
    files = sorted(path.name for path in (working_directory / "out").iterdir())
    assert files == ["example-2-errors.csv", "example-2-errors.json"]


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["4"], 2, "Invalid value"),
        (["--dt", "1"], 2, "Invalid value for '--dt'"),
        (["--dt", "nan"], 2, "Invalid value for '--dt'"),
        (["--method", "newmrk"], 2, "did you mean 'newmark'?"),
        (["--reference", "exact"], 2, "Invalid value for '--reference'"),
        (["-o", ""], 2, "-o must not be empty"),
        (["1", "--figures"], 2, "--figures"),
    ],
)
def test_invalid_arguments_are_refused(working_directory, tdint, arguments, code, message):
    tdint.refused(message, "examples", *arguments, code=code)


def test_the_help_contains_the_default_steps():
    option = next(parameter for parameter in commands.command.params if parameter.name == "dts")
    assert f"{DT:g} by default, as in the paper" in option.help
