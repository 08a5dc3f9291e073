"""Campaign stores that are corrupt, edited, locked by other programs, or in a directory with tables
of other commands."""

import json
import os
import shutil
import sqlite3
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, nullcontext
from itertools import product
from pathlib import Path
from time import monotonic

import pytest

from cli.conftest import STUDY, Command, change, made_once, write_folder
from cli.read_only import read_only
from facts import states
from selection import every
from tdint.studies.store import schema as store_schema
from tdint.studies.store.result_store import FILE
from tdint.studies.store.schema import LOCK

TABLES = ("runs.csv", "stories.csv")


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Directory with the completed campaign study.yaml in `out`."""

    def make(folder: Path) -> None:
        write_folder(folder)
        Path("study.yaml").write_text(STUDY.replace("1]", "1, 2.5]") + "outputs: {stories: true}\n")
        Command()("campaign", "study.yaml", "-o", "out", code=0)

    return made_once(tmp_path_factory, make)


@pytest.fixture
def done(study: Path, working_directory: Path) -> dict[str, bytes]:
    """Change to a copy of `study`; return the tables of its campaign."""
    shutil.copytree(study, working_directory, dirs_exist_ok=True)
    return tables("out")


def tables(folder: str) -> dict[str, bytes]:
    return {name: Path(folder, name).read_bytes() for name in TABLES}


def sql(*statements: str) -> None:
    with closing(sqlite3.connect(f"out/{FILE}")) as connection, connection:
        for statement in statements:
            connection.execute(statement)


@pytest.mark.parametrize(
    "statement",
    every(
        3,
        ["DELETE FROM run_rows WHERE scale = 0.5", "DELETE FROM story_rows WHERE story = 2",
         "UPDATE run_rows SET status = '=1+1' WHERE scale = 1",
         "UPDATE run_rows SET peak_drift_m = 9e999 WHERE scale = 1",
         "UPDATE story_rows SET height_m = 4 WHERE story = 1",
         "UPDATE run_rows SET chunk = chunk + 1", "UPDATE run_rows SET chunk = 'x'",
         "UPDATE chunks SET sha256 = ''", "UPDATE chunks SET seconds = -1",
         "UPDATE chunks SET id = id + 1000", "DELETE FROM chunks"],
    ),
)  # fmt: skip
def test_a_corrupt_chunk_is_run_again(
    done: dict[str, bytes], tdint: Command, statement: str
) -> None:
    sql(statement)
    for action in ("status", "export"):
        tdint.refused("chunks of runs are corrupt; call", "campaign", action, "out", code=6)
    assert tables("out") == done
    assert "they are run again" in tdint("campaign", "study.yaml", "-o", "out", code=0).stderr
    assert tables("out") == done
    assert "nothing to do" in tdint("campaign", "study.yaml", "-o", "out").stderr


def test_merge_omits_corrupt_chunks(done: dict[str, bytes], tdint: Command) -> None:
    shutil.copytree("out", "good")
    sql("DELETE FROM run_rows WHERE scale = 0.5")
    assert (
        "corrupt chunks of runs are omitted"
        in tdint("campaign", "merge", "out", "good", "-o", "all", code=0).stderr
    )
    assert tables("all") == done
    tdint("campaign", "merge", "out", "-o", "part", code=5)
    assert not Path("part/campaign.sqlite").exists()
    tdint("campaign", "merge", "out", "-o", "part", "--partial", code=0)
    tdint("campaign", "study.yaml", "-o", "part", code=0)
    assert tables("part") == done


@pytest.mark.parametrize(
    "statement",
    every(
        3,
        ["UPDATE meta SET value = '8' WHERE key = 'schema'", "DELETE FROM meta",
         "DELETE FROM meta WHERE key = 'fingerprint'", "UPDATE buildings SET name = '=1+1'",
         "UPDATE buildings SET name = CAST(x'ff00' AS TEXT)", "UPDATE records SET direction = 2",
         "INSERT INTO unused VALUES('ghost', '')", "DROP TABLE meta", "DROP TABLE story_rows",
         "DROP TABLE written", "DROP VIEW runs",
         "CREATE TRIGGER more AFTER INSERT ON chunks BEGIN DELETE FROM run_rows; END"],
    ),
)  # fmt: skip
def test_an_invalid_store_is_refused_with_a_remedy(
    done: dict[str, bytes], tdint: Command, statement: str
) -> None:
    sql(statement)
    before = Path("out", FILE).read_bytes()
    for arguments in (
        ["study.yaml", "-o", "out"],
        ["status", "out"],
        ["export", "out"],
        ["merge", "out", "-o", "new"],
    ):
        *_, line = tdint("campaign", *arguments, code=6).stderr.splitlines()
        assert "not a valid campaign store" in line
    assert Path("out", FILE).read_bytes() == before
    assert tdint("campaign", "study.yaml", "-o", "out", "--overwrite").exit_code == 0
    assert tables("out") == done


@pytest.mark.long
def test_every_corrupt_page_is_detected(done: dict[str, bytes], tdint: Command) -> None:
    """A page is zeroed or replaced by another page. The store is refused, or the missing runs are
    run again."""
    content = Path("out", FILE).read_bytes()
    size = int.from_bytes(content[16:18], "big")
    pages = [content[at : at + size] for at in range(0, len(content), size)]
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


@pytest.mark.parametrize(
    ("name", "make"),
    [
        (FILE, lambda path: path.write_text("hello\n" * 200)),
        *product((LOCK, FILE), (os.mkfifo, Path.mkdir)),
    ],
)
def test_foreign_files_in_place_of_the_store_or_lock_are_refused(
    done: dict[str, bytes], tdint: Command, name: str, make: Callable[[Path], None]
) -> None:
    file = Path("out", name)
    file.unlink(missing_ok=True)
    make(file)
    result = tdint.refused(str(file), "campaign", "study.yaml", "-o", "out", code=6)
    assert str(file) in result.stderr.splitlines()[-1]
    if name == FILE:
        tdint.refused(str(file), "campaign", "status", "out", code=6)
    assert tables("out") == done


@contextmanager
def locked_by_another() -> Iterator[sqlite3.Connection]:
    """Lock the store as another program does, until the transaction is rolled back."""
    connection = sqlite3.connect(f"out/{FILE}", isolation_level=None)
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield connection
    finally:
        connection.close()


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reduce the waiting times for a lock, without and with a message, to 0.1 and 0.15 s."""
    monkeypatch.setattr(store_schema, "SHORT_WAIT", 100)
    monkeypatch.setattr(store_schema, "_LONG_WAIT", 150)


@pytest.mark.usefixtures("impatient")
def test_reading_requires_no_lock(done: dict[str, bytes], tdint: Command) -> None:
    tdint("campaign", "export", "out")
    with locked_by_another():
        for arguments in (["status", "out"], ["export", "out"], ["study.yaml", "-o", "out"]):
            assert "waiting" not in tdint("campaign", *arguments, code=0).stderr
    assert tables("out") == done


def test_a_store_is_closed_without_waiting_for_other_programs(
    done: dict[str, bytes], tdint: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All data are written before the store is closed. Closing moves them from the log of SQLite to
    the file, and does not wait for a lock."""
    tdint("campaign", "export", "out")
    monkeypatch.setattr(store_schema, "_LONG_WAIT", 60_000)
    start = monotonic()
    with locked_by_another():
        assert "waiting" not in tdint("campaign", "export", "out", code=0).stderr
    assert monotonic() - start < 30.0 and tables("out") == done


@pytest.mark.long
@pytest.mark.usefixtures("impatient")
def test_waiting_for_a_lock_is_reported_and_limited(
    done: dict[str, bytes], tdint: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The wait ends with an error, or with the transaction of the other program."""
    sql("DELETE FROM run_rows WHERE scale = 0.5")
    with locked_by_another():
        tdint.refused("the file is locked by another program", "campaign study.yaml -o out", code=6)
    log_info = store_schema._log.info
    with locked_by_another() as other:
        monkeypatch.setattr(
            store_schema._log, "info", lambda *arguments: (other.rollback(), log_info(*arguments))
        )
        result = tdint("campaign", "study.yaml", "-o", "out", code=0)
    assert states(result.stderr, "locked by another program; ... ten seconds")
    assert tables("out") == done


def test_tables_of_another_command_are_not_replaced(done: dict[str, bytes], tdint: Command) -> None:
    """Tables that existed before the campaign, and tables that were edited later, are kept without
    --overwrite."""
    one_run = ("run", "shaken.yaml", "--units", "m/s^2", "-o", "one")
    tdint(*one_run, code=0)
    before = {path.name: path.read_bytes() for path in Path("one").iterdir()}
    into_one = [("campaign", "study.yaml", "-o", "one"), ("campaign", "merge", "out", "-o", "one")]
    for arguments in (*into_one, (*one_run, "--scale", "0.5,1")):
        tdint.refused("the file exists", *arguments, code=6)
        assert {
            path.name: path.read_bytes() for path in Path("one").iterdir() if path.name != LOCK
        } == before
    Path("out/runs.csv").write_text("mine\n")
    for arguments in (
        ["study.yaml", "-o", "out"],
        ["export", "out"],
        ["merge", "out", "-o", "out"],
    ):
        tdint.refused("out/runs.csv: the file exists", "campaign", *arguments, code=6)
        assert Path("out/runs.csv").read_text() == "mine\n"
    tdint("campaign", "export", "out", "--overwrite", code=0)
    tdint("campaign", "study.yaml", "-o", "one", "--overwrite", code=0)
    assert tables("out") == tables("one") == done


def test_overwrite_does_not_restart_an_unchanged_campaign(
    done: dict[str, bytes], tdint: Command
) -> None:
    assert "nothing to do" in tdint("campaign", "study.yaml", "-o", "out", "--overwrite").stderr
    change("study.yaml", ("2.5", "3"))
    tdint("campaign", "study.yaml", "-o", "out", code=6)
    tdint("campaign", "study.yaml", "-o", "out", "--overwrite", code=0)
    assert tables("out") != done


OTHER = STUDY.replace("1]", "3, 2]")
EARLIER = {
    "nothing": (),
    "another campaign": ("campaign other.yaml -o new",),
    "a shard of another campaign": ("campaign other.yaml --shard 1/2 -o new",),
    "the other shard of another campaign": ("campaign other.yaml --shard 2/2 -o new",),
    "a merged campaign": (
        "campaign other.yaml --shard 1/2 -o x1",
        "campaign other.yaml --shard 2/2 -o x2",
        "campaign merge x1 x2 -o new",
    ),
    "an interrupted campaign": ("campaign other.yaml -o new --max-runs 1",),
    "an interrupted replacement": (
        "campaign other.yaml -o new",
        "campaign third.yaml -o new --overwrite --max-runs 1",
    ),
    "an ida": ("ida shaken.yaml motion.mseed --units m/s^2 --im pga --threshold 1% -o new",),
}
NEW = {
    "campaign": ("campaign study.yaml -o new --overwrite",),
    "shard": ("campaign study.yaml --shard 1/2 -o new --overwrite",),
    "shard in two calls": (
        "campaign study.yaml --shard 1/2 -o new --overwrite --max-runs 1",
        "campaign study.yaml --shard 1/2 -o new --overwrite",
    ),
    "merge": (
        "campaign study.yaml --shard 1/2 -o s1",
        "campaign study.yaml --shard 2/2 -o s2",
        "campaign merge s1 s2 -o new --overwrite",
    ),
    "merge of a part": ("campaign merge out -o new --overwrite --partial",),
}


@pytest.mark.usefixtures("done")
@pytest.mark.parametrize(("earlier", "new"), every(7, product(EARLIER, NEW)))
def test_overwrite_replaces_any_earlier_result(earlier: str, new: str, tdint: Command) -> None:
    """The results are those of the same commands in an empty directory. Repeating the last command
    changes nothing."""
    Path("other.yaml").write_text(OTHER)
    Path("third.yaml").write_text(OTHER.replace("3, 2]", "4]"))
    for line in NEW[new]:
        tdint(*line.replace("-o new", "-o empty").split(), code=0)
    for line in EARLIER[earlier]:
        tdint(*line.split(), code=0)
    before = {path: path.read_bytes() for path in Path("new").glob("*.csv")}
    for line in NEW[new]:
        tdint(*line.split(), code=0)
        if Path("new", f"{FILE}.new").exists():  # the earlier result remains until then
            assert {path: path.read_bytes() for path in Path("new").glob("*.csv")} == before

    def results(folder: str) -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in Path(folder).glob("*.csv")}

    of_ida = {"ida.csv", "capacities.csv", "fractiles.csv"} if earlier == "an ida" else set()
    found = {name: data for name, data in results("new").items() if name not in of_ida}
    assert found == results("empty") != {}
    tdint(*NEW[new][-1].split(), code=0)
    assert {name: results("new")[name] for name in found} == found
    assert not Path("new", f"{FILE}.new").exists()
    tdint("campaign", "status", "new", code=0)


@pytest.mark.usefixtures("done")
def test_merge_into_another_campaign_names_the_remedy(tdint: Command) -> None:
    Path("other.yaml").write_text(OTHER)
    tdint("campaign", "other.yaml", "-o", "new", code=0)
    before = {path: path.read_bytes() for path in Path("new").iterdir()}
    result = tdint.refused(
        "--overwrite to replace it", "campaign", "merge", "out", "-o", "new", code=6
    )
    assert "contains another campaign" in result.stderr
    assert {path: path.read_bytes() for path in Path("new").iterdir()} == before


def kept_open(*statements: str) -> None:
    """Change the store in another process that is killed, so that its log or journal remains."""
    script = (
        "import os, sqlite3, sys\n"
        f"connection = sqlite3.connect({f'out/{FILE}'!r}, isolation_level=None)\n"
        f"for statement in {statements!r}: connection.execute(statement).fetchall()\n"
        "os._exit(0)\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


LEFT_BEHIND: dict[str, Callable[[], None]] = {
    "complete": lambda: None,
    "marked as having a log": lambda: sql("PRAGMA journal_mode=WAL"),
    "log of a killed process": lambda: kept_open(
        "PRAGMA journal_mode=WAL", "INSERT INTO written VALUES('x', 'y')"
    ),
    "log without shared memory": lambda: (
        kept_open("PRAGMA journal_mode=WAL", "INSERT INTO written VALUES('x', 'y')"),
        Path("out", f"{FILE}-shm").unlink(),
    ),
    "journal of a killed process": lambda: kept_open(
        "PRAGMA cache_size=1",
        "PRAGMA cache_spill=1",
        "BEGIN",
        "UPDATE run_rows SET peak_drift_m = 1.0",
        "UPDATE story_rows SET height_m = 1.0",
        "CREATE TABLE large AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n "
        "LIMIT 20000) SELECT i, hex(randomblob(20)) AS text FROM n",
    ),
}
"""States in which processes leave a store: a closed store, a killed reader or writer."""


def names(folder: str) -> set[str]:
    return {path.name for path in Path(folder).iterdir()}


@pytest.mark.parametrize("state", every(3, LEFT_BEHIND))
@pytest.mark.parametrize("medium", ["writable", "read-only"])
def test_every_command_reads_a_store_anywhere_and_leaves_nothing(
    done: dict[str, bytes], tdint: Command, state: str, medium: str
) -> None:
    assert names("out") <= {FILE, LOCK, "runs.csv", "stories.csv", "profiles.csv", "summary.json"}
    LEFT_BEHIND[state]()
    before, content = names("out"), Path("out", FILE).read_bytes()
    with read_only(Path("out")) if medium == "read-only" else nullcontext():
        assert "of 9 runs completed" in tdint("campaign", "status", "out", code=0).stderr
        tdint("campaign", "merge", "out", "-o", "merged", code=0)
        tdint("sensitivity", "out", code=2)  # the campaign varies no parameter
        if medium == "read-only":
            tdint.refused("no permission to write ... merge", "campaign", "export", "out", code=6)
            assert names("out") == before and Path("out", FILE).read_bytes() == content
    assert tables("merged") == done
    # Commands that may write to the directory remove the log of a killed process.
    if medium == "writable":
        assert names("out") <= before and not list(Path("out").glob("*-*"))


@pytest.mark.parametrize("name", [FILE, LOCK])
def test_a_journal_that_names_another_file_is_refused(
    done: dict[str, bytes], tdint: Command, name: str
) -> None:
    """SQLite deletes the file that such a journal names, if it reverses its transaction."""
    Path("victim").write_text("mine")
    if name == LOCK:
        shutil.copy(f"out/{FILE}", f"out/{LOCK}")
    script = (
        "import os, sqlite3\n"
        f"connection = sqlite3.connect({f'out/{name}'!r}, isolation_level=None)\n"
        "connection.execute('PRAGMA cache_size=1')\n"
        "connection.execute('BEGIN')\n"
        "connection.execute('CREATE TABLE large AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL '\n"
        "    'SELECT i + 1 FROM n LIMIT 20000) SELECT i, hex(randomblob(20)) AS text FROM n')\n"
        "os._exit(0)\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True)
    victim = str(Path("victim").absolute()).encode()
    page = int.from_bytes(Path("out", name).read_bytes()[16:18], "big")
    end = (
        struct.pack(">I", 2**30 // page + 1) + victim + struct.pack(">II", len(victim), sum(victim))
    )
    with Path("out", f"{name}-journal").open("ab") as stream:
        stream.write(end + bytes.fromhex("d9d505f920a163d7"))
    lines = [["study.yaml", "-o", "out"], ["merge", "out", "-o", "out"]]
    if name == FILE:
        lines += [["status", "out"], ["export", "out"], ["merge", "out", "-o", "new"]]
    for line in lines:
        message = tdint("campaign", *line, code=6).stderr
        assert f"{name}-journal was not written by tdint" in message
        assert Path("victim").read_text() == "mine"


def test_a_store_that_cannot_be_read_is_reported(
    done: dict[str, bytes], tdint: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    access = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.R_OK and access(path, mode))
    tdint.refused("no permission to read the file", "campaign", "status", "out", code=6)


@pytest.mark.long
def test_a_call_without_runs_keeps_the_execution_of_the_time_loops(
    done: dict[str, bytes], tdint: Command
) -> None:
    """Each call is a separate process, of which only the first executes time loops."""

    def recorded(folder: str) -> object:
        return json.loads(Path(folder, "summary.json").read_text())["time_loops"]

    execution = recorded("out")
    assert execution in ("compiled", "interpreted")
    lines = [
        ["campaign", "study.yaml", "-o", "out"],
        ["campaign", "export", "out"],
        ["campaign", "merge", "out", "-o", "new"],
    ]
    for line in lines:
        script = f"import sys; sys.argv[1:] = {line!r}\nfrom tdint_cli.main import main; main()"
        subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)
        assert recorded(line[-1]) == execution
