"""`tdint failures`: rows, messages, figure, exit codes."""

import pytest

from csv_rows import rows
from tdint.assessment.failures.failures import problems, usual_methods
from tdint_cli.assessment.failures import command


@pytest.mark.parametrize(
    "named",
    ["large-step", pytest.param("", marks=pytest.mark.slow)],
    ids=["one problem", "all problems"],
)
def test_problems_with_the_usual_methods(working_directory, tdint, named, drawn):
    options = ("--problem", named) if named else ()
    result = tdint("failures", "--plot", "who.png", "-o", "who.csv", *options, code=0)
    text = (working_directory / "who.csv").read_text()
    assert result.stdout == ""
    table = rows(text)
    assert "nan" not in text and "inf," not in text
    selected = {name: problem for name, problem in problems().items() if name == (named or name)}
    assert list(dict.fromkeys(row["problem"] for row in table)) == list(selected)
    labels = [integrator.label for integrator in usual_methods()]
    assert {"impulse4:rho_inf=0", "wilson:theta=1.3", "chang"} < set(labels)
    assert len(table) == len(labels) * sum(len(problem.steps) for problem in selected.values())
    assert (working_directory / "who.png").read_bytes().startswith(b"\x89PNG")
    lines = result.stderr.splitlines()
    assert lines[1].split()[:2] == ["method", "pass"]
    assert [line.split()[0] for line in lines[2:]] == labels


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--problem", "hardning"], 2, "'hardning'; did you mean 'hardening'? (known: hardening, "),
        (["--problem", "x"], 2, "unknown problem 'x' (known: "),
        (["--method", "newmrk"], 2, "did you mean 'newmark'?"),
        (["--plot", "x.jpg"], 2, "got .jpg"),
    ],
)
def test_invalid_arguments_are_refused(working_directory, tdint, arguments, code, message):
    tdint.refused(message, "failures", *arguments, code=code)


def test_the_help_contains_all_problems():
    option = next(parameter for parameter in command.params if parameter.name == "problems")
    assert option.help.endswith(f": {', '.join(problems())}; all by default.")
