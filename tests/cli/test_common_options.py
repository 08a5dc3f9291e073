"""The option --jobs has its effect in each command; test_files.py tests --overwrite."""

import shutil

import click
import pytest

from tdint.studies.campaign import execute
from tdint.studies.ida import ida
from tdint.system import processors
from tdint_cli import processes
from tdint_cli.main import COMMANDS, cli


def declaring(name):
    """Return the commands with an option."""
    context = click.Context(cli)
    return {
        command
        for command in COMMANDS
        if any(option.name == name for option in cli.get_command(context, command).params)
    }


def write_inputs(folder):
    shutil.copy("other.mseed", "third.mseed")
    (folder / "study.yaml").write_text(STUDY)


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
    numbers, started = [], []

    def threads(work, items, jobs):
        numbers.append(jobs)
        return map(work, items)

    class Worker(processes._Worker):
        def __init__(self):
            started.append(self)
            super().__init__()

    for module in (execute, ida):
        monkeypatch.setattr(module, "on_threads", threads)
    monkeypatch.setattr(processes, "_Worker", Worker)
    jobs = processors() + 1  # not the default
    tdint(*JOBS[command].split(), "--jobs", jobs, code=0)
    if "third.mseed" in JOBS[command]:
        assert (numbers, len(started)) == ([], 2)
    else:
        assert (numbers, started) == ([jobs], [])
