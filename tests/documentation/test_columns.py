"""The tables of cli/COLUMNS.md equal the columns of the tables."""

import ast
import csv
import functools
import io
import re

import pytest

import readmes
from selection import every
from separate_streams import runner
from tdint_cli.main import cli

OTHER_STORY = re.compile(r"story_(?!1_)\d+_")
RECORD = "records/firm-soil.mseed --period 1"
RECORDED = "{folder}/frame.yaml --recorded {folder}/recorded.yaml"
FRAME = "configs/collapse-prone-frame.yaml"
COMMANDS = {
    "tdint run": "configs/ten-story.yaml --duration 1 --no-check",
    "stories.csv of tdint run, two directions": "{folder}/two.yaml --duration 0.5",
    "resultants.csv of tdint run": "{folder}/two.yaml --duration 0.5",
    "elements.csv of tdint run": "configs/isolated-moat-wall.yaml --duration 0.1",
    "attachments.csv of tdint run": "configs/absorber-frame.yaml --duration 0.1",
    "links.csv of tdint run": "configs/absorber-frame.yaml --duration 0.1",
    "contacts.csv of tdint run": "{folder}/joint.yaml --duration 0.5",
    "rows.csv of tdint run": "{folder}/rows.yaml --duration 0.1",
    "stories.csv of tdint run, flexural": "configs/wall-on-soil.yaml --duration 0.1",
    "history.csv of tdint run": "configs/hardening.yaml --duration 0.1 --history --method moment4 "
    "--check",
    "floor-spectra.csv of tdint run": "configs/hardening.yaml --duration 1 --floor-spectra roof "
    "--floor-period 1",
    "tdint check": "configs/ten-story.yaml",
    "tdint modes": "configs/ten-story.yaml",
    "tdint modes --target": "asce7:sds=0.2,sd1=0.1,tl=8 configs/ten-story.yaml",
    "tdint modes --transfer": "ground configs/hardening.yaml",
    "tdint law": "configs/ten-story-bilinear.yaml --drift 1%",
    "tdint law --list": "",
    "tdint pushover": "configs/hazus-c1.yaml --drift 0.1% --points 5",
    "tdint pushover --target": "asce7:sds=0.2,sd1=0.1,tl=8 configs/hazus-c1.yaml --points 20",
    "tdint compare": RECORDED,
    "spectra.csv of tdint compare": RECORDED,
    "tdint inventory": "configs/buildings.csv --units m",
    "tdint inventory --rules capacity": "--classes {folder}/classes.csv {folder}/of-classes.csv "
    "--units m",
    "tdint info": "records/firm-soil.mseed",
    "tdint spectrum": f"{RECORD} --maxima exact --interpolation linear",
    "tdint spectrum --against": f"{{folder}}/published.csv {RECORD}",
    "tdint spectrum --target": "ec8:type=1,soil=B,ag=0.25g --period 1",
    "tdint spectrum --rotd 50,100": f"{RECORD} --maxima exact --interpolation linear",
    "tdint spectrum --ductility": f"2 {RECORD}",
    "tdint drift-spectrum": RECORD,
    "tdint run --scale 1,2": "configs/ten-story.yaml --duration 1",
    "runs.csv of tdint campaign": "{folder}/campaign.yaml",
    "stories.csv of tdint campaign": "{folder}/campaign.yaml",
    "elements.csv of tdint campaign": "{folder}/elements.yaml",
    "attachments.csv of tdint campaign": "{folder}/devices.yaml",
    "links.csv of tdint campaign": "{folder}/devices.yaml",
    "shocks.csv of tdint campaign": "{folder}/sequences.yaml",
    "profiles.csv of tdint campaign": "{folder}/campaign.yaml",
    "ratios.csv of tdint campaign": "{folder}/campaign.yaml --baseline frame",
    "damage.csv of tdint campaign": "{folder}/damage.yaml",
    "damage-types.csv of tdint campaign": "{folder}/damage.yaml",
    "losses.csv of tdint campaign": "{folder}/damage.yaml",
    "floor-spectra-mean.csv of tdint campaign": "{folder}/campaign.yaml --floor-spectra roof",
    "measures.csv of tdint campaign": f"{{folder}}/campaign.yaml --im {','.join(readmes.MEASURES)}",
    "tdint scale": "records/firm-soil.mseed --to pga=0.4g",
    "tdint ida": f"{FRAME} records/firm-soil.mseed --component HN1 --max-im 1.2m/s^2",
    "ida.csv of tdint ida": f"{FRAME} records/firm-soil.mseed --component HN1 --max-im 1.2m/s^2",
    "fractiles.csv of tdint ida": f"{FRAME} records/firm-soil.mseed --component HN1 --max-im "
    "1.2m/s^2",
    "margin.csv of tdint ida": f"{FRAME} records/near-fault.mseed --precision 50% --p695 "
    "smt=0.1g,ductility=2,sdc=B,dr=good,td=good,mdl=good",
    "tdint fragility": "configs/stripes.csv --modeling-dispersion 0.2 --hazard {folder}/hazard.csv",
    "FILE-bins.csv of tdint fragility": "configs/stripes.csv",
    "tdint fragility --im sa,pga": "{folder}",
    "tdint methods": "",
    "tdint stability": "--method impulse4 --dt-over-t 0.1",
    "tdint overshoot": "--method impulse4",
    "tdint order": "--method newmark-average --frequency-ratio 1",
    "tdint failures": "--method newmark-average --problem large-step",
    "tdint examples": "1 --dt 0.1 --method newmark-average",
    "tdint chart": "configs/hardening.yaml --method newmark-average --halvings 0 --repeat 1 "
    "--stories 1",
}


def listed(name):
    """Return the listed columns of a table. test_generated.py tests their meanings."""
    return [column.name for column in readmes.columns()[name]]


def test_every_list_is_compared():
    assert list(readmes.columns()) == list(COMMANDS)


PAGE = (readmes.ROOT / "cli/COLUMNS.md").read_text()


def columns_of_page(page):
    """Return the columns of each section of the page, with unit and meaning: the entries of its
    list, the columns that it names from other sections, and the columns of estimated errors."""
    sections = {}
    for text in page.split("\n## ")[1:]:
        title, _, body = text.partition("\n")
        found = sections[title] = {}
        for name, unit, meaning in re.findall(r"^- `(\w+)`(?: \((.*?)\))?: (.*)$", body, re.M):
            found[name] = (unit, meaning)
        for home, names in re.findall(r"^As in \*\*(.*?)\*\*: (.*)\.$", body, re.M):
            found |= {name: sections[home][name] for name in re.findall(r"`(\w+)`", names)}
        for names in re.findall(r"^Estimated errors of (.*)\.$", body, re.M):
            for name in re.findall(r"`(\w+)`", names):
                found[f"{name}_error"] = (found[name][0], f"estimated absolute error of {name}")
    return sections


def test_every_column_of_every_table_is_on_the_page():
    """The section of a table has all of its columns, with unit and meaning."""
    page = columns_of_page(PAGE)
    declared = readmes.columns() | readmes.further_columns()
    assert list(page) == list(declared)
    for table, group in declared.items():
        assert page[table].keys() == {column.name for column in group}, table
        for column in group:
            unit = "" if column.unit in ("1", "text") else column.unit
            same = {one.meaning for one in group if one.name == column.name}
            assert page[table][column.name] in {(unit, meaning) for meaning in same}, column


def test_every_declared_column_is_on_the_page():
    """A column of `columns.csv` is on the page, also if it depends on options and inputs."""
    names = {name for section in columns_of_page(PAGE).values() for name in section}
    for folder in ("src/tdint/studies", "src/tdint/output/tables"):
        text = (readmes.ROOT / folder / "columns.csv").read_text()
        declared = {row["name"] for row in csv.DictReader(io.StringIO(text))}
        assert len(declared) > 50
        assert {name for name in declared - names if "{" not in name} == set()
    assert "expected annual loss ratio of the building type" in PAGE  # a second `annual_loss`


def test_stated_values_are_those_of_declared_columns():
    """A keyword that is no column of its table would be ignored."""
    files = {"tdint.studies.columns": "studies/columns.csv"}
    files["tdint.output.tables.columns"] = "output/tables/columns.csv"
    stated, source = 0, readmes.ROOT / "src/tdint"
    for module in source.rglob("*.py"):
        tree = ast.parse(module.read_text())
        homes = [
            node.module
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and "declared" in [one.name for one in node.names]
        ]
        file = files.get(homes[0] if homes else "")
        if module == source / "assessment/tables.py":
            file = "assessment/tables.csv"
        if file is None:
            continue
        rows = list(csv.DictReader(io.StringIO((source / file).read_text())))
        for call in ast.walk(tree):
            if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "declared":
                table, *_ = (one.value for one in call.args if isinstance(one, ast.Constant))
                names = {row["name"] for row in rows if row["table"] == table}
                keywords = {one.arg for one in call.keywords if one.arg}
                keywords |= {
                    key.value
                    for one in call.keywords
                    if isinstance(one.value, ast.Dict)
                    for key in one.value.keys
                }
                assert names, (module, table)
                assert keywords <= names, (module, table)
                stated += len(keywords)
    assert stated > 100


@pytest.mark.parametrize(
    "line",
    [
        "- `peak_shear_N`",  # an entry
        "As in **tdint run**: `story`",  # a name of another table
        "Estimated errors of",
        " (m/s^2)",  # a unit
    ],
)
def test_a_missing_column_is_detected(line, monkeypatch):
    start = PAGE.index(line)
    end = start + len(line) if line.startswith(" ") else PAGE.index("\n", start)
    monkeypatch.setitem(globals(), "PAGE", PAGE[:start] + PAGE[end:])
    with pytest.raises((AssertionError, KeyError)):
        test_every_column_of_every_table_is_on_the_page()


@functools.cache
def printed(line, *output):
    """Return the output of a command line, which is run once for all its tables."""
    result = runner().invoke(cli, [*line.split(), *output])
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Directory with the input files of the command lines."""
    tmp_path = tmp_path_factory.mktemp("tables")
    record = readmes.ROOT / "records" / "firm-soil.mseed"
    motion, one_component = (
        f"{{file: {record}, component: HN1}}",
        f"records: {{files: [{record}], component: HN1}}\n",
    )
    frames = "buildings: {models: [frame.yaml, other.yaml]}\n"
    for name, text in {
        "recorded.yaml": f"base: {motion}\nfloors: {{1: {motion}}}\n",
        "frame.yaml": "{stories: [{mass: 1, stiffness: 400}], damping: {modal: 0.05}}",
        "other.yaml": "{stories: [{mass: 1, stiffness: 500}], damping: {modal: 0.05}}",
        "two.yaml": "{stories: [{mass: 1, x: {stiffness: 400}, y: {stiffness: 300}}], excitation: "
        f"{{x: {{record: {{file: {record}, component: HN1}}}}, "
        f"y: {{record: {{file: {record}, component: HN2}}}}}}}}",
        "rows.yaml": "{matrices: {names: [u], mass: [1], stiffness: [[400]]}, "
        f"excitation: {{record: {motion}}}}}",
        "joint.yaml": "{stories: [{mass: 1, stiffness: 400}], links: [{from: ground, to: 1, law: "
        "{type: gap, gap: 1e-7, stop_stiffness: 100}}], excitation: {record: "
        f"{motion}}}}}",
        "classes.csv": "class,sd_m,sa_g\nA,0.01,0.2\nA,0.05,0.3\n",
        "of-classes.csv": "id,class,NumberOfStories\none,A,2\n",
        "hazard.csv": "im,rate\n0.01,0.1\n100,1e-7\n",
        "published.csv": "period_s,psa_g\n1,0.1\n2,0.1\n",
        "campaign.yaml": f"{frames}{one_component}analysis: {{method: newmark-average}}\noutputs: "
        f"{{stories: true}}\n",
        "elements.yaml": "buildings: {models: "
        f"[{readmes.ROOT / 'configs/isolated-moat-wall.yaml'}]}}\n{one_component}",
        "devices.yaml": "buildings: {models: "
        f"[{readmes.ROOT / 'configs/absorber-frame.yaml'}]}}\n{one_component}",
        "damage.yaml": f"buildings: {{models: [{readmes.ROOT / FRAME}]}}\n{one_component}"
        "damage:\n  thresholds: {slight: 1%, moderate: 2%, extensive: 3%, complete: 4%}\n  "
        "dispersion: 0\n"
        "  losses: {slight: 0, moderate: 0, extensive: 0, complete: 1}\n",
        "sequences.yaml": f"{frames}records: {{sequences: pairs.csv, component: HN1}}\n",
        "pairs.csv": f"sequence,record\ntwice,{record}\ntwice,{record}\n",
        "runs.csv": "building,status,scale,peak_drift_ratio,sa_t1_m_s2,pga_m_s2\n"
        "one,done,1,0.01,1,1\none,done,2,0.02,2,3\none,done,1,0.01,1,1.5\n",
    }.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize("name", every(2, COMMANDS))
def test_columns(name, folder, monkeypatch):
    monkeypatch.chdir(readmes.ROOT)
    file, _, command = name.rpartition("tdint ")
    line = f"{command.partition(', ')[0]} {COMMANDS[name].format(folder=folder)}"
    out = folder / f"out-{hash(line)}{'.csv' * name.startswith('FILE-bins')}"
    text = printed(line, *(["-o", str(out)] if file else []))
    if name.startswith("FILE-bins"):
        text = out.with_name(f"{out.stem}-bins.csv").read_text()
    elif file:
        text = (out / file.split()[0]).read_text()
    header = text.partition("\n")[0]
    if name == "stories.csv of tdint run, two directions":
        # The other columns are those of `tdint run`, with errors.
        peaks = listed("tdint run")[:-1]
        errors = [f"{column}_error" for column in peaks[2:]]
        energy = [f"hysteretic_energy_J{end}" for end in ("", "_error")]
        assert header.split(",") == [*listed(name), *peaks, *errors, *energy]
        return
    # Columns of stories are listed only for the first story.
    assert [column for column in header.split(",") if not OTHER_STORY.match(column)] == listed(name)
