"""The method, the law, the quantity and the format that READMEs add as examples work in a copy of
the project.

The copy contains only the changes that the READMEs describe. The new law changes every time loop.
Therefore, all runs in this copy use interpreted kernels, and a separate test compares interpreted
and compiled loops of the new law and method. A second copy does not contain the law: it uses the
compiled loops of the suite, except for the loop of the new method.
"""

import csv
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from textwrap import indent

import numpy as np
import pytest

import readmes

pytestmark = pytest.mark.slow

LAWS = "src/tdint/kernels/laws"
FORMATS = "src/tdint/ground_motion/formats"
CHANGES = (
    ("member", "src/tdint/methods/single_step.py", "METHODS = (\n"),
    ("member-accuracy", "tests/assessment/test_stability.py", "ACCURACY = {\n"),
    ("member-powers", "tests/assessment/test_overshoot.py", "POWERS = {\n"),
    ("law-name", f"{LAWS}/__init__.py", '    "multilinear-pinching",\n'),
    ("law-case", "tests/kernels/test_branches.py", "LAW_CASES = {\n"),
    (
        "quantity",
        "src/tdint/response/runs/outcome.py",
        "            _peak(rows.PEAK_ACCELERATION),\n        ),\n    ]\n",
    ),
    ("format-sample", "tests/ground_motion/samples.py", "SAMPLES = {\n"),
)
TDINT = ("-c", "from tdint_cli.main import main; main()")
MODEL = """
stories: [{mass: 1, stiffness: 400, law: {type: hyperbolic, strength: 2}}, {mass: 1, stiffness: 300}]
damping: {modal: 0.05}
"""  # noqa: E501


def insert_after(path, before, text):
    """Insert text after a text that must be in a file."""
    head, found, tail = path.read_text().partition(before)
    assert found, f"{path.name} has no {before!r}"
    path.write_text(head + found + text + tail)


def install(folder):
    """Write the entry points of the project next to its packages, as an installer does."""
    groups = tomllib.loads((folder / "pyproject.toml").read_text())["project"]["entry-points"]
    lines = [
        line
        for name, entry_points in groups.items()
        for line in (f"[{name}]", *(f"{a} = {b}" for a, b in entry_points.items()))
    ]
    (folder / "src" / "tdint-0.dist-info").mkdir()
    (folder / "src" / "tdint-0.dist-info" / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: tdint\nVersion: 0\n"
    )
    (folder / "src" / "tdint-0.dist-info" / "entry_points.txt").write_text("\n".join(lines))


def copy_of_the_project(folder, law, **kernels):
    """Return a copy of the project with the examples (the law is optional), and an environment with
    which Python imports tdint from the copy."""
    for name in readmes.FOLDERS:
        shutil.copytree(
            readmes.ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__")
        )
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(readmes.ROOT / name, folder)
    shutil.copytree(readmes.ROOT / ".ci", folder / ".ci")
    (folder / FORMATS / "recorder.py").write_text(readmes.block("format-file"))
    project = folder / "pyproject.toml"
    insert_after(
        project,
        '[project.entry-points."obspy.plugin.waveform"]\n',
        'RECORDER = "tdint.ground_motion.formats.recorder"\n',
    )
    project.write_text(project.read_text() + "\n" + readmes.block("format-lines"))
    publications = folder / "src/tdint/methods/publications.bib"
    entry, longer = (line[1:] for line in readmes.block("member-reference").splitlines())
    assert entry in publications.read_text()
    publications.write_text(publications.read_text().replace(entry, longer))
    if law:
        text = readmes.block("law-file")
        lines = readmes.block("law-own-imports").splitlines()
        for removed, added in re.findall(r"^-(.*\n)((?:\+.*\n)+)", "\n".join([*lines, ""]), re.M):
            assert removed in text
            text = text.replace(removed, re.sub(r"^\+", "", added, flags=re.M))
        (folder / LAWS / "hyperbolic.py").write_text(text)
    for block_name, name, before in CHANGES:
        if law or not block_name.startswith("law"):
            text = re.sub(r"^\+", "", readmes.block(block_name), flags=re.MULTILINE)
            # The page shows the field without the indentation of its class.
            text = indent(text, "    ") if block_name == "quantity" else text
            insert_after(folder / name, before, text)
    install(folder)
    paths = os.pathsep.join(str(folder / name) for name in ("src", "cli"))
    copy = folder, {**os.environ, "PYTHONPATH": paths} | kernels
    assert str(folder) in python(copy, "-c", "import tdint; print(tdint.__file__)")
    return copy


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    """Copy with all examples and interpreted kernels."""
    folder = tmp_path_factory.mktemp("extended")
    copy = copy_of_the_project(
        folder, law=True, TDINT_CACHE_DIR=str(folder / "cache"), TDINT_KERNELS="python"
    )
    if find_spec("ruff") is not None:
        python(copy, "-m", "ruff", "check", "-q", "--fix", ".")
        python(copy, "-m", "ruff", "format", "-q", ".")
    python(copy, "tests/readmes.py", "--parts")
    return copy


@pytest.fixture(scope="module")
def without_law(tmp_path_factory):
    """Copy with all examples except the law, which uses the compiled kernels of the suite."""
    return copy_of_the_project(tmp_path_factory.mktemp("without-law"), law=False)


def python(copy, *arguments, **changed):
    folder, environment = copy
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env=environment | changed,
        capture_output=True,
        text=True,
        timeout=1200,
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    return done.stdout


def count_passed(copy, *arguments):
    """Return the number of passed tests of the copy, and check that no test fails."""
    output = python(copy, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments)
    return int(re.search(r"(\d+) passed", output)[1])


def table(text):
    return list(csv.DictReader(io.StringIO(text)))


def test_method_and_law_pass_the_tests_of_the_catalogue(extended, without_law):
    folder, _ = extended
    assert "| `newmark-step` |" in (folder / "src/tdint/methods/README.md").read_text()
    assert "| `hyperbolic` |" in (folder / "configs/LAWS.md").read_text()
    files = [
        str(path.relative_to(folder))
        for path in sorted((folder / "tests").rglob("test_*.py"))
        if re.search(r"\bcatalogue\(\)|\bLAWS\b", path.read_text())
        # The separate solver of the grid requires its own version of each law.
        and path.parent.name not in ("documentation", "grid")
    ]
    assert len(files) > 8
    expression = "hyperbolic or listed_for_every_method or every_law or up_to_date"
    assert (
        count_passed(extended, "-k", expression, *files, "tests/documentation/test_generated.py")
        > 20
    )
    assert count_passed(without_law, "-k", "newmark-step", *files) >= 12


@pytest.mark.skipif(find_spec("ruff") is None, reason="no lint extra")
def test_the_extended_copy_passes_the_checks_of_the_code(extended):
    """Style, types, direction of imports, structure, and the tests of tables and summaries."""
    for module in (("ruff", "check"), ("ruff", "format", "--check"), ("mypy",)):
        python(extended, "-m", *module, *(["."] if module != ("mypy",) else []))
    python(extended, "-c", "from importlinter.cli import lint_imports_command as run; run()")
    tests = ("tests/test_architecture.py", "tests/output/test_tables.py")
    assert count_passed(extended, *tests, "tests/output/test_summary.py") > 50


def test_method_and_law_give_equal_results_compiled_and_interpreted(extended):
    """Only the kernels of this building are compiled."""
    folder, _ = extended
    (folder / "hyperbolic.yaml").write_text(MODEL)
    command = (
        *TDINT, "run", "hyperbolic.yaml", "records/firm-soil.mseed", "--component",
        "HN1", "--method",
    )  # fmt: skip
    rows = [
        table(python(extended, *command, "newmark-step", "--duration", "4", TDINT_KERNELS=kernels))
        for kernels in ("", "python")
    ]
    compiled, written = (
        np.array([[float(value or "nan") for value in row.values()] for row in table])
        for table in rows
    )
    np.testing.assert_allclose(compiled, written, rtol=1e-9, equal_nan=True)
    assert list((folder / "cache").rglob("*.object"))


def test_a_new_story_quantity_is_in_all_outputs(without_law):
    folder, _ = without_law
    name, mass = "peak_inertia_N", 2e5
    run = (
        "run", "configs/ten-story.yaml", "--method", "newmark-average", "--duration",
        "2", "--check", "-o", "out",
    )  # fmt: skip
    python(without_law, *TDINT, *run)
    stories = table((folder / "out" / "stories.csv").read_text())
    inertia = [float(row[name]) for row in stories]
    assert inertia == pytest.approx(
        [mass * float(row["peak_absolute_acceleration_m_s2"]) for row in stories]
    )
    errors = [float(row["peak_absolute_acceleration_m_s2_error"]) for row in stories]
    assert [float(row[f"{name}_error"]) for row in stories] == pytest.approx(
        [mass * error for error in errors]
    )
    assert f'"{name}": {max(inertia)}' in (folder / "out" / "summary.json").read_text()
    study = {
        "buildings": {"models": ["configs/ten-story.yaml"]},
        "records": {"files": ["records/firm-soil.mseed"]},
        "outputs": {"stories": True},
    }
    (folder / "study.yaml").write_text(json.dumps(study))
    python(without_law, *TDINT, "campaign", "study.yaml", "-o", "study", "--max-runs", "1")
    assert all(
        float(row[name]) > 0.0 for row in table((folder / "study" / "stories.csv").read_text())
    )
    script = (
        "import tdint; r = tdint.run('configs/ten-story.yaml', duration=1); "
        "print(*r.to_dict('kip,in,g'))"
    )
    assert "peak_inertia_kip" in python(without_law, "-c", script).split()
    assert (
        count_passed(
            without_law, "tests/documentation/test_columns.py", "-k", "run or check or campaign"
        )
        > 5
    )


def test_a_new_format_is_read(extended):
    folder, _ = extended
    samples = np.round(100.0 * np.sin(0.3 * np.arange(400)), 3)
    lines = ["RECORDER N01E, dt 0.005 s, cm/s^2", *(f"{sample:.3f}" for sample in samples)]
    (folder / "motion.rec").write_text("\n".join(lines) + "\n")
    (row,) = table(python(extended, *TDINT, "info", "motion.rec"))
    assert (row["component"], row["dt_s"], row["samples"]) == ("N01E", "0.005", "400")
    assert float(row["pga_m_s2"]) == pytest.approx(0.01 * np.max(np.abs(samples)))
    assert (
        count_passed(
            extended,
            "tests/ground_motion/test_formats_detection.py",
            "tests/ground_motion/test_read.py",
        )
        > 20
    )
