"""The recipes "where to add a feature" of src/README.md, followed in a copy of the packages.

A dummy intensity measure, option, column and attribute of an element work in each output that their
rows name. `test_extending.py` follows the recipes of methods, laws, quantities and formats.
"""

import csv
import io
import os
import re
import shutil
import subprocess
import sys

import pytest

import readmes

CHANGES = {
    "intensity measure": [
        (
            "tdint/ground_motion/measures.csv",
            "pga,m/s^2,1,,PGA,peak ground acceleration\n",
            "double-pga,m/s^2,1,,2 PGA,twice the peak ground acceleration\n",
        ),
        (
            "tdint/ground_motion/measures.py",
            '    "pga": lambda record: record.pga,\n',
            '    "double-pga": lambda record: 2.0 * record.pga,\n',
        ),
        (
            "tdint/ground_motion/measures.py",
            "    d5_95: float\n",
            "    double_pga: float\n",
        ),
    ],
    "option": [
        (
            "cli/tdint_cli/options/options.csv",
            "overshoot,--steps,Analysis,,,,,,Number of time steps; 10 by default.\n",
            "overshoot,--first,Analysis,,,,,,Number of motions of the table; all by default.\n",
        ),
        (
            "cli/tdint_cli/assessment/overshoot.py",
            "    steps: int = options.option(type=Count(1, _MAX_STEPS), default=10)\n",
            "    first: int | None = options.option(type=Count(1, 99))\n",
        ),
        (
            "cli/tdint_cli/assessment/overshoot.py",
            "    motions = [motion for pair in pairs.values() for motion in pair]\n",
            "    motions = motions[: request.first]\n",
        ),
    ],
    "column": [
        (
            "tdint/assessment/tables.csv",
            "overshoot,velocity,1,velocity divided by the maximum of the exact velocity\n",
            "overshoot,excess,1,displacement beyond the exact maximum\n",
        ),
        (
            "tdint/assessment/stability/stability.py",
            '    velocity_power: float\n    law: str = "linear"\n',
            "\n    @property\n    def excess(self) -> Array:\n"
            "        return abs(self.displacement) - 1.0\n",
        ),
    ],
    "attribute of an element of a story": [
        ("tdint/model/story.py", "    factor: float = 1.0\n", "    grade: float = 0.0\n"),
        (
            "tdint/model/config/keys.csv",
            "element,stiffness,not negative,initial stiffness; default for a gap: 0,,\n",
            "element,grade,positive,grade of its steel,,\n",
        ),
        (
            "tdint/response/runs/elements.py",
            'Quantity("text", "hysteretic law of the element")]\n',
            '    grade: Annotated[Array, Quantity("1", "grade of its steel")]\n',
        ),
        (
            "tdint/response/runs/elements.py",
            "        story=indices + 1,\n",
            "        grade=np.array([story.elements[j].grade for _, story, j in elements]),\n",
        ),
    ],
}
"""For each row of the table: file, a text in it, and the text that is inserted behind."""
FRAME = """\
stories:
  - mass: 1
    elements:
      - {type: linear, stiffness: 300, grade: 235}
      - {type: bilinear, stiffness: 100, yield_force: 1, hardening: 0.05}
damping: none
initial: {velocity: [0.3]}
"""


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    """Return a function that runs a command of a copy with all changes, and returns the table
    in its standard output or in a file."""
    folder = tmp_path_factory.mktemp("extended")
    for package in ("src/tdint", "cli/tdint_cli"):
        ignored = shutil.ignore_patterns("__pycache__", "*.md")
        shutil.copytree(readmes.ROOT / package, folder / package, ignore=ignored)
    for name, before, text in (change for row in CHANGES.values() for change in row):
        file = folder / ("" if name.startswith("cli") else "src") / name
        head, found, tail = file.read_text().partition(before)
        assert found, f"{name} has no {before!r}"
        file.write_text(head + found + text + tail)
    (folder / "frame.yaml").write_text(FRAME)
    (folder / "motion.csv").write_text("# dt = 0.1 s, units = m/s^2\n0\n3\n-1\n0\n")
    paths = os.pathsep.join(str(folder / name) for name in ("src", "cli"))
    environment = {**os.environ, "PYTHONPATH": paths, "TDINT_KERNELS": "python"}

    def table(command, file=None):
        done = subprocess.run(
            [sys.executable, "-c", "from tdint_cli.main import main; main()", *command.split()],
            cwd=folder, env=environment, capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        text = (folder / file).read_text() if file else done.stdout
        return list(csv.DictReader(io.StringIO(text)))

    return table


@pytest.mark.parametrize("feature", CHANGES)
def test_the_table_names_each_changed_file(feature):
    text = (readmes.ROOT / "src/README.md").read_text()
    (row,) = re.findall(rf"^\| {feature} \| (.*) \|$", text, re.MULTILINE)
    for name, *_ in CHANGES[feature]:
        module = name.rpartition("/")[2]
        if module not in ("overshoot.py", "stability.py"):  # "the command", "the result"
            assert module in row, (feature, name)


def test_a_measure_is_in_tables_and_a_target_of_scaling(extended):
    (row,) = extended("info motion.csv")
    assert float(row["double_pga_m_s2"]) == 6.0
    (factor,) = extended("scale motion.csv --to double-pga=3m/s^2")
    assert float(factor["factor"]) == pytest.approx(0.5)


def test_an_option_and_a_column_work(extended):
    rows = extended("overshoot --method newmark-average --steps 3 --first 1")
    assert len(rows) == 4
    for row in rows:
        assert float(row["excess"]) == pytest.approx(abs(float(row["displacement"])) - 1.0)


def test_an_attribute_of_an_element_is_read_and_written(extended):
    rows = extended("run frame.yaml --dt 0.01 --duration 0.2 --no-check -o out", "out/elements.csv")
    assert [float(row["grade"]) for row in rows] == [235.0, 0.0]
