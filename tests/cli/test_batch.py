"""Commands with several records: directories, names of outputs, processes, the JSON summary."""

import json
import os
import sys
import time
from functools import partial
from multiprocessing.connection import Connection

import pytest

from cli.conftest import at_a_terminal
from facts import states
from selection import every
from tdint.errors import AnalysisError, RecordError
from tdint_cli import processes
from tdint_cli.commands.spectrum import tables_of
from tdint_cli.processes import Task, outcomes, worker

PERIODS = ("--period", "0.2", "--period", "1.0")


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture
def many(folder, make_record):
    """Directory `many` with four valid and two invalid records, and files that are no records."""
    (folder / "many").mkdir()
    for i in range(4):
        make_record(folder / "many" / f"r{i}.mseed", "HNE", "HNN", peak=1.0 + i)
    make_record(folder / "many" / "counts.mseed", "HNE", integer=True)
    (folder / "many" / "r1a.mseed").write_bytes((folder / "many" / "r1.mseed").read_bytes()[:-100])
    (folder / "many" / "README.md").write_text("Records\n")
    (folder / "many" / ".hidden.mseed").write_bytes((folder / "other.mseed").read_bytes())
    (folder / "many" / "deeper").mkdir()
    os.mkfifo(folder / "many" / "pipe")
    return folder / "many"


def test_a_directory_is_replaced_by_its_records(many, tdint):
    """A directory as argument gives the same table, summary and errors as its record files."""
    result = tdint("spectrum", "many/", *PERIODS)
    names = [f"many/{name}.mseed" for name in ("counts", "r0", "r1", "r1a", "r2", "r3")]
    one_by_one = tdint("spectrum", *names, *PERIODS)
    assert (result.exit_code, result.stdout) == (4, one_by_one.stdout)
    messages = result.stderr.splitlines()
    messages.remove(
        "note: many/: not used: README.md (document); deeper/ (directory); pipe (no regular file)"
    )
    messages.remove("note: 4 of 8 files used")
    one_by_one_messages = one_by_one.stderr.splitlines()
    one_by_one_messages.remove("note: 4 of 6 files used")
    assert messages == one_by_one_messages
    assert [line.split(": ")[1] for line in messages if line.startswith("Error")] == [
        names[0],
        names[3],
    ]
    tdint("spectrum", "many", *PERIODS, "-o", "all.csv", code=4)
    summary = json.loads((many.parent / "all.json").read_text())
    assert [(record["file"], record["component"]) for record in summary["records"]] == [
        (f"many/r{i}.mseed", component) for i in range(4) for component in ("HNE", "HNN")
    ]
    assert all("m/s^2 is assumed" in record["warnings"][0] for record in summary["records"])
    assert {record["units_from"] for record in summary["records"]} == {"assumed"}


def test_directories_without_records_or_with_an_unreadable_record_are_reported(folder, tdint):
    for name in ("none", "some"):
        (folder / name).mkdir()
    for number in range(12):
        (folder / "none" / f"{number:02d}.md").write_text("words\n")
    (folder / "some" / "a.mseed").write_bytes((folder / "other.mseed").read_bytes())
    (folder / "some" / "b.mseed").write_bytes(b"")
    result = tdint("info", "none", "some", "--units", "m/s^2", code=4)
    assert len(result.stdout.splitlines()) == 2
    none, some = (line for line in result.stderr.splitlines() if line.startswith("Error: "))
    assert states(none, "Error: none: no record found ... 00.md, 01.md")
    assert none.endswith("09.md and 2 more (document)")
    assert some.startswith("Error: some/b.mseed: ") and "empty" in some


@pytest.mark.parametrize("into", every(2, [None, "all.csv", "out/"]))
@pytest.mark.parametrize(
    "command", [("info",), ("spectrum", *PERIODS), ("drift-spectrum", *PERIODS)], ids=lambda c: c[0]
)
def test_a_bad_record_does_not_stop_the_good_ones(folder, tdint, make_record, command, into):
    """Bad records are reported and skipped. If all records are bad, there is no output."""
    make_record(folder / "counts.mseed", "HNE", integer=True)
    (folder / "broken.mseed").write_bytes(b"\x00" * 100)
    # `info` does not write to a directory.
    into = "all.csv" if into and command[0] == "info" else into
    options = ["-o", into] if into else []
    bad = ["counts.mseed", "missing.mseed", "broken.mseed"]
    tdint.refused("Error: missing.mseed: ", *command, *bad, *options, code=4)
    result = tdint(*command, bad[0], "motion.mseed", *bad[1:], "other.mseed", *options, code=4)
    errors = [line for line in result.stderr.splitlines() if line.startswith("Error")]
    assert [line.split(":")[1].strip() for line in errors] == bad
    good = tdint(*command, "motion.mseed", "other.mseed").stdout
    if into == "out/":
        assert sorted(contents(folder / "out")) == [
            "motion.csv", "motion.json", "other.csv", "other.json",
        ]  # fmt: skip
    else:
        assert (result.stdout if into is None else (folder / "all.csv").read_text()) == good


def test_records_with_equal_stems_keep_their_suffix(folder, tdint):
    """In K-NET files, the components of a station have equal stems: x.EW and x.NS."""
    for suffix in ("EW", "NS"):
        (folder / f"x.{suffix}").write_bytes((folder / "other.mseed").read_bytes())
    tdint("spectrum", "x.EW", "other.mseed", "x.NS", *PERIODS, "-o", "out/", "--plot", code=0)
    assert sorted(contents(folder / "out")) == [
        f"{stem}.{suffix}"
        for stem in ("other", "x.EW", "x.NS")
        for suffix in ("csv", "json", "png")
    ]


def test_output_names_that_still_clash_are_refused(tmp_path):
    assert [
        table.name for table in tables_of(["a/x.EW", "b/x.NS", "-", "stdin.at2"], tmp_path)
    ] == ["x.EW.csv", "x.NS.csv", "stdin.csv", "stdin.at2.csv"]
    for clash in (["x.EW", "x.NS", "x.EW.mseed"], ["a/x.EW", "b/x.EW"]):
        with pytest.raises(Exception, match="would be written to this file"):
            tables_of(clash, tmp_path)


@pytest.mark.long
@pytest.mark.parametrize(
    ("command", "into"),
    [
        ("spectrum", "out/"),
        ("spectrum", "all.csv --plot"),
        ("spectrum", None),
        pytest.param("spectrum", "out/ --plot", marks=pytest.mark.slow),
        ("spectrum --ductility 2,4", None),
        ("drift-spectrum --stories 3", None),
    ],
)
def test_the_outputs_do_not_depend_on_the_number_of_processes(many, tdint, command, into):
    results, written = [], []
    for jobs in (1, 3):
        directory = many.parent / str(jobs)
        directory.mkdir()
        options = ["-o", *f"{jobs}/{into}".split()] if into else []
        result = tdint(*command.split(), "many", "other.mseed", *PERIODS, "--jobs", jobs, *options)
        results.append((result.exit_code, result.stdout, result.stderr))
        written.append(
            {file.name: file.read_bytes() for file in directory.rglob("*") if file.is_file()}
        )
    assert results[0] == results[1]
    assert results[0][0] == 4
    for typed, expected in ((b'"-o", "1/', b'"-o", "3/'), (b" -o 1/", b" -o 3/")):
        written[0] = {name: data.replace(typed, expected) for name, data in written[0].items()}
    assert written[0] == written[1]


# Execution of a batch in processes


def double(factor, task):
    """Replace the processing of a record."""
    if task.source == "bad":
        raise RecordError("bad: no")
    if task.source == "unstable":
        raise AnalysisError("diverged")
    if task.source == "dies":
        os._exit(9)
    return factor * task.source, os.getpid()


def run_batch(sources, jobs):
    tasks = [Task(source) for source in sources]
    with outcomes(partial(double, 2), tasks, jobs=jobs, label="", to_terminal=True) as results:
        return list(results)


def test_results_and_failures_are_returned_in_order():
    sources = ["bad", "a", "unstable", "b", "c", "-"]
    found = run_batch(sources, 2)
    assert [str(item) if isinstance(item, Exception) else item[0] for item in found] == [
        "bad: no", "aa", "unstable: diverged", "bb", "cc", "--",
    ]  # fmt: skip
    processes = [item[1] for item in found if not isinstance(item, Exception)]
    assert processes[0] == processes[-1] == os.getpid()
    assert os.getpid() not in processes[1:-1]


def test_a_killed_process_loses_only_its_own_record():
    found = run_batch(["a", "dies", "b", "dies", "c", "d"], 2)
    assert [
        item if isinstance(item, Exception) else item[0]
        for item in (found[0], *found[2::2], found[5])
    ] == ["aa", "bb", "cc", "dd"]
    for failure in (found[1], found[3]):
        assert isinstance(failure, AnalysisError)
        assert states(str(failure), "dies: ... process ... ended unexpectedly")


@pytest.fixture
def cut(monkeypatch):
    """End each process in the middle of a result that contains the text of the list."""
    send_all, first, texts = Connection._send, os.getpid(), []

    def send(connection, content):
        if os.getpid() != first and any(text in content for text in texts):
            os.write(connection.fileno(), content[: len(content) // 2])
            os._exit(9)
        send_all(connection, content)

    monkeypatch.setattr(Connection, "_send", send)
    return texts


FORKED = pytest.mark.skipif(
    sys.platform != "linux", reason="forked processes inherit the changed method"
)


@FORKED
def test_a_process_that_ends_in_the_middle_of_a_result_loses_only_its_own_record(cut):
    """The other process keeps its end of a shared pipe open, so that this pipe would not end."""
    cut.append(b"cutcut")
    found = run_batch(["a", "cut", "b", "c"], 2)
    assert [item[0] for item in (found[0], *found[2:])] == ["aa", "bb", "cc"]
    assert states(str(found[1]), "cut: ... process ... ended unexpectedly")


@FORKED
def test_spectrum_ends_if_a_process_ends_in_the_middle_of_a_result(cut, tdint, tmp_path):
    names = [f"{letter}.csv" for letter in "abcd"]
    for name in names:
        (tmp_path / name).write_text("# dt = 0.01 s, units = m/s^2\n" + "0.1\n-0.2\n" * 20)
    cut.append(b"b.csv")
    files = [str(tmp_path / name) for name in names]
    result = tdint("spectrum", "--period", "1", *files, "--jobs", "2", code=5)
    assert states(result.stderr, "b.csv: ... process ... ended unexpectedly")
    assert [name in result.stdout for name in names] == [True, False, True, True]


def test_an_unexpected_exception_in_a_process_is_raised():
    with pytest.raises(TypeError):
        run_batch(["a", None, "b"], 2)


def own_number(first):
    """Return the number of this process, or end it if it is not the process `first`."""
    if first not in (None, os.getpid()):
        os._exit(9)
    return os.getpid()


def test_a_worker_computes_one_call_and_its_loss_is_made_up(monkeypatch):
    with worker() as begin:
        assert begin(own_number, None)() != os.getpid()
        assert begin(own_number, os.getpid())() == os.getpid()

    def no_process():
        raise BlockingIOError

    monkeypatch.setattr(processes, "_Worker", no_process)
    with worker() as begin:
        assert begin(own_number, None)() == os.getpid()


class SlowToPickle:
    """Argument whose values could change while another thread pickles it."""

    def __init__(self):
        self.values = {}

    def __getstate__(self):
        time.sleep(0.2)
        return self.__dict__


def values_of(argument):
    return argument.values


def test_a_worker_gets_the_argument_as_it_was_when_the_call_started():
    argument = SlowToPickle()
    with worker() as begin:
        result = begin(values_of, argument)
        argument.values["later"] = 1.0
        assert result() == {}


@pytest.mark.skipif(sys.platform == "win32", reason="terminals")
@pytest.mark.long
def test_a_progress_bar_is_drawn_on_a_terminal(folder):
    output, code = at_a_terminal(
        "spectrum motion.mseed other.mseed --period 1 -o out/ --jobs 2", False
    )
    assert (code, b"2/2" in output, b"##" in output) == (0, True, True)
