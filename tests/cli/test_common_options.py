"""Options that many commands share have their effect in each of them."""

import shutil
from pathlib import Path

import click
import numpy as np
import pytest

from tdint.campaign import execute, ida
from tdint.system import processors
from tdint_cli import processes
from tdint_cli.main import COMMANDS, cli

ROOT = Path(__file__).parents[2]
OUTPUTS = {
    "init": ("init made.yaml --stories 2 --period 0.5", "made.yaml"),
    "run": ("run forced.yaml -o out", "out/stories.csv"),
    "modes": ("modes forced.yaml -o out.csv", "out.csv"),
    "law": ("law shaken.yaml --story 1 --drift 1% -o out.csv", "out.csv"),
    "pushover": ("pushover shaken.yaml --drift 1% --points 5 -o out.csv", "out.csv"),
    "inventory": ("inventory buildings.csv --units m -o out.csv", "out.csv"),
    "info": ("info other.mseed --units m/s^2 -o out.csv", "out.csv"),
    "spectrum": ("spectrum other.mseed --units m/s^2 --period 0.5 -o out.csv", "out.csv"),
    "drift-spectrum": (
        "drift-spectrum other.mseed --units m/s^2 --period 0.5 --stories 1 -o out.csv",
        "out.csv",
    ),
    "match": (
        "match other.mseed --units m/s^2 --target ec8:type=1,soil=B,ag=0.25g --range 0.4:0.5 "
        "-o out",
        "out/matched.csv",
    ),
    "campaign": ("campaign study.yaml -o out", "out/runs.csv"),
    "scale": ("scale other.mseed --units m/s^2 --pga 0.5g -o out.csv", "out.csv"),
    "ida": (
        "ida shaken.yaml other.mseed --units m/s^2 --im pga --max-im 0.05g -o out",
        "out/ida.csv",
    ),
    "sensitivity": (
        "sensitivity shaken.yaml other.mseed --units m/s^2 --vary mass_factor=0.9:1.1 -o out.csv",
        "out.csv",
    ),
    "fragility": ("fragility stripes.csv -o out.csv", "out.csv"),
    "chart": ("chart forced.yaml --method newmark-average --dt 0.04 -o out.csv", "out.csv"),
    "failures": ("failures --problem large-step --method impulse4 -o out.csv", "out.csv"),
    "stability": ("stability --method impulse4 -o out.csv", "out.csv"),
    "overshoot": ("overshoot --method impulse4 --steps 5 -o out.csv", "out.csv"),
    "order": ("order --method impulse4 --load free -o out.csv", "out.csv"),
    "examples": ("examples 1 --method impulse -o out", "out/example-1-errors.csv"),
    "validate": ("validate -o out.csv", "out.csv"),
    "compare": (
        "compare model.yaml --recorded recorded.yaml -o out.csv",
        "out.csv",
    ),
}
"""Command lines with an output, and one of their files."""


def declaring(name):
    """Return the commands with an option."""
    context = click.Context(cli)
    return {
        command
        for command in COMMANDS
        if any(option.name == name for option in cli.get_command(context, command).params)
    }


def test_every_command_with_an_output_is_tried():
    assert declaring("overwrite") == OUTPUTS.keys()


@pytest.mark.parametrize("command", OUTPUTS)
def test_overwrite_replaces_an_existing_file(folder, tdint, command):
    """Without the option the file is kept."""
    write_inputs(folder)
    line, name = OUTPUTS[command]
    file = Path(name)
    tdint(*line.split(), code=0)
    written = file.read_bytes()
    file.write_text("mine")
    tdint(*line.split(), code=6)
    assert file.read_text() == "mine"
    tdint(*line.split(), "--overwrite", code=0)
    assert file.read_bytes()[:60] == written[:60]


def write_inputs(folder):
    shutil.copy(ROOT / "configs/stripes.csv", folder)
    shutil.copy("other.mseed", "third.mseed")
    (folder / "study.yaml").write_text(STUDY)
    (folder / "buildings.csv").write_text(
        "id,NumberOfStories,YearBuilt,StructureType,PlanArea\noffice,2,1990,C1,900\n"
    )
    (folder / "model.yaml").write_text(
        "stories: [{mass: 1, stiffness: 900}]\ndamping: {modal: 0.02}\n"
        "excitation: {record: {file: base.txt}}\n"
    )
    motion = np.random.default_rng(3).normal(size=200)
    np.savetxt("base.txt", motion, header="dt = 0.02 s, units = m/s^2")
    np.savetxt("roof.txt", motion[::-1], header="dt = 0.02 s, units = m/s^2")
    (folder / "recorded.yaml").write_text(
        "base: {file: base.txt}\nfloors: {1: {file: roof.txt, quantity: acceleration}}\n"
    )


STUDY = """\
buildings: {models: [shaken.yaml]}
records: {files: [motion.mseed, other.mseed], units: m/s^2}
analysis: {method: newmark-average}
"""
JOBS = {
    "run": "run shaken.yaml --record motion.mseed --scale 0.5,1,2 -o out",
    "campaign": "campaign study.yaml -o out",
    "ida": "ida shaken.yaml other.mseed --units m/s^2 --im pga --max-im 0.05g",
    "spectrum": "spectrum motion.mseed other.mseed third.mseed --units m/s^2 --period 1",
    "drift-spectrum": "drift-spectrum motion.mseed other.mseed third.mseed --units m/s^2 "
    "--period 1 --stories 1",
}


def test_every_command_with_jobs_is_tried():
    assert declaring("jobs") == JOBS.keys()


@pytest.mark.parametrize("command", JOBS)
def test_jobs_is_the_number_of_threads_or_processes(folder, tdint, monkeypatch, command):
    """Three records require only two further processes."""
    write_inputs(folder)
    numbers = []

    def threads(work, items, jobs):
        numbers.append(jobs)
        return map(work, items)

    class Workers(processes.Workers):
        def __init__(self, function, count):
            numbers.append(count)
            super().__init__(function, count)

    for module in (execute, ida):
        monkeypatch.setattr(module, "on_threads", threads)
    monkeypatch.setattr(processes, "Workers", Workers)
    jobs = processors() + 1  # not the default
    tdint(*JOBS[command].split(), "--jobs", jobs, code=0)
    assert numbers == [2 if "third.mseed" in JOBS[command] else jobs]
