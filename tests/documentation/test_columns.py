"""The columns that cli/README.md lists are those of the tables."""

from __future__ import annotations

import re

import pytest
from click.testing import CliRunner

import readmes
from tdint_cli.main import cli

TEXT = (readmes.ROOT / "cli" / "README.md").read_text()
OTHER_STORY = re.compile(r"story_(?!1_)\d+_")
RECORD = "records/firm-soil.mseed --period 1"
COMMANDS = {
    "tdint run": "configs/ten-story.yaml --duration 1",
    "history.csv of tdint run": "configs/hardening.yaml --duration 0.1 --history",
    "tdint modes": "configs/ten-story.yaml",
    "tdint law": "configs/ten-story-bilinear.yaml --drift 1%",
    "tdint pushover": "configs/hazus-c1.yaml --drift 0.1%",
    "tdint inventory": "configs/buildings.csv --units m",
    "tdint info": "records/firm-soil.mseed",
    "tdint spectrum": f"{RECORD} --maxima exact --interpolation linear",
    "tdint spectrum --rotd 50,100": f"{RECORD} --maxima exact --interpolation linear",
    "tdint spectrum --ductility": f"2 {RECORD}",
    "tdint drift-spectrum": RECORD,
    "tdint methods": "",
    "tdint stability": "--method impulse4 --dt-over-t 0.1",
    "tdint overshoot": "--method impulse4",
    "tdint order": "--method newmark-average --frequency-ratio 1",
    "tdint failures": "--method newmark-average --problem large-step",
    "tdint examples": "1 --dt 0.1 --method newmark-average",
    "tdint chart": "configs/hardening.yaml --method newmark-average --halvings 0 --repeat 1 --stories 1",
}


def listed(name):
    part = TEXT.partition(f"### Columns of {name}\n")[2].partition("\n### ")[0].partition("\n<!-- ")[0]
    return re.findall(r"^\| `(\w+)` \|", part, re.MULTILINE)


def test_every_list_is_compared():
    assert re.findall(r"^### Columns of (.*)$", TEXT, re.MULTILINE) == list(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_columns(name, monkeypatch, tmp_path):
    monkeypatch.chdir(readmes.ROOT)
    arguments = f"{name.partition('tdint ')[2]} {COMMANDS[name]}".split()
    history = name.startswith("history")
    if history:
        arguments += ["-o", str(tmp_path / "out")]
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code == 0, result.output
    header = ((tmp_path / "out" / "history.csv").read_text() if history else result.stdout).partition("\n")[0]
    # The columns of a story are listed for the first one.
    assert [column for column in header.split(",") if not OTHER_STORY.match(column)] == listed(name)
