"""Lists and numbers of pages that should be complete, and facts that several files state."""

import csv
import json
import re
import tomllib

import click
import pytest

import readmes
import tdint
from benchmarks import measured
from grid.axes import AXES
from readmes import ROOT
from tdint.assessment.examples.paper_examples import examples
from tdint.errors import AnalysisError, ModelError, OutputError, RecordError, UsageError
from tdint.kernels.laws import multilinear
from tdint.methods.catalogue import catalogue
from tdint.model.damage_states import STATES
from tdint.model.status import FALLEN, NO_RESULT
from tdint.response.spectra import target
from tdint.response.spectra.elastic import MAXIMA
from tdint.response.spectra.target import CODES
from tdint.studies.motions.intensity import PAIRS
from tdint.studies.motions.scaling import RULES
from tdint_cli.main import COMMANDS, cli


def page(name):
    """Return the text of a page with single spaces in each line."""
    return (ROOT / name).read_text(encoding="utf-8")


def names(text):
    """Return the words of a text that can be names of files, options, keys or commands."""
    return set(re.findall(r"-{0,2}\w[\w.-]*\w|\w", text))


def part(name, begin, end):
    """Return the part of a page between two texts, each of which is on it once."""
    _, found, rest = page(name).partition(begin)
    assert found, f"{name}: {begin!r} is not on the page"
    return rest.partition(end)[0]


def commands_with(option):
    """Return the commands that have an option."""
    context = click.Context(cli)
    found = (cli.get_command(context, name) for name in COMMANDS)
    return {command.name for command in found if any(option in p.opts for p in command.params)}


def choices(command, option):
    """Return the values of an option of a command."""
    parameters = cli.get_command(click.Context(cli), command).params
    return set(next(p.type.choices for p in parameters if option in p.opts))


def modules(folder):
    """Return the names of the modules in a directory of the package."""
    files = (ROOT / "src/tdint" / folder).glob("*.py")
    return {file.name for file in files if file.name != "__init__.py"}


def measures(*kinds):
    """Return the measures of ground motions whose power is one of `kinds`."""
    with (ROOT / "src/tdint/ground_motion/measures.csv").open(encoding="utf-8") as file:
        return {row["name"] for row in csv.DictReader(file) if row["power"] in kinds}


def variables():
    """Return the environment variables that the program reads for its users."""
    sources = (path for folder in ("src", "cli") for path in (ROOT / folder).rglob("*.py"))
    found = re.findall(r"\"(TDINT_[A-Z_]+)\"", "".join(path.read_text("utf-8") for path in sources))
    return set(found) - {"TDINT_KERNELS_FORM", "TDINT_KERNELS_TARGETS"}  # of processes that compile


def keys_of_campaigns(*sections):
    """Return the keys of sections of a campaign file."""
    with (ROOT / "src/tdint/studies/keys.csv").open(encoding="utf-8") as file:
        return {row["name"] for row in csv.DictReader(file) if row["section"] in sections}


RECORDS = "records/README.md"
CLI, STUDIES = "cli/README.md", "src/tdint/studies/README.md"
KERNELS, SPECTRA = "src/tdint/kernels/README.md", "src/tdint/response/spectra/README.md"
IMS = {"sa", "sa-avg"}
EQUAL = {
    "commands with --report": lambda: (
        names(re.search(r"SHA-256\. (`run`.*?) have this", page(CLI), re.S)[1]) - {"and"},
        commands_with("--report"),
    ),
    "commands with --set": lambda: (
        names(re.search(r"`--set KEY=VALUE` \((.*?)\)", page(CLI))[1]),
        commands_with("--set"),
    ),
    "commands with options of text tables": lambda: (
        names(re.search(r"Only (.*?) have the", page(RECORDS))[1]) - {"and"},
        commands_with("--highpass"),
    ),
    "statuses of a run": lambda: (
        set(re.findall(r"^\| `([\w-]+)` \|", part(CLI, "## How a run ends", "In Python"), re.M)),
        {"done", *FALLEN, *NO_RESULT},
    ),
    "exit codes": lambda: (
        {int(code) for code in re.findall(r"^\| (\d) \|", part(CLI, "### Exit codes", "##"), re.M)},
        {0, 1}
        | {
            error.exit_code
            for error in (UsageError, ModelError, RecordError, AnalysisError, OutputError)
        },
    ),
    "environment variables": lambda: (
        set(re.findall(r"^\| `(TDINT_\w+)` \|", page(CLI), re.M)),
        variables(),
    ),
    "rules of multilinear": lambda: (
        set(re.findall(r"^\| `(\w+)` \|", part("configs/LAWS.md", "| rule |", "<!--"), re.M)),
        set(multilinear._RULES),
    ),
    "maxima and interpolations": lambda: (
        set(re.findall(r"^\| `--(?:maxima|interpolation) ([\w-]+)` \|", page(SPECTRA), re.M)),
        (set(MAXIMA) | choices("spectrum", "--interpolation")) - {"exact", "linear"},
    ),
    "values of --axes": lambda: (
        set(re.findall(r"`--axes (\w+)`", page(SPECTRA))),
        choices("spectrum", "--axes") - {"periods"},
    ),
    "baselines": lambda: (
        set(re.findall(r"`(?:--baseline )?(\w+)`", part(RECORDS, "| `--trim", "removes"))),
        choices("run", "--baseline"),
    ),
    "fits": lambda: (
        set(re.findall(r"^\| `(\w+)` \|", part(STUDIES, "| `--fit` |", "- The default"), re.M)),
        choices("fragility", "--fit"),
    ),
    "measures of ida": lambda: (
        set(re.findall(r"`([a-z-]+)`", part(STUDIES, "`measure` of a campaign:", "\n\n")))
        & (measures("1", "2") | IMS | {"cav5"}),
        measures("1", "2") | IMS,
    ),
    "values of --to": lambda: (
        set(re.findall(r"`--to ([a-z-]+)=", part(STUDIES, "| | factors |", "| `--target"))),
        measures("1", "2") | IMS,
    ),
    "measures of campaign --im": lambda: (
        names(" ".join(re.findall(r"`([a-z\d-]+)[`:]", part(STUDIES, "with any of", "(periods")))),
        measures("", "0", "1", "2") | IMS,
    ),
    "design spectra": lambda: (
        set(re.findall(r"`([\w-]+):", part(STUDIES, "spectrum by name:", "### Spectra of"))),
        set(CODES) | set(target._MULTI_PERIOD),
    ),
    "pairs": lambda: (
        set(re.findall(r"(\w+)`", part(STUDIES, "their geometric mean; `--pairs", "selects"))),
        set(PAIRS) - {"geometric-mean"},
    ),
    "rules of scale": lambda: (
        set(re.findall(r"--rule (\w+)", part(STUDIES, "| | factors |", "To apply"))) | {"mean"},
        set(RULES),
    ),
    "damage states of a capacity curve": lambda: (
        len(part(STUDIES, "of the class's curve: ", ";").split(", ")),
        len(STATES),
    ),
    "tables of a campaign": lambda: (
        names(re.search(r"`outputs` \| a list of tables \((.*?)\)", page(STUDIES))[1]),
        {"runs", "damage", "losses", "stories", "profiles"},
    ),
}  # fmt: skip
"""By name: the names on a page, and those of the program. Both must be equal."""


@pytest.mark.parametrize("name", EQUAL)
def test_list_of_a_page_is_complete(name):
    of_page, of_program = EQUAL[name]()
    assert of_page == of_program


@pytest.mark.parametrize("folder", ["kernels", "kernels/laws"])
def test_modules_are_on_the_page_of_their_directory(folder):
    text = page(f"src/tdint/{folder}/README.md")
    laws = {file.removesuffix(".py").replace("_", "-") for file in modules(folder)}
    known = {file for file in laws if f"`{file}`" in text}
    missing = {f"{name}.py" for name in laws - known}
    missing = {name.replace("-", "_") for name in missing}
    assert {name for name in missing if name not in text} == set()


def test_optional_features_of_kernels_are_listed():
    """Each condition of `variant` has a name in the list of features behind FULL."""
    words = {
        "modal": "modal damping",
        "forces": "forces on floors",
        "power_damped": "dashpots of a power law",
        "has_damper_state": "braces, tangent damping",
        "elements": "elements",
        "branched": "attachments, links",
        "inertial": "inerters",
        "can_fracture": "fracture",
    }
    source = page("src/tdint/model/building.py")
    condition = source.partition("has_optional_features = (\n")[2].partition("\n    )\n")[0]
    found = set(re.findall(r"building\.(\w+)", condition)) | {"forces"} - set()
    assert found == set(words)
    listed = re.search(r"optional feature \((.*?)\)", " ".join(page(KERNELS).split()))[1]
    assert set(listed.split(", ")) == set(", ".join(words.values()).split(", "))


def text(number):
    """Return a number from ten to twenty as a word."""
    words = "ten eleven twelve thirteen fourteen fifteen sixteen seventeen eighteen nineteen twenty"
    return words.split()[number - 10]


def last_figure():
    """Return the number of the last figure of the paper that an example reproduces."""
    return max(figure.number for example in examples().values() for figure in example.figures)


COUNTS = {
    ("src/tdint/methods/README.md", r"\) of (\d+) problems"): lambda: rows("problems"),
    ("tests/benchmarks/README.md", r"^(\d+) problems, \d+ methods"): lambda: rows("problems"),
    ("src/tdint/methods/EQUATIONS.md", r"0.02 s and the (\w+) figures"): lambda: text(
        last_figure()
    ),
    ("CHANGELOG.md", r"(\d+) time-integration methods"): lambda: str(len(catalogue())),
    ("tests/MEASUREMENTS.md", r"all pairs of (\w+) properties"): lambda: text(len(AXES)),
}
"""Pages with the pattern of a number, and the number that the program gives."""


def rows(name):
    """Return the number of rows of a table of the benchmark."""
    with (ROOT / f"tests/benchmarks/{name}.csv").open(encoding="utf-8") as file:
        return str(sum(1 for _ in csv.DictReader(file)))


@pytest.mark.parametrize(("name", "pattern"), COUNTS)
def test_number_of_a_page_is_counted(name, pattern):
    (said,) = re.findall(pattern, page(name), re.M)
    assert said == COUNTS[name, pattern]()


def test_reliability_of_estimates_is_that_of_the_stored_table():
    """The numbers of tests/README.md are those of benchmarks/reliability.csv."""
    found = [row for row in measured.rows(measured.RELIABILITY) if row["table"] == "reliability"]
    short = [row for row in found if row["samples"] == measured.SHORT]
    said = re.search(
        r"In (\d+) random buildings, ([\d.]+) % of the errors of (\w+) methods exceed twice the "
        r"estimate, and ([\d.]+) %",
        " ".join(page("tests/README.md").split()),
    )
    assert f"{said[2]}/{said[4]}" == measured.share(short)
    assert said[1] == short[0]["confirmed"] and said[3] == "eight"
    assert len({row["method"] for row in short}) == 8


def test_sections_of_measurements_have_a_date():
    """Each section of MEASUREMENTS.md has a row in measured.csv, or a command of tests."""
    sections = re.split(r"(?m)^## ", page("tests/MEASUREMENTS.md"))[1:]
    dated = {row["section"] for row in measured.rows(measured.MEASURED)}
    titles = {section.partition("\n")[0]: section for section in sections}
    assert dated <= set(titles)
    undated = [text for title, text in titles.items() if title not in dated]
    assert all("`pytest " in text for text in undated)
    for row in measured.rows(measured.MEASURED):
        assert re.fullmatch(r"\d{4}-\d\d-\d\d", row["last_day"]) and row["commit"]
        assert re.fullmatch(r"[0-9a-f]{12}", row["kernels"])


def test_changed_kernels_mark_a_measurement():
    row = measured.rows(measured.MEASURED)[0]
    states = [
        measured.state(row | {"kernels": text}) for text in (measured.digest_of_all(), "0" * 12)
    ]
    assert states == ["no", "yes"]


# ---- Facts in several files


@pytest.fixture(scope="module")
def project():
    """The file pyproject.toml."""
    return tomllib.loads(page("pyproject.toml"))


def test_version_is_the_same_everywhere():
    for name, pattern in {
        "README.md": r"version = \{([\d.]+)\}",
        "CITATION.cff": r"(?m)^version: ([\d.]+)",
        "CHANGELOG.md": r"(?m)^## ([\d.]+)",
        ".github/codemeta.json": r'"version": "([\d.]+)"',
    }.items():
        assert re.search(pattern, page(name))[1] == tdint.__version__, name


def test_required_python_is_the_same_everywhere(project):
    required = project["project"]["requires-python"].removeprefix(">=")
    for name, pattern in {
        "README.md": r"Python ([\d.]+\d) or newer",
        ".github/CONTRIBUTING.md": r"Python ([\d.]+\d) or later",
        ".github/codemeta.json": r"Python >=([\d.]+)",
        ".github/conda/meta.yaml": r"python >=([\d.]+)",
    }.items():
        assert set(re.findall(pattern, page(name))) == {required}, name
    classifiers = re.findall(r"Python :: (3\.\d+)", "\n".join(project["project"]["classifiers"]))
    tested = re.findall(r'"(3\.\d+)"', re.search(r"python: \[.*", page(WORKFLOW))[0])
    assert classifiers[0] == required and set(classifiers) <= set(tested)


WORKFLOW = ".github/workflows/tests.yml"


def test_dependencies_are_the_same_everywhere(project):
    required = set(project["project"]["dependencies"])
    assert set(json.loads(page(".github/codemeta.json"))["softwareRequirements"]) == required
    line = re.search(r"(?m)^  run: \[(.*)\]", page(".github/conda/meta.yaml"))[1]
    conda = {item.replace(" ", "").replace("-base", "") for item in line.split(",")}
    assert conda - {f"python{project['project']['requires-python']}"} == required


def test_licence_and_title_are_the_same_everywhere(project):
    licence = project["project"]["license"].partition(" ")[0]
    for name in ("README.md", "CITATION.cff", ".github/codemeta.json", ".github/conda/meta.yaml"):
        assert set(re.findall(r"(?:BSD|MIT|Apache|GPL)-[\w.-]+", page(name))) == {licence}, name
    title = re.search(r'(?m)^title: "(.*)"', page("CITATION.cff"))[1]
    assert f"{{{{{title}}}}}" in page("README.md")


def test_statement_on_other_systems_is_the_same_everywhere():
    """README and paper agree on the wheels of macOS and Windows."""
    said = [
        re.search(r"Wheels for macOS and Windows are built, (.*?)\.", " ".join(page(name).split()))
        for name in ("README.md", ".github/paper/paper.md")
    ]
    assert all(match and "not" in match[1] and "test" in match[1] for match in said)


def test_there_is_one_stability_policy():
    texts = [path for path in readmes.files() if "## Stable interfaces" in path.read_text("utf-8")]
    assert texts == [ROOT / "src/README.md"]
    assert "## Stable interfaces" not in page(".github/CONTRIBUTING.md")
    assert page("CHANGELOG.md").count("(unreleased)") <= 1
