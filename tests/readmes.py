"""Write the generated parts of all READMEs again; tests/documentation compares them.

    python tests/readmes.py            write the generated parts and execute the sessions
    python tests/readmes.py --parts    write only the generated parts

A generated part is between the lines `<!-- generated: NAME -->` and `<!-- end: NAME -->`. A session
is the block after the line `<!-- session -->`; it contains commands and their output. The names of
changed pages are printed.
"""

import argparse
import ast
import csv
import importlib.util
import math
import os
import re
import subprocess
import sys
import tomllib
from contextlib import contextmanager
from functools import partial
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from tempfile import TemporaryDirectory

import reference_tables
from benchmarks import measured
from tdint import assessment, make_record, plugin, prepare, studies
from tdint.assessment import tables as examples
from tdint.assessment.failures.failures import HardProblem, problems
from tdint.kernels.laws.law import DriftLaw, LawParameter
from tdint.methods.catalogue import catalogue, parse
from tdint.methods.method import Integrator
from tdint.model.damage_states import STATES, DamageStates
from tdint.model.story_laws import LAWS
from tdint.output.tables import (
    buildings,
    devices,
    directions,
    elements,
    histories,
    matrices,
    methods,
    responses,
    spectra,
    transfer,
)
from tdint.output.tables import table as shared
from tdint.output.tables.columns import declared
from tdint.output.tables.runs import BUILDING_COLUMNS
from tdint.output.tables.table import columns_of
from tdint.response.runs.compiled_steps import unsupported_reason
from tdint.response.runs.error_estimate import reference_method, reference_steps
from tdint.response.spectra.drift import DriftSpectrum
from tdint.response.spectra.elastic import Spectrum
from tdint.response.spectra.inelastic import InelasticSpectrum
from tdint.response.time_steps import Steps
from tdint.studies.campaign import campaign_tables as campaign
from tdint.studies.fragility import damage_tables as damage_states
from tdint.studies.fragility import fragility_tables as functions
from tdint.studies.fragility.measures import run_measure
from tdint.studies.recordings import comparison_tables as comparison
from tdint.studies.store.schema import PART_TABLES
from tdint_cli.main import GROUPS

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
FOLDERS = ("cli", "configs", "records", "src", "tests")


def files():
    """Return the READMEs and the glossary."""
    return [README, *(path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.md")))]


def program(name):
    """Return a program in the .github directory as a module."""
    specification = importlib.util.spec_from_file_location(name, ROOT / ".github" / f"{name}.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def _number(value):
    return "" if math.isnan(value) else "none" if math.isinf(value) else f"{value:.4g}"


def _parameters(integrator: Integrator):
    pairs = zip(integrator.method.parameters, integrator.values, strict=True)
    return ", ".join(f"{parameter.name}={value:.6g}" for parameter, value in pairs)


def method_table():
    """Return the catalogue as a table, with the numbers of the default parameters."""
    rows = [
        "| method | parameters | order | largest stable omega dt | rho_inf | source |",
        "|---|---|---|---|---|---|",
    ]
    for name in catalogue():
        method = parse(name)
        limit, rho = _number(method.stability_limit), _number(method.rho_inf)
        cells = (f"`{name}`", _parameters(method), method.order, limit, rho, method.method.source)
        rows.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(rows) + "\n"


def _dimension(parameter: LawParameter):
    """Return the dimension of a parameter as text, such as force/length; empty without one."""
    if parameter.many:
        return "a list: force/length, force/length^2, ..."
    if parameter.points:
        return f"{parameter.point_count_text} [length, force]"
    if parameter.choices:
        return " \\| ".join(parameter.choices)
    powers = {"force": parameter.force, "length": parameter.length}
    above, below = (
        [
            name if power == sign else f"{name}^{power * sign:g}"
            for name, power in powers.items()
            if power * sign > 0
        ]
        for sign in (1, -1)
    )
    return (
        (above[0] if above else "1") + "".join(f"/{name}" for name in below)
        if above or below
        else ""
    )


def _range(parameter: LawParameter):
    """Return the range of a parameter as text, such as > 0 or [0, 1)."""
    low, high = parameter.low, parameter.high
    if math.isinf(low) and math.isinf(high):
        return ""
    if math.isinf(high):
        return f"{'>=' if parameter.low_allowed else '>'} {low:g}"
    return (
        f"{'[' if parameter.low_allowed else '('}{low:g}, "
        f"{high:g}{']' if parameter.high_allowed else ')'}"
    )


def _key(law: DriftLaw, parameter: LawParameter):
    """Return the key of a parameter of a law, or of its group, and the text on it."""
    if parameter.group:
        members = ", ".join(
            f"`{member.name}`" for member in law.parameters if member.group == parameter.group
        )
        needed = parameter.default is None and parameter.without is None
        about = (
            (f"a number ({_dimension(parameter)}) for all of " if parameter.shared else "")
            + members
            + ("" if needed else "; optional")
        )
        return f"`{parameter.group}`", about
    default = (
        ""
        if parameter.default is None or parameter.points
        else f"default `{parameter.default}`"
        if isinstance(parameter.default, str)
        else f"default {parameter.default:g}"
    )
    about = ", ".join(filter(None, (_dimension(parameter), _range(parameter), default)))
    return f"`{parameter.name}`", about


def law_table():
    """Return the drift laws as a table with formulas, and keys with dimension and range."""
    rows = ["| law | restoring force | keys |", "|---|---|---|"]
    for law in LAWS.values():
        keys = dict.fromkeys(_key(law, parameter) for parameter in law.parameters)
        joined = [
            ", ".join(name for name, _ in same) + f" ({about})" * bool(about)
            for about, same in groupby(keys, key=itemgetter(1))
        ]
        formula = law.formula.replace("|", "\\|")
        rows.append(f"| `{law.name}` | {formula} | {', '.join(joined)} |")
    return "\n".join(rows) + "\n"


def model_table():
    """Return a list of the models of configs with the first clause of their comments."""
    rows = []
    for path in sorted((ROOT / "configs").glob("*.yaml")):
        comment = "\n".join(
            line[1:].strip() for line in path.read_text().partition("\n\n")[0].splitlines()
        )
        text, _, remainder = comment.partition("\n\n")
        assert re.search(r"^Shows: ", remainder, re.MULTILINE), (
            f"{path.name} does not say what it shows"
        )
        text = re.split(r"[:;]|\. ", " ".join(text.split()), maxsplit=1)[0].rstrip(".")
        rows.append(f"- [`{path.stem}`]({path.name}): {text}")
    return "\n".join(rows) + "\n"


def _bound(problem: HardProblem):
    """Return the limits of a run with the verdict `pass`; the table of `tdint failures` states the
    type of error."""
    low = max(fault.low for fault in problem.faults)
    high = min(fault.high for fault in problem.faults)
    if problem.by_energy:
        return f"energy ratio from {low:g} to {high:g}"
    return f"error at most {high:g}"


def problem_table():
    """Return the table of the problems on which methods fail, with their criteria; `tdint.response`
    lists the sources."""
    rows = ["| problem | description | passes with |", "|---|---|---|"]
    for problem in problems().values():
        rows.append(f"| `{problem.name}` | {problem.about} | {_bound(problem)} |")
    return "\n".join(rows) + "\n"


def _first_sentence(path: Path):
    """Return the first sentence of the docstring of a module."""
    text = ast.get_docstring(ast.parse(path.read_text())) or ""
    return (
        " ".join(re.split(r"\.\s|\n\n", text, maxsplit=1)[0].split())
        .rstrip(".")
        .replace("|", "\\|")
    )


def layer_table():
    """Return the table of the layers from top to bottom, as in the import contract, with the first
    sentences of the packages; the modules at the bottom, which explain themselves, in one row."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"][
        "contracts"
    ]
    rows, ground = ["| layer | description |", "|---|---|"], []
    layers = next(contract["layers"] for contract in contracts if contract["type"] == "layers")
    for layer in " | ".join(layers).split(" | "):
        name = layer.strip("()").replace(".", "/")
        package = ROOT / ("src" if name.startswith("tdint/") else "cli") / name / "__init__.py"
        shown = f"`{name.removeprefix('tdint/')}`"
        if package.is_file():
            rows.append(f"| {shown} | {_first_sentence(package)} |")
        else:
            ground.append(shown)
    rows.append(f"| {', '.join(ground)} | modules without knowledge of buildings |")
    return "\n".join(rows) + "\n"


def command_list():
    """Return a line per command, in the groups of the help."""
    parts = []
    for group, commands in GROUPS.items():
        lines = [
            f"- `tdint {name}`: {description[0].lower()}{description[1:]}"
            for name, description in commands.items()
        ]
        parts.append("\n".join([f"**{group}**", "", *lines, ""]))
    return "\n".join(parts)


MEASURES = ("pgv", "arias", "cav", "cav5", "d5-95", "sa:0.5", "sa-avg", "sdi:T1:0.1")


def columns():
    """Return the columns of every table, by command."""
    return {
        "tdint run": (*responses.STORY_COLUMNS, responses.ENERGY),
        "stories.csv of tdint run, two directions": (directions.DIRECTION,),
        "resultants.csv of tdint run": (
            *directions.RESULTANT_COLUMNS,
            *directions.RESULTANT_ERROR,
        ),
        "elements.csv of tdint run": (*elements.ELEMENT_COLUMNS, *elements.ELEMENT_ERROR),
        **{
            f"{kind}.csv of tdint run": (*shown, *errors)
            for kind, (shown, errors) in zip(("attachments", "links"), devices.TABLES, strict=True)
        },
        "contacts.csv of tdint run": (*devices.CONTACT_COLUMNS, *devices.CONTACT_ERROR),
        "rows.csv of tdint run": (matrices.ROW_NAME, *matrices.ROW_COLUMNS, *matrices.ROW_ERROR),
        "stories.csv of tdint run, flexural": (
            *(*responses.STORY_COLUMNS, *responses.STORY_ERROR),
            *(*matrices.FLEXURE_COLUMNS, *matrices.FLEXURE_ERROR),
        ),
        "history.csv of tdint run": histories.HistoryLayout(1, error=True).columns,
        "floor-spectra.csv of tdint run": (shared.FLOOR, *spectra.SPECTRUM),
        "tdint check": buildings.OVERVIEW,
        "tdint modes": (*buildings.MODE, buildings.mode_damping(None), *buildings.MODE_END),
        "tdint modes --target": buildings.MODAL_RESPONSE,
        "tdint modes --transfer": transfer.transfer_columns([1], "ground"),
        "tdint law": buildings.CYCLIC,
        "tdint law --list": declared("laws.law"),
        "tdint pushover": buildings.pushover(1),
        "tdint pushover --target": buildings.TARGET_DISPLACEMENT,
        "tdint compare": comparison.COMPARISON,
        "spectra.csv of tdint compare": comparison.COMPARISON_SPECTRA,
        "tdint inventory": buildings.INVENTORY,
        "tdint inventory --rules capacity": buildings.CLASS_COLUMNS,
        "tdint info": spectra.INFO,
        "tdint spectrum": (
            *shared.RECORD_COLUMNS,
            *columns_of(Spectrum, "maxima", "interpolation"),
        ),
        "tdint spectrum --against": (*shared.RECORD_COLUMNS, *spectra.difference("psa_m_s2")),
        "tdint spectrum --target": spectra.TARGET,
        "tdint spectrum --rotd 50,100": (
            *spectra.MOTION_COLUMNS,
            *spectra.rotated((50, 100)),
            *columns_of(Spectrum, "maxima", "interpolation")[-2:],
        ),
        "tdint spectrum --ductility": (*shared.RECORD_COLUMNS, *columns_of(InelasticSpectrum)),
        "tdint drift-spectrum": (*shared.RECORD_COLUMNS, *columns_of(DriftSpectrum)),
        "tdint run --scale 1,2": campaign.RUNS,
        "runs.csv of tdint campaign": campaign.RUNS,
        **{
            f"{name} of tdint campaign": (*BUILDING_COLUMNS, *table.shown)
            for name, table in PART_TABLES.items()
        },
        "profiles.csv of tdint campaign": campaign.PROFILES,
        "ratios.csv of tdint campaign": campaign.RATIOS,
        "damage.csv of tdint campaign": damage_states.damage_columns(
            DamageStates("drift_ratio", STATES, (0.01, 0.02, 0.03, 0.04), 0.0, (1.0,) * 5)
        ),
        "damage-types.csv of tdint campaign": damage_states.TYPES,
        "losses.csv of tdint campaign": damage_states.LOSSES,
        "floor-spectra-mean.csv of tdint campaign": campaign.FLOOR_SUITES,
        "measures.csv of tdint campaign": campaign.measure_columns(
            list(map(run_measure, MEASURES))
        ),
        "tdint scale": studies.scaling_tables.FACTORS,
        "tdint ida": studies.ida_tables.CAPACITIES,
        "ida.csv of tdint ida": studies.ida_tables.IDA,
        "fractiles.csv of tdint ida": studies.ida_tables.FRACTILES,
        "margin.csv of tdint ida": studies.ida_tables.MARGIN,
        "tdint fragility": (
            *functions.FRAGILITY,
            functions.FRAGILITY_TOTAL,
            *functions.RISK,
            *functions.RISK_TOTAL,
        ),
        "FILE-bins.csv of tdint fragility": (functions.FRAGILITY[0], *functions.COUNTED),
        "tdint fragility --im sa,pga": functions.COMPARED,
        "tdint methods": methods.METHOD,
        "tdint stability": assessment.tables.STABILITY,
        "tdint overshoot": assessment.tables.OVERSHOOT,
        "tdint order": assessment.tables.ORDER,
        "tdint failures": assessment.tables.FAILURE,
        "tdint examples": (
            *examples.EXAMPLE,
            examples.rank(lambda run: None),
            examples.OUTCOME,
        ),
        "tdint chart": (
            assessment.tables.CHART_STORIES,
            *assessment.tables.CHART,
        ),
    }


def further_columns():
    """Return the declared columns that no table of `columns` has, by the kind of their table: they
    depend on options and inputs."""
    listed = {column.name for group in columns().values() for column in group}
    further = {}
    for folder in ("src/tdint/studies", "src/tdint/output/tables"):
        with (ROOT / folder / "columns.csv").open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                if row["name"] not in listed and "{" not in row["name"]:
                    name = f"Further columns of {row['table'].split('.')[0]}"
                    column = shared.Column(row["name"], row["unit"], "", row["meaning"])
                    if column not in further.setdefault(name, []):
                        further[name].append(column)
    return further


def column_tables():
    """Return a section with the columns of each table; a column that an earlier table has in the
    same meaning is only named."""
    groups = columns() | further_columns()
    return reference_tables.column_pages(groups)


_YIELDING = {"type": "bilinear", "yield_force": 1e4, "hardening": 0.05}
_KINDS = {
    "linear": {"stiffness": 1e6},
    "branches (`bilinear`, `multilinear`, ...)": {"stiffness": 1e6, "law": _YIELDING},
    "curved (`tanh`, `polynomial`)": {"stiffness": 1e6, "law": {"type": "tanh", "strength": 1e4}},
    "stops (`gap`, `hertz`)": {
        "elements": [
            {"type": "linear", "stiffness": 1e6},
            {"type": "gap", "gap": 0.01, "stop_stiffness": 1e7},
        ]
    },
    "power-law dashpots": {
        "stiffness": 1e6, "law": _YIELDING,
        "dashpot": {"coefficient": 1e3, "exponent": 0.5, "linear_below": 1e-3},
    },
    "dashpots with braces": {
        "stiffness": 1e6, "law": _YIELDING, "dashpot": {"coefficient": 1e3, "brace": 1e6}
    },
}  # fmt: skip
"""A story of each kind of building whose errors are estimated in another way."""


def estimate_table():
    """Return the table of additional runs by kind of building and method, with the number of their
    steps in a step of one, two and five sampling intervals."""
    methods = ("newmark-average", "impulse4", "moment4", "gauss4", "exact")
    record = make_record([0.0] * 101, dt=0.01, units="m/s^2")
    lines = [f"| building | {' | '.join(f'`{name}`' for name in methods)} |", "|---" * 6 + "|"]
    for kind, story in _KINDS.items():
        model = {"stories": [{"mass": 1e3, "height": 3.0, **story}], "damping": "5%"}
        cells = [_additional_run(model, record, name) for name in methods]
        lines.append(f"| {kind} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _additional_run(model, record, name):
    """Return the cell of a method: the method of the additional run and its steps in a step; empty
    if the method does not support the building."""
    case = prepare(model, record, method=name)
    if unsupported_reason(case.method, case.building):
        return ""
    parts = [
        reference_steps(case, Steps(stride * record.dt, 20, stride=stride)) for stride in (1, 2, 5)
    ]
    counts = ", ".join(
        str(round(stride * record.dt / steps.h))
        for stride, steps in zip((1, 2, 5), parts, strict=True)
    )
    return f"`{reference_method(case).label}`: {counts}"


def plugin_names():
    """Return the names of `tdint.plugin` by module, with the first sentence of the module."""
    groups = {}
    for name, home in plugin.PLUGIN.items():
        groups.setdefault(home, []).append(name)
    lines = [
        f"- {_first_sentence(ROOT / 'src' / (home.replace('.', '/') + '.py')).rstrip(':')}: "
        + ", ".join(f"`{name}`" for name in names)
        for home, names in groups.items()
    ]
    return "\n".join([*lines, ""])


PARTS = {
    "columns": column_tables, "commands": command_list, "estimates": estimate_table,
    "features": reference_tables.feature_table, "layers": layer_table, "laws": law_table,
    "measured": measured.measured_table,
    "methods": method_table, "models": model_table, "outputs": reference_tables.output_table,
    "plugin": plugin_names,
    "problems": problem_table,
    "reliability": partial(measured.reliability_table, "reliability"),
    "separate_solver": partial(measured.reliability_table, "separate-solver"),
    "without_record": measured.without_record_table, "units": reference_tables.unit_table,
}  # fmt: skip
"""What each generated part is made by; a part stands in one file."""


def generated(text):
    """Return the text of a README with its generated parts written again."""
    for name in re.findall(r"^<!-- generated: (\w+) -->$", text, re.MULTILINE):
        begin, end = f"<!-- generated: {name} -->\n", f"<!-- end: {name} -->\n"
        head, _, remainder = text.partition(begin)
        assert end in remainder, f"the part {name} has no end"
        text = f"{head}{begin}\n{PARTS[name]()}\n{end}{remainder.partition(end)[2]}"
    return text


def _unique(pattern):
    """Return the content of the only match of a pattern in all READMEs."""
    found = [
        match
        for path in files()
        for match in re.findall(pattern, path.read_text(), re.DOTALL | re.MULTILINE)
    ]
    assert len(found) == 1, f"{len(found)} places match {pattern!r}"
    return found[0]


def block(name):
    """Return the code block after the line `<!-- test: KIND -->` in any README."""
    return _unique(rf"^<!-- test: {name} -->\n```\w+\n(.*?)^```")


def digest(name):
    """Return the text between `<!-- digest: NAME -->` and `<!-- end: digest NAME -->`, whose
    numbers tests compare."""
    return _unique(rf"^<!-- digest: {name} -->\n(.*?)^<!-- end: digest {name} -->")


# ---- Sessions: commands and their output


@contextmanager
def checkout():
    """Provide a directory similar to a checkout, with the models of the READMEs, and an environment
    that finds tdint."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        for part in ("configs", "records"):
            (folder / part).mkdir()
            for source in (ROOT / part).iterdir():
                # directory of a program next to the records, which tests import
                if source.name != "__pycache__":
                    (folder / part / source.name).symlink_to(source)
        studies = ("campaign", "drift-check", "retrofit", "region", "fields", "exposure")
        for shown in ("workshop", "recorded", *studies):
            (folder / f"{shown}.yaml").write_text(block(shown))
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        yield folder, {**os.environ, "PATH": path}


def shell(script, folder, environment):
    """Return exit code, output and messages of a shell script, without the note on the first
    compilation."""
    done = subprocess.run(
        ["bash", "-eu", "-c", script], cwd=folder, env=environment, capture_output=True, text=True
    )
    messages = [
        line
        for line in done.stderr.splitlines(keepends=True)
        if not line.startswith("note: compiling")
    ]
    return done.returncode, done.stdout, "".join(messages)


_SESSION = re.compile(r"(^<!-- session -->\n```console\n)(.*?)(^```)", re.DOTALL | re.MULTILINE)


def sessions(text):
    """Return the sessions of a README: lists of commands with their outputs."""
    return [
        re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", inside, re.MULTILINE)
        for _, inside, _ in _SESSION.findall(text)
    ]


_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_TIME = re.compile(r"[\d.e-]+ (us|ms|s)\b(?= per step)")


def same(printed, shown):
    """Return True if two outputs agree except for times, the last digit, and rounding that depends
    on the machine: 1e-4 relative, 1e-14 absolute."""
    printed, shown = (_TIME.sub("", text) for text in (printed, shown))
    if _NUMBER.sub("#", printed) != _NUMBER.sub("#", shown):
        return False
    pairs = zip(_NUMBER.findall(printed), _NUMBER.findall(shown), strict=True)
    return all(
        math.isclose(
            float(first_number), float(second_number), rel_tol=_open(second_number), abs_tol=1e-14
        )
        for first_number, second_number in pairs
    )


def _open(number):
    """Return the relative precision of the digits of a number, at least 1e-4, because estimated
    errors are differences of nearby numbers."""
    digits = len(re.sub(r"e.*|\.|^[-+]?0*\.?0*", "", number))
    return max(1.01 * 10.0 ** (1 - digits), 1e-4) if "." in number else 1e-9


def played(text):
    """Return the text of a README with its sessions executed again: each command with its output,
    followed by its messages."""

    def play(match):
        """Return the text of a session with its present output."""
        lines = []
        with checkout() as (folder, environment):
            for command, shown in sessions(match[0])[0]:
                code, output, messages = shell(command, folder, environment)
                assert code == 0, messages
                lines.append(
                    f"$ {command}\n{shown if same(output + messages, shown) else output + messages}"
                )
        return match[1] + "".join(lines) + match[3]

    return _SESSION.sub(play, text)


def main() -> None:
    """Write the pages that have changed, and print their names."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--parts", action="store_true", help="leave the sessions as they are")
    only_parts = parser.parse_args().parts
    for readme in files():
        text = readme.read_text()
        new_text = generated(text) if only_parts else played(generated(text))
        if new_text != text:
            readme.write_text(new_text)
            print(readme.relative_to(ROOT))


if __name__ == "__main__":
    main()
