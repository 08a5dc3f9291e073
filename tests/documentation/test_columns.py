"""The columns that cli/README.md lists are those of the tables."""

import functools
import re

import pytest

import readmes
from separate_streams import runner
from tdint_cli.main import cli

OTHER_STORY = re.compile(r"story_(?!1_)\d+_")
RECORD = "records/firm-soil.mseed --period 1"
RECORDED = "{folder}/frame.yaml --recorded {folder}/recorded.yaml --blind {folder}/recorded.yaml --fit damping"
FRAME = "configs/collapse-prone-frame.yaml"
COMMANDS = {
    "tdint run": "configs/ten-story.yaml --duration 1 --no-check",
    "history.csv of tdint run": "configs/hardening.yaml --duration 0.1 --history --method moment4 --check",
    "floor-spectra.csv of tdint run": "configs/hardening.yaml --duration 1 --floor-spectra roof --period 1",
    "tdint check": "configs/ten-story.yaml",
    "tdint modes": "configs/ten-story.yaml",
    "tdint modes --target": "asce7:sds=0.2,sd1=0.1,tl=8 configs/ten-story.yaml",
    "tdint law": "configs/ten-story-bilinear.yaml --drift 1%",
    "tdint pushover": "configs/hazus-c1.yaml --drift 0.1% --points 5",
    "tdint pushover --target": "asce7:sds=0.2,sd1=0.1,tl=8 configs/hazus-c1.yaml --points 20",
    "tdint compare": RECORDED,
    "spectra.csv of tdint compare": RECORDED,
    "fit.csv of tdint compare": RECORDED,
    "tdint inventory": "configs/buildings.csv --units m",
    "tdint inventory --rules capacity": "--classes {folder}/classes.csv {folder}/of-classes.csv --units m",
    "tdint info": "records/firm-soil.mseed",
    "tdint spectrum": f"{RECORD} --maxima exact --interpolation linear",
    "tdint spectrum --against": f"{{folder}}/published.csv {RECORD}",
    "tdint spectrum --target": "ec8:type=1,soil=B,ag=0.25g --period 1",
    "tdint spectrum --rotd 50,100": f"{RECORD} --maxima exact --interpolation linear",
    "tdint spectrum --ductility": f"2 {RECORD}",
    "tdint spectrum --oscillator 1 --history": "records/firm-soil.mseed",
    "tdint drift-spectrum": RECORD,
    "tdint run --scale 1,2": "configs/ten-story.yaml --duration 1",
    "runs.csv of tdint campaign": "{folder}/campaign.yaml",
    "stories.csv of tdint campaign": "{folder}/campaign.yaml",
    "shocks.csv of tdint campaign": "{folder}/sequences.yaml",
    "profiles.csv of tdint campaign": "{folder}/campaign.yaml",
    "ratios.csv of tdint campaign": "{folder}/campaign.yaml --baseline frame",
    "damage.csv of tdint campaign": "{folder}/damage.yaml",
    "damage-types.csv of tdint campaign": "{folder}/damage.yaml",
    "losses.csv of tdint campaign": "{folder}/damage.yaml",
    "floor-spectra-mean.csv of tdint campaign": "{folder}/campaign.yaml --floor-spectra roof",
    "measures.csv of tdint campaign": f"{{folder}}/campaign.yaml --im {','.join(readmes.MEASURES)}",
    "tdint scale": "records/firm-soil.mseed --pga 0.4g",
    "tdint ida": f"{FRAME} records/firm-soil.mseed --component HN1 --max-im 1.2m/s^2",
    "ida.csv of tdint ida": f"{FRAME} records/firm-soil.mseed --component HN1 --max-im 1.2m/s^2",
    "tdint fragility": "configs/stripes.csv --beta-model 0.2",
    "tdint fragility --im sa,pga": "{folder}",
    "tdint methods": "",
    "tdint stability": "--method impulse4 --dt-over-t 0.1",
    "tdint overshoot": "--method impulse4",
    "tdint order": "--method newmark-average --frequency-ratio 1",
    "tdint failures": "--method newmark-average --problem large-step",
    "tdint examples": "1 --dt 0.1 --method newmark-average",
    "tdint chart": "configs/hardening.yaml --method newmark-average --halvings 0 --repeat 1 --stories 1",
}


def listed(name):
    """Their meanings stand in cli/README.md, which is compared with what generates it."""
    return [column.name for column in readmes.columns()[name]]


def test_every_list_is_compared():
    assert list(readmes.columns()) == list(COMMANDS)


@functools.cache
def printed(line, *output):
    """What a command line prints, done once for all its tables."""
    result = runner().invoke(cli, [*line.split(), *output])
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What the command lines read."""
    tmp_path = tmp_path_factory.mktemp("tables")
    motion = f"{{file: {readmes.ROOT / 'records' / 'firm-soil.mseed'}, component: HN1}}"
    (tmp_path / "recorded.yaml").write_text(f"base: {motion}\nfloors: {{1: {motion}}}\n")
    (tmp_path / "frame.yaml").write_text("{stories: [{mass: 1, stiffness: 400}], damping: {modal: 0.05}}")
    (tmp_path / "other.yaml").write_text("{stories: [{mass: 1, stiffness: 500}], damping: {modal: 0.05}}")
    (tmp_path / "classes.csv").write_text("class,sd_m,sa_g\nA,0.01,0.2\nA,0.05,0.3\n")
    (tmp_path / "of-classes.csv").write_text("id,class,NumberOfStories\none,A,2\n")
    (tmp_path / "published.csv").write_text("period_s,psa_g\n1,0.1\n2,0.1\n")
    (tmp_path / "campaign.yaml").write_text(
        f"buildings: {{models: [frame.yaml, other.yaml]}}\n"
        f"records: {{files: [{readmes.ROOT / 'records' / 'firm-soil.mseed'}]}}\n"
        "analysis: {method: newmark-average}\noutputs: {stories: true}\n"
    )
    (tmp_path / "damage.yaml").write_text(
        f"buildings: {{models: [{readmes.ROOT / FRAME}]}}\n"
        f"records: {{files: [{readmes.ROOT / 'records' / 'firm-soil.mseed'}], component: HN1}}\n"
        "damage:\n  thresholds: {slight: 1%, moderate: 2%, extensive: 3%, complete: 4%}\n  dispersion: 0\n"
        "  losses: {slight: 0, moderate: 0, extensive: 0, complete: 1}\n"
    )
    (tmp_path / "sequences.yaml").write_text(
        "buildings: {models: [frame.yaml]}\nrecords: {sequences: pairs.csv, component: HN1}\n"
    )
    shock = f"twice,{readmes.ROOT / 'records' / 'firm-soil.mseed'}"
    (tmp_path / "pairs.csv").write_text(f"sequence,record\n{shock}\n{shock}\n")
    (tmp_path / "runs.csv").write_text(
        "building,status,scale,peak_drift_ratio,sa_t1_m_s2,pga_m_s2\n"
        "one,done,1,0.01,1,1\none,done,2,0.02,2,3\none,done,1,0.01,1,1.5\n"
    )
    return tmp_path


@pytest.mark.parametrize("name", COMMANDS)
def test_columns(name, folder, monkeypatch):
    monkeypatch.chdir(readmes.ROOT)
    file, _, command = name.rpartition("tdint ")
    line = f"{command} {COMMANDS[name].format(folder=folder)}"
    out = folder / f"out-{hash(line)}"
    text = printed(line, *(["-o", str(out)] if file else []))
    text = (out / file.split()[0]).read_text() if file else text
    header = text.partition("\n")[0]
    # The columns of a story are listed for the first one.
    assert [column for column in header.split(",") if not OTHER_STORY.match(column)] == listed(name)
