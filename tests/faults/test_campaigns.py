"""Campaigns that are killed, and campaigns with killed workers."""

import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing, suppress
from importlib.util import find_spec
from pathlib import Path

import pytest

from faults.conftest import wait_until
from tdint.studies.store.result_store import FILE

pytestmark = pytest.mark.slow

STUDY = """\
buildings: {models: [model.yaml, soft.yaml]}
records: {files: [r0.csv]}
intensity: {scales: [%s]}
analysis: {method: newmark-average, dt: 0.001}
outputs: {stories: true}
"""
SCALES = ", ".join(f"{0.1 * i:.1f}" for i in range(1, 61))

# The campaigns are forked from a process that has imported all modules, so that a kill interrupts
# the campaign and not the start of Python.
KILLER = """\
import os, random, shutil, signal, sys, time
from pathlib import Path
from tdint.studies.campaign.execute import compile_for
from tdint.studies.campaign.inputs import read_inputs
from tdint.studies.campaign.plan import make_plan
from tdint.studies.campaign.reader import load_campaign
from tdint_cli.main import cli
import tdint.output.summary, tdint.studies.campaign.campaign_tables
import tdint_cli.studies.campaign_files, tdint_cli.studies.campaign

def campaign(folder):
    cli(["-q", "campaign", "study.yaml", "-o", folder, "--jobs", "2"], standalone_mode=False)

study = load_campaign("study.yaml")
compile_for(make_plan(study, read_inputs(study)))
random.seed(int(sys.argv[1]))
kills = rounds = 0
while kills < 40:
    child = os.fork()
    if child == 0:
        campaign("out")
        os._exit(0)
    time.sleep(random.uniform(0.0, 0.4))
    if os.waitpid(child, os.WNOHANG) == (0, 0):
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        kills += 1
    elif kills < 40:  # The campaign is complete and is restarted.
        assert Path("out/runs.csv").read_bytes() == Path("whole/runs.csv").read_bytes()
        shutil.rmtree("out")
        rounds += 1
print(kills, rounds)
"""


@pytest.fixture
def study(folder):
    (folder / "study.yaml").write_text(STUDY % SCALES)
    (folder / "soft.yaml").write_text((folder / "model.yaml").read_text().replace("8000", "900"))
    return folder


def test_forty_kills_lose_and_repeat_no_run(study, start):
    assert start("campaign", "study.yaml", "-o", "whole").end(300.0)[0] == 0
    killer = subprocess.run(
        [sys.executable, "-c", KILLER, "17"], cwd=study, capture_output=True, text=True, timeout=600
    )
    assert (killer.returncode, killer.stdout.split()[:1]) == (0, ["40"]), killer.stderr
    assert start("campaign", "study.yaml", "-o", "out").end(300.0)[0] == 0
    for name in ("runs.csv", "stories.csv", "profiles.csv"):
        assert (study / "out" / name).read_bytes() == (study / "whole" / name).read_bytes()
    assert sorted(path.name for path in (study / "out").iterdir() if path.suffix == ".tmp") == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_campaign_in_time_and_the_store_remains_valid(study, start, number):
    (study / "study.yaml").write_text(STUDY.replace("0.001", "0.00005") % SCALES)
    command = start("campaign", "study.yaml", "-o", "out")
    command.wait_for((study / "out" / FILE).exists)
    time.sleep(0.5)
    os.kill(command.process.pid, number)
    began = time.monotonic()
    code, _, messages = command.end(30.0)
    assert code == {signal.SIGINT: 130, signal.SIGTERM: 143}[number], messages
    assert time.monotonic() - began < 20.0
    assert not (study / "out" / "runs.csv").exists()
    assert start("campaign", "status", "out").end()[0] == 0


class Cluster:
    """Scheduler and workers of Dask as separate processes."""

    def __init__(self, folder: Path, security: list[str]) -> None:
        self.folder, self.security = folder, security
        self.file = folder / "scheduler.json"
        self.log = (folder / "cluster.log").open("w")
        scheme = "tls" if security else "tcp"
        self.processes = [
            self._start("scheduler", "--host", f"{scheme}://127.0.0.1", "--port", "0")
        ]
        wait_until(self.file.exists, 90.0, (folder / "cluster.log").read_text)

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [
                sys.executable,
                "-m",
                "dask",
                *arguments,
                "--scheduler-file",
                str(self.file),
                "--no-dashboard",
                *self.security,
            ],
            cwd=self.folder,
            stdout=self.log,
            stderr=self.log,
            start_new_session=True,
        )

    def add_worker(self) -> None:
        self.processes.append(
            self._start("worker", "--nthreads", "1", "--no-nanny", "--host", "127.0.0.1")
        )

    @property
    def address(self) -> str:
        return str(json.loads(self.file.read_text())["address"])

    def end(self) -> None:
        for process in self.processes:
            process.kill()
            process.wait()
        self.log.close()


@pytest.fixture
def cluster(study):
    # `distributed` is not imported in this process, because its warnings would be errors.
    if find_spec("distributed") is None:
        pytest.skip("Dask is not installed")
    started: list[Cluster] = []

    def begin(security: list[str] | None = None) -> Cluster:
        started.append(Cluster(study, security or []))
        return started[-1]

    yield begin
    for started_cluster in started:
        started_cluster.end()


def chunks_done(folder: Path) -> int:
    """Return the number of completed chunks, 0 if the store or its table does not exist yet."""
    with (
        suppress(sqlite3.OperationalError),
        closing(sqlite3.connect(f"file:{folder / FILE}?mode=ro", uri=True)) as store,
    ):
        return int(store.execute("SELECT count(*) FROM chunks").fetchone()[0])
    return 0


def test_a_cluster_gives_equal_results_if_a_worker_is_killed(study, start, cluster):
    (study / "study.yaml").write_text(STUDY.replace("0.001", "0.0001") % SCALES)
    dask_cluster = cluster()
    dask_cluster.add_worker()
    dask_cluster.add_worker()
    command = start("campaign", "study.yaml", "-o", "far", "--dask", dask_cluster.address)
    command.wait_for(lambda: chunks_done(study / "far") >= 3, 120.0)
    os.kill(dask_cluster.processes[1].pid, signal.SIGKILL)
    assert chunks_done(study / "far") < 60  # The campaign is not complete.
    code, _, messages = command.end(300.0)
    assert code == 0, messages
    assert start("campaign", "study.yaml", "-o", "whole").end(300.0)[0] == 0
    for name in ("runs.csv", "stories.csv"):
        assert (study / "far" / name).read_bytes() == (study / "whole" / name).read_bytes()


def certificate(folder: Path, name: str, signed_by: str | None) -> None:
    """Write NAME.pem and NAME-key.pem of an authority (`signed_by` is None) or signed by it."""
    subject = [
        "-subj", f"/CN={name}", "-keyout", f"{name}-key.pem", "-nodes", "-newkey",
        "rsa:2048",
    ]  # fmt: skip
    if signed_by is None:
        commands = [["req", "-x509", "-days", "2", *subject, "-out", f"{name}.pem"]]
    else:
        request = ["req", *subject, "-out", f"{name}.csr"]
        sign = [
            "x509", "-req", "-days", "2", "-in", f"{name}.csr", "-CA",
            f"{signed_by}.pem", "-CAkey", f"{signed_by}-key.pem", "-CAcreateserial",
            "-out", f"{name}.pem",
        ]  # fmt: skip
        commands = [request, sign]
    for command in commands:
        subprocess.run(["openssl", *command], cwd=folder, check=True, capture_output=True)


def test_certificates_are_required_and_checked(study, start, cluster, monkeypatch):
    if shutil.which("openssl") is None:
        pytest.skip("no openssl to make certificates with")
    certificate(study, "authority", None)
    certificate(study, "ours", "authority")
    certificate(study, "stranger", None)
    dask_cluster = cluster(
        ["--tls-ca-file", "authority.pem", "--tls-cert", "ours.pem", "--tls-key", "ours-key.pem"]
    )
    dask_cluster.add_worker()
    assert dask_cluster.address.startswith("tls://")

    def campaign(name: str, folder: str):
        variable = "DASK_DISTRIBUTED__COMM__TLS__"
        monkeypatch.setenv(f"{variable}CA_FILE", "authority.pem")
        monkeypatch.setenv(f"{variable}CLIENT__CERT", f"{name}.pem")
        monkeypatch.setenv(f"{variable}CLIENT__KEY", f"{name}-key.pem")
        arguments = ["study.yaml", "-o", folder, "--max-runs", "20"]
        return start("campaign", *arguments, "--dask", dask_cluster.address).end(120.0)

    code, _, messages = campaign("ours", "far")
    assert code == 0, messages
    assert start("campaign", "study.yaml", "-o", "near", "--max-runs", "20").end(120.0)[0] == 0
    assert (study / "far" / "runs.csv").read_bytes() == (study / "near" / "runs.csv").read_bytes()
    code, _, messages = campaign("stranger", "refused")
    assert (code, "no scheduler responds" in messages) == (2, True), messages


def test_a_stopped_campaign_is_continued_with_equal_tables(study, start):
    """While the campaign is stopped (SIGSTOP), a second call is refused and `status` answers."""
    assert start("campaign", "study.yaml", "-o", "whole").end(300.0)[0] == 0
    stopped = start("campaign", "study.yaml", "-o", "out", "--jobs", "2")
    stopped.wait_for(lambda: chunks_done(study / "out"))
    os.kill(stopped.process.pid, signal.SIGSTOP)
    try:
        code, _, message = start("campaign", "study.yaml", "-o", "out").end()
        assert code == 6 and "out" in message and len(message.splitlines()) == 1, message
        code, status, message = start("campaign", "status", "out").end()
        assert code == 0 and "120" in status + message, message
    finally:
        os.kill(stopped.process.pid, signal.SIGCONT)
    assert stopped.end(300.0)[0] == 0
    for name in ("runs.csv", "stories.csv"):
        assert (study / "out" / name).read_bytes() == (study / "whole" / name).read_bytes()
