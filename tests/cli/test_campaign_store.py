"""Stores of campaigns that are damaged, changed by hand, locked by others, or beside tables of other commands."""

import os
import shutil
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from cli.conftest import Command
from tdint.campaign.store import FILE
from tdint.campaign.store_schema import LOCK

STUDY = """\
buildings: {models: [shaken.yaml]}
records: {files: [motion.mseed, other.mseed], units: m/s^2}
intensity: {scales: [0.5, 1, 2.5]}
outputs: {stories: true}
"""
TABLES = ("runs.csv", "stories.csv")


@pytest.fixture
def done(folder: Path, tdint: Command) -> dict[str, bytes]:
    """The campaign study.yaml, done in the folder out; its tables."""
    (folder / "study.yaml").write_text(STUDY)
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    return tables("out")


def tables(folder: str) -> dict[str, bytes]:
    return {name: Path(folder, name).read_bytes() for name in TABLES}


def sql(*statements: str) -> None:
    with closing(sqlite3.connect(f"out/{FILE}")) as connection, connection:
        for statement in statements:
            connection.execute(statement)


@pytest.mark.parametrize(
    "statement",
    [
        "DELETE FROM run_rows WHERE scale = 0.5",
        "DELETE FROM story_rows WHERE story = 2",
        "UPDATE run_rows SET status = '=1+1' WHERE scale = 1",
        "UPDATE run_rows SET peak_drift_m = 9e999 WHERE scale = 1",
        "UPDATE story_rows SET height_m = 4 WHERE story = 1",
        "UPDATE run_rows SET chunk = chunk + 1",
        "UPDATE run_rows SET chunk = 'x'",
        "UPDATE chunks SET sha256 = ''",
        "UPDATE chunks SET seconds = -1",
        "UPDATE chunks SET id = id + 1000",
        "DELETE FROM chunks",
    ],
)
def test_a_chunk_that_is_not_as_it_was_written_is_done_again(
    done: dict[str, bytes], tdint: Command, statement: str
) -> None:
    sql(statement)
    for action in ("status", "export"):
        tdint.refused("chunks of runs are not as they were written; call", "campaign", action, "out", code=6)
    assert tables("out") == done
    again = tdint("campaign", "study.yaml", "-o", "out")
    assert (again.exit_code, "they are done again" in again.stderr) == (0, True), again.stderr
    assert tables("out") == done
    assert "nothing to do" in tdint("campaign", "study.yaml", "-o", "out").stderr


def test_a_merge_leaves_out_what_is_damaged(done: dict[str, bytes], tdint: Command) -> None:
    shutil.copytree("out", "good")
    sql("DELETE FROM run_rows WHERE scale = 0.5")
    result = tdint("campaign", "merge", "out", "good", "-o", "all")
    assert (result.exit_code, "and are left out" in result.stderr) == (0, True)
    assert tables("all") == done
    refused = tdint("campaign", "merge", "out", "-o", "part")
    assert (refused.exit_code, Path("part/campaign.sqlite").exists()) == (5, False)
    assert tdint("campaign", "merge", "out", "-o", "part", "--partial").exit_code == 0
    assert tdint("campaign", "study.yaml", "-o", "part").exit_code == 0
    assert tables("part") == done


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE meta SET value = '9' WHERE key = 'schema'",
        "DELETE FROM meta",
        "DELETE FROM meta WHERE key = 'fingerprint'",
        "UPDATE buildings SET name = '=1+1'",
        "UPDATE buildings SET name = CAST(x'ff00' AS TEXT)",
        "UPDATE records SET direction = 2",
        "INSERT INTO unused VALUES('ghost', '')",
        "DROP TABLE meta",
        "DROP TABLE story_rows",
        "DROP TABLE written",
        "DROP VIEW runs",
        "CREATE TRIGGER more AFTER INSERT ON chunks BEGIN DELETE FROM run_rows; END",
    ],
)
def test_a_store_that_cannot_be_trusted_is_refused_with_a_way_out(
    done: dict[str, bytes], tdint: Command, statement: str
) -> None:
    sql(statement)
    before = Path("out", FILE).read_bytes()
    for arguments in (["study.yaml", "-o", "out"], ["status", "out"], ["export", "out"], ["merge", "out", "-o", "new"]):
        result = tdint.refused("cannot be trusted", "campaign", *arguments, code=6)
        assert len(result.stderr.splitlines()) == 1
    assert Path("out", FILE).read_bytes() == before
    assert tdint("campaign", "study.yaml", "-o", "out", "--overwrite").exit_code == 0
    assert tables("out") == done


def test_every_damaged_page_is_found(done: dict[str, bytes], tdint: Command) -> None:
    """Zeroed, or changed for another: refused, or what it held is done again, or nothing was in it."""
    whole = Path("out", FILE).read_bytes()
    size = int.from_bytes(whole[16:18], "big")
    pages = [whole[at : at + size] for at in range(0, len(whole), size)]
    ends = set()
    for number in range(0, len(pages), 3):
        for page in (bytes(size), pages[(number + 3) % len(pages)]):
            Path("out", FILE).write_bytes(b"".join([*pages[:number], page, *pages[number + 1 :]]))
            result = tdint("campaign", "study.yaml", "-o", "out")
            assert result.exit_code in (0, 6), result.stderr
            assert "Traceback" not in result.stderr
            assert tables("out") == done
            ends.add(result.exit_code)
    assert 6 in ends


@pytest.mark.parametrize("name", [LOCK, FILE])
def test_what_is_no_file_of_ours_in_its_place(done: dict[str, bytes], tdint: Command, name: str) -> None:
    for make in (lambda path: path.write_text("hello\n" * 200), os.mkfifo, Path.mkdir):
        Path("out", name).unlink(missing_ok=True)
        make(Path("out", name))
        result = tdint("campaign", "study.yaml", "-o", "out")
        assert (result.exit_code, len(result.stderr.splitlines())) == (6, 1), result.stderr
        assert str(Path("out", name)) in result.stderr
        if make is Path.mkdir:
            Path("out", name).rmdir()
    assert tables("out") == done


@contextmanager
def locked_by_another(seconds: float = 0.0) -> Iterator[None]:
    """Another program writes; for some seconds, or as long as it is needed."""
    connection = sqlite3.connect(f"out/{FILE}", isolation_level=None, check_same_thread=False)
    connection.execute("BEGIN IMMEDIATE")
    timer = threading.Timer(seconds, connection.rollback)
    if seconds:
        timer.start()
    try:
        yield
    finally:
        timer.cancel()
        connection.close()


def test_reading_needs_no_lock(done: dict[str, bytes], tdint: Command) -> None:
    tdint("campaign", "export", "out")
    with locked_by_another():
        for arguments in (["status", "out"], ["export", "out"], ["study.yaml", "-o", "out"]):
            result = tdint("campaign", *arguments)
            assert (result.exit_code, "waiting" in result.stderr) == (0, False), result.stderr
    assert tables("out") == done


def test_waiting_is_said_and_ends(done: dict[str, bytes], tdint: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    sql("DELETE FROM run_rows WHERE scale = 0.5")
    with locked_by_another(2.0):
        result = tdint("campaign", "study.yaml", "-o", "out")
    assert (result.exit_code, "locked it; waiting for ten seconds at most" in result.stderr) == (0, True)
    assert tables("out") == done
    monkeypatch.setattr("tdint.campaign.store_schema._LONGEST", 100)
    sql("DELETE FROM run_rows WHERE scale = 0.5")
    with locked_by_another():
        result = tdint("campaign", "study.yaml", "-o", "out")
    assert (result.exit_code, "another program keeps it locked" in result.stderr) == (6, True)


def test_tables_of_another_command_are_not_replaced(done: dict[str, bytes], tdint: Command) -> None:
    """Neither those that were there before the campaign began, nor those that were changed since."""
    assert tdint("run", "shaken.yaml", "--units", "m/s^2", "-o", "one").exit_code == 0
    kept = {path.name: path.read_bytes() for path in Path("one").iterdir()}
    for arguments in (
        ["campaign", "study.yaml", "-o", "one"],
        ["campaign", "merge", "out", "-o", "one"],
        ["run", "shaken.yaml", "--units", "m/s^2", "--scale", "0.5,1", "-o", "one"],
    ):
        tdint.refused("exists already", *arguments, code=6)
        assert {path.name: path.read_bytes() for path in Path("one").iterdir() if path.name != LOCK} == kept
    Path("out/runs.csv").write_text("mine\n")
    for arguments in (["study.yaml", "-o", "out"], ["export", "out"], ["merge", "out", "-o", "out"]):
        tdint.refused("out/runs.csv: exists already", "campaign", *arguments, code=6)
        assert Path("out/runs.csv").read_text() == "mine\n"
    assert tdint("campaign", "export", "out", "--overwrite").exit_code == 0
    assert tables("out") == done
    assert tdint("campaign", "study.yaml", "-o", "one", "--overwrite").exit_code == 0
    assert tables("one") == done


def test_overwrite_begins_no_campaign_anew_that_is_the_same(done: dict[str, bytes], tdint: Command) -> None:
    assert "nothing to do" in tdint("campaign", "study.yaml", "-o", "out", "--overwrite").stderr
    Path("study.yaml").write_text(STUDY.replace("2.5", "3"))
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 2
    assert tdint("campaign", "study.yaml", "-o", "out", "--overwrite").exit_code == 0
    assert tables("out") != done
