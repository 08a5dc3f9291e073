"""The table of output files in cli/README.md names the files that the commands write."""

import pytest

import readmes
from reference_tables import OUTPUTS
from separate_streams import runner
from tdint_cli.main import cli

_RECORD = f"{{file: {readmes.ROOT / 'records/firm-soil.mseed'}, component: HN1}}"
_GROUND = f"excitation: {{record: {_RECORD}}}\nanalysis: {{duration: 0.1}}\n"
_YIELDING = "{type: bilinear, yield_force: 1, hardening: 0.1}"
MODELS = {
    "parts.yaml": f"""\
stories: [{{mass: 1, height: 3, elements: [{{type: linear, stiffness: 400}}, {{type: bilinear,
  stiffness: 100, yield_force: 1, hardening: 0}}]}}]
damping: none
attachments: [{{name: tank, floor: 1, mass: 0.1, stiffness: 40}}]
links: [{{name: joint, from: ground, to: 1, law: {{type: gap, gap: 1e-10, stop_stiffness: 100}}}}]
{_GROUND}""",
    "chain.yaml": f"stories: [{{mass: 1, height: 3, stiffness: 400, law: {_YIELDING}}}]\n"
    f"damping: {{modal: 5%}}\n{_GROUND}",
    "rows.yaml": f"matrices: {{names: [u], mass: [1], stiffness: [[400]]}}\n{_GROUND}",
    "plan.yaml": f"""\
stories: [{{mass: 1, x: {{stiffness: 400}}, y: {{stiffness: 300}}}}]
excitation: {{x: {{record: {_RECORD}}}, y: {{record: {_RECORD}}}}}
analysis: {{duration: 0.1}}
""",
    "campaign.yaml": """\
buildings: {models: [chain.yaml]}
records: {files: [motion.txt], units: m/s^2}
analysis: {method: newmark-average}
outputs: {stories: true}
""",
}
OPTIONS = "--history --plot --floor-spectra 1 --floor-period 1 --export-floors mseed --no-check"
RUNS = {
    "run": [f"chain.yaml {OPTIONS}", "parts.yaml", "rows.yaml", "plan.yaml"],
    "campaign": ["campaign.yaml --plot --floor-spectra roof --floor-period 1"],
    "match": [
        f"{readmes.ROOT / 'records/retrofit/R1.mseed'} --component HN1 --plot "
        "--target ec8:type=1,soil=B,ag=0.1g --range 0.5:1"
    ],
}
"""Command lines; test_columns.py executes further commands and reads the files of the table."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    for name, text in MODELS.items():
        (tmp_path / name).write_text(text)
    samples = [0.1 * (-1) ** (step // 5) for step in range(30)]
    lines = "\n".join(f"{value:.3f}" for value in samples)
    (tmp_path / "motion.txt").write_text(f"# dt = 0.01 s, units = m/s^2\n{lines}\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "command",
    ["campaign", *(pytest.param(name, marks=pytest.mark.long) for name in ("run", "match"))],
)
def test_files_of_a_command_are_those_of_the_table(command, folder):
    table = {name for names in OUTPUTS[command].values() for name in names}
    written = set()
    for number, line in enumerate(RUNS[command]):
        out = folder / f"out-{number}"
        result = runner().invoke(cli, [command, *line.split(), "-o", str(out), "-q"])
        assert result.exit_code == 0, result.output
        written |= {file.name for file in out.iterdir() if not file.name.startswith(".")}
    motions = {name for name in written if command == "match" and name.startswith("R1")}
    assert written - motions <= table
    assert (table if command == "run" else set(OUTPUTS[command][""])) <= written
