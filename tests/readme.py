"""The generated parts of README.md: python tests/readme.py writes them anew, tests/test_readme.py compares them.

A part stands between its line `<!-- generated: NAME -->` and the line `<!-- end: NAME -->`.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

from click.testing import CliRunner

from tdint.analysis.assessment.hard_problems import HardProblem, problems
from tdint.methods.catalogue import catalogue, parse
from tdint.methods.method import Integrator
from tdint.model.laws import LAWS
from tdint_cli.main import COMMANDS, cli

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"


def help_text():
    """The help of every command."""
    parts = []
    for name in COMMANDS:
        result = CliRunner().invoke(cli, [name, "--help"], prog_name="tdint", terminal_width=100)
        assert result.exit_code == 0, result.output
        parts.append(f"### tdint {name}\n\n```\n{result.output.rstrip()}\n```\n")
    return "\n".join(parts)


def _number(value):
    return "" if math.isnan(value) else "none" if math.isinf(value) else f"{value:.4g}"


def _parameters(integrator: Integrator):
    pairs = zip(integrator.method.parameters, integrator.values, strict=True)
    return ", ".join(f"{parameter.name} = {value:.6g} in {parameter.range}" for parameter, value in pairs)


def method_table():
    """The catalogue as a table; numbers at the defaults."""
    rows = ["| method | parameters | order | implicit | largest stable omega dt | rho at infinity | source |"]
    rows.append("|---|---|---|---|---|---|---|")
    for name in catalogue():
        method = parse(name)
        implicit = "yes" if method.implicit else "no"
        limit, rho = _number(method.stability_limit), _number(method.rho_inf)
        cells = (f"`{name}`", _parameters(method), method.order, implicit, limit, rho, method.method.source)
        rows.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(rows) + "\n"


def law_table():
    """The drift laws as a table."""
    rows = ["| law | restoring force | parameters |", "|---|---|---|"]
    for law in LAWS.values():
        names = ", ".join(f"`{parameter.name}`" + (" (a list)" * parameter.many) for parameter in law.parameters)
        formula = law.formula.replace("|", "\\|")
        rows.append(f"| `{law.name}` | {formula} | {names} |")
    return "\n".join(rows) + "\n"


def _bound(problem: HardProblem):
    """What a run has to keep to for the verdict `pass`."""
    low = max(fault.low for fault in problem.faults)
    high = min(fault.high for fault in problem.faults)
    return f"energy ratio from {low:g} to {high:g}" if problem.by_energy else f"{problem.error_of}: at most {high:g}"


def problem_table():
    """The problems on which methods fail, and what they are judged by."""
    rows = ["| problem | what it is | dt (s) | passes with | source |", "|---|---|---|---|---|"]
    for problem in problems().values():
        steps = ", ".join(f"{dt:.4g}" for dt, _ in problem.steps)
        rows.append(f"| `{problem.name}` | {problem.about} | {steps} | {_bound(problem)} | {problem.source} |")
    return "\n".join(rows) + "\n"


PARTS = {"laws": law_table, "problems": problem_table, "methods": method_table, "help": help_text}


def generated(text):
    """README's text with its generated parts made anew."""
    for name, make in PARTS.items():
        begin, end = f"<!-- generated: {name} -->\n", f"<!-- end: {name} -->\n"
        head, _, rest = text.partition(begin)
        assert rest, f"README.md has no part {name}"
        tail = rest.partition(end)[2] if end in rest else rest
        text = f"{head}{begin}\n{make()}\n{end}{tail}"
    return text


def block(kind):
    """The code block behind the line `<!-- test: KIND -->`."""
    found = re.search(rf"<!-- test: {kind} -->\n```\w+\n(.*?)```", README.read_text(), re.DOTALL)
    assert found, f"README.md has no block {kind}"
    return found[1]


if __name__ == "__main__":
    README.write_text(generated(README.read_text()))
