"""A factor of the command line multiplies the factor of the record in the model."""

import json

import pytest

from cli.conftest import Command
from csv_rows import rows

MODEL = """\
stories: [{mass: 10, height: 3, stiffness: 8000, law: {type: bilinear, yield_force: 9, hardening: 5%}}]
excitation: {record: {file: r.csv, scale: 0.5}}
"""  # noqa: E501


@pytest.fixture
def model(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    samples = "".join(f"{(-1) ** (i // 9) * i / 60:.4f}\n" for i in range(60))
    (tmp_path / "r.csv").write_text(f"# dt = 0.02 s, units = m/s^2\n{samples}")
    (tmp_path / "m.yaml").write_text(MODEL)
    return tmp_path


def test_factors_of_file_and_command_line_are_multiplied(model, tdint: Command) -> None:
    def drift(line: str) -> tuple[str, float]:
        tdint(*f"run m.yaml {line} --no-check -o out --overwrite".split(), code=0)
        factor = json.loads((model / "out/summary.json").read_text())["record"]["scale"]
        return rows((model / "out/stories.csv").read_text())[0]["peak_drift_m"], factor

    # A record of the command line has no factor of its own.
    assert drift("--scale 4") == drift("r.csv --scale 2") == (drift("r.csv --scale 2")[0], 2.0)
    several = rows(tdint("run", "m.yaml", "--scale", "2,4", "--no-check", code=0).stdout)
    assert [row["scale"] for row in several] == ["1", "2"]
    assert several[1]["peak_drift_m"] == drift("--scale 4")[0]
