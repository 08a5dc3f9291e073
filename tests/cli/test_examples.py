"""`tdint examples`: rows, words, figures, exit codes."""

import pytest

from csv_rows import rows
from tdint_cli.commands.examples import command

COLUMNS = (
    "example,method,variant,dt_s,displacement_m_error,velocity_m_s_error,acceleration_m_s2_error,"
    "finer_displacement_m_error,finer_velocity_m_s_error,finer_acceleration_m_s2_error,rank,outcome"
)
FIGURES = {1: (7, 8), 2: (10, 11, 12), 3: (14, 15, 16)}
FILES = {
    number: [
        f"example-{number}-errors.csv",
        f"example-{number}-errors.json",
        *(f"figure-{figure:02d}.png" for figure in figures),
    ]
    for number, figures in FIGURES.items()
}


@pytest.mark.parametrize("numbers", [(1, 2), pytest.param((), marks=pytest.mark.slow)], ids=["1-2", "all"])
def test_all_examples_with_their_figures(here, tdint, numbers):
    result = tdint("examples", *numbers, "-o", "paper")
    wanted = {number: FILES[number] for number in numbers or FILES}
    assert result.exit_code == 0
    assert result.stdout.splitlines()[0] == COLUMNS
    assert "nan" not in result.stdout
    table = rows(result.stdout)
    assert [row["example"] for row in table] == [str(number) for number in wanted for _ in range(10)]
    assert {row["dt_s"] for row in table} == {"0.02"}
    assert sorted(path.name for path in (here / "paper").iterdir()) == sorted(
        name for names in wanted.values() for name in names
    )
    for number, (name, _, *figures) in wanted.items():
        assert rows(here / "paper" / name) == [row for row in table if row["example"] == str(number)]
        assert all((here / "paper" / figure).read_bytes().startswith(b"\x89PNG") for figure in figures)
    assert "The paper: the proposed method errs least, the central difference most." in result.stderr
    assert "Its data stand in a drawing that we do not have" in " ".join(result.stderr.split())
    if not numbers:
        assert "The paper's exact motion, newmark-linear, dt 0.002 s, is off by 4.3e-05 m" in result.stderr


@pytest.mark.usefixtures("laid_out")
def test_the_figures_are_of_the_floors_and_quantities_of_the_paper(here, tdint, monkeypatch):
    """Titles and curves of what is drawn: no other floor, no velocity, no variant; errors as |u - u_exact|."""
    import numpy as np

    from tdint.output.figures import examples

    drawn = []
    draw = examples.example_picture

    def keep(*given, **named):
        drawn.append(draw(*given, **named))
        return drawn[-1]

    monkeypatch.setattr(examples, "example_picture", keep)
    assert tdint("examples", "2", "-o", "paper", "--reference", "finer").exit_code == 0
    titles = [" ".join(figure.get_suptitle().split()) for figure in drawn]  # however their lines are broken
    assert [title.rpartition(") ")[2] for title in titles] == [
        "displacement u, floor 1, dt 0.02 s",
        "displacement u, floor 2, dt 0.02 s",
        "|u - u_exact|, floor 2, dt 0.02 s; u_exact: rk5, dt 0.0025 s",
    ]
    assert [title.partition(":")[0] for title in titles] == ["Figure 10", "Figure 11", "Figure 12"]
    second, errors = ([line.get_ydata() for line in figure.axes[0].get_lines()] for figure in drawn[1:])
    exact, *methods, _ = second  # the last one marks the peak
    assert len(methods) == 7
    for found, error in zip(methods, errors, strict=False):
        assert np.array_equal(error, np.abs(found - exact))


@pytest.mark.usefixtures("laid_out")
def test_all_sixteen_figures(here, tdint, monkeypatch):
    """Those of methods and buildings, too: their titles, and that a building shows its masses and forces."""
    from tdint.output.figures import assessment, examples

    drawn = []
    for module, name in ((assessment, "accuracy_picture"), (assessment, "order_picture"), (examples, "row_picture")):
        draw = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *given, draw=draw: drawn.append(draw(*given)) or drawn[-1])
    tdint("examples", "2", "-o", "paper", "--figures", code=0)
    names = [path.name for path in sorted((here / "paper").iterdir()) if path.suffix == ".png"]
    assert names == [f"figure-{number:02d}.png" for number in (*range(1, 7), *range(9, 13))]
    titles = [figure.get_suptitle().partition(":")[0] for figure in drawn]
    assert titles == [f"Figure {number}" for number in (*range(1, 7), 9)]
    beta = drawn[2].axes[0].get_lines()
    assert [float(line.get_ydata().max()) > 1.0 + 1e-6 for line in beta[:5]] == [True, True, False, True, True]
    words = [text.get_text() for text in drawn[-1].axes[0].texts]
    assert {"10 kg", "8 kg", "150 cos 6t N", "100 sin 4t N"} <= set(words)


def test_figures_need_a_folder(tdint):
    assert tdint("examples", "1", "--figures").exit_code == 2


@pytest.mark.parametrize("reference", ["paper", "finer"])
def test_ranks(tdint, reference):
    table = rows(tdint("examples", "1", "--reference", reference).stdout)
    ranked = sorted((row for row in table if row["rank"]), key=lambda row: int(row["rank"]))
    assert [row["rank"] for row in ranked] == [str(place) for place in range(1, 8)]
    assert all(row["variant"] == "" for row in ranked)
    assert [row["method"].partition(":")[0] for row in ranked[:3]] == ["rk5", "impulse", "central-difference"]
    column = "displacement_m_error" if reference == "paper" else "finer_displacement_m_error"
    errors = [float(row[column]) for row in ranked]
    assert errors == sorted(errors)
    assert {row["variant"] for row in table if not row["rank"]} == {
        "start with u(-dt) = 0",
        "load linear between the steps",
        "load held over each step",
    }


def test_chosen_methods_and_steps(tdint):
    result = tdint("examples", "2", "1", "1", "--method", "bathe", "--dt", "0.05", "--dt", "0.04")
    table = rows(result.stdout)
    assert [(row["example"], row["dt_s"]) for row in table] == [
        ("1", "0.05"), ("1", "0.04"), ("2", "0.05"), ("2", "0.04"),
    ]  # fmt: skip
    assert "The paper:" not in result.stderr


def test_a_run_without_an_end_leaves_its_cells_empty_and_a_picture_out(here, tdint):
    result = tdint("examples", "2", "--method", "exact", "--dt", "0.02", "-o", "out", code=0)
    (row,) = rows(result.stdout)
    assert (row["outcome"], row["displacement_m_error"], row["rank"]) == ("refused", "", "")
    assert "exact has no result: refused" in result.stderr
    left = sorted(path.name for path in (here / "out").iterdir())
    assert left == ["example-2-errors.csv", "example-2-errors.json"]


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["4"], 2, "Invalid value"),
        (["--dt", "1"], 2, "Invalid value for '--dt'"),
        (["--dt", "nan"], 2, "Invalid value for '--dt'"),
        (["--method", "newmrk"], 2, "did you mean 'newmark'?"),
        (["--reference", "exact"], 2, "Invalid value for '--reference'"),
        (["-o", ""], 2, "-o is empty"),
    ],
)
def test_what_is_refused(here, tdint, arguments, code, message):
    tdint.refused(message, "examples", *arguments, code=code)
    assert not list(here.iterdir())


def test_the_help_names_the_steps():
    from tdint.analysis.assessment.paper_examples import DT

    option = next(parameter for parameter in command.params if parameter.name == "dts")
    assert f"the paper's {DT:g} if there is none" in option.help
