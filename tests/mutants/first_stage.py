"""First stage of the mutants of kernels: tests in one process, without compiled loops.

pytest collects the tests once, with unchanged sources. Each mutant is tried in a copy of this
process (`os.fork`), which replaces the code of the changed function and runs the tests that execute
the changed line until one fails. Tests that take the least time are first. Changes outside of
functions, such as constants of a module, need a new import; they are tried in a new process.
"""

import ast
import json
import os
import resource
import signal
import sys
import time
import traceback
import types
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

CPU_SECONDS = 4.0
"""Time limit of a test, in addition to three times its time with unchanged sources, s of CPU time.
A mutant that exceeds the limit is counted as killed."""

Lines = dict[str, list[int]]
"""Executed lines by file."""


@dataclass
class Test:
    """Test of the first stage.

    Attributes
    ----------
    seconds : float
        CPU time with unchanged sources.
    lines : dict
        Executed lines of each kernel module; the names of the modules are those of the journal.
    """

    seconds: float
    lines: Lines


@dataclass
class Mutant:
    """Changed module.

    Attributes
    ----------
    module : str
        Name of the module in the journal, such as laws/gap.
    text : str
        Source of the module with the change.
    first, last : int
        Lines of the changed statement in the unchanged source.
    function : str
        Name of the changed function; an empty text if the change is outside of a function.
    """

    module: str
    text: str
    first: int
    last: int
    function: str

    def tests(self, measured: dict[str, Test]) -> list[str]:
        """Return the names of the tests that execute the changed statement; the fastest test is
        first. For a change outside of a function, and for a statement that is executed only during
        the import, return the tests that execute the module, and those that execute no kernel.
        The list of the laws (laws/__init__) contains no kernel."""
        statement = range(self.first, self.last + 1)
        lines = {name: test.lines.get(self.module, ()) for name, test in measured.items()}
        found = [name for name in measured if any(line in statement for line in lines[name])]
        if not self.function or not found:
            self.function = ""
            found = [
                name
                for name, test in measured.items()
                if lines[name] or set(test.lines) <= {"laws/__init__"}
            ]
        return sorted(found, key=lambda name: (measured[name].seconds, name))


def changed_place(source: str, place: int) -> tuple[int, int, str]:
    """Return the lines of the statement that contains a node, and the name of the function.

    Parameters
    ----------
    source : str
        Source of a module.
    place : int
        Index of the node in `ast.walk`.

    Returns
    -------
    int, int
        First and last line. For a statement with a body, such as a loop, the lines of the body are
        excluded.
    str
        Name of the function that contains the statement; an empty text for other places, which
        include default values and decorators.
    """
    tree = ast.parse(source)
    node = list(ast.walk(tree))[place]
    function = ""
    for top in tree.body:
        if isinstance(top, ast.FunctionDef) and any(
            node is inner for part in top.body for inner in ast.walk(part)
        ):
            function = top.name
    first, last, size = node.lineno, node.end_lineno, float("inf")
    for statement in ast.walk(tree):
        if not isinstance(statement, ast.stmt) or isinstance(statement, ast.FunctionDef):
            continue
        body = getattr(statement, "body", None)
        own = [
            child
            for child in ast.iter_child_nodes(statement)
            if not isinstance(child, ast.stmt) and any(node is inner for inner in ast.walk(child))
        ]
        length = statement.end_lineno - statement.lineno
        if own and length < size:
            first, size = statement.lineno, length
            last = body[0].lineno - 1 if body else statement.end_lineno
            last = max(first, last)
    return first, last, function


def _function(module: types.ModuleType, name: str) -> types.FunctionType | None:
    """Return a function of a module; None if another object has its name."""
    found = getattr(module, name, None)
    found = getattr(found, "function", found)  # a kernel
    return found if isinstance(found, types.FunctionType) and found.__name__ == name else None


def replace_code(mutant: Mutant) -> bool:
    """Replace the code of the changed function in this process.

    Functions that a function has defined during the import cannot be replaced.

    Returns
    -------
    bool
        False if this is impossible, and the module must be imported again.
    """
    module = sys.modules[f"tdint.kernels.{mutant.module.replace('/', '.')}"]
    function = _function(module, mutant.function) if mutant.function else None
    compiled = compile(mutant.text, str(module.__file__), "exec", dont_inherit=True)
    codes = [
        code
        for code in compiled.co_consts
        if isinstance(code, types.CodeType) and code.co_name == mutant.function
    ]
    if function is None or len(codes) != 1:
        return False
    # A decorator has replaced the function.
    if codes[0].co_freevars != function.__code__.co_freevars:
        return False
    if any(
        isinstance(inner, types.CodeType) and not inner.co_name.startswith("<")
        for inner in codes[0].co_consts
    ):
        return False
    function.__code__ = codes[0]
    return True


class Session:
    """Plugin of pytest that runs a function instead of the collected tests.

    Parameters
    ----------
    work : function
        Called with this object after the collection.
    """

    def __init__(self, work: Callable[["Session"], None]) -> None:
        self._work = work
        self._failed = False
        self.items: dict[str, pytest.Item] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._failed |= report.failed

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        if session.testsfailed:
            raise session.Interrupted(f"{session.testsfailed} errors during collection")
        self.items = {item.nodeid: item for item in session.items}
        self._work(self)
        return True

    def run(self, names: list[str]) -> Iterator[tuple[str, bool]]:
        """Run tests, and yield the name of each and True if it failed."""
        items = [self.items[name] for name in names]
        following_items = [*items, None][1:]
        for item, following in zip(items, following_items, strict=True):
            self._failed = False
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            yield item.nodeid, self._failed


def collect(tests: list[str], package: Path, work: Callable[[Session], None]) -> int:
    """Collect tests without compiled loops, call `work`, and return the exit code of pytest.

    Parameters
    ----------
    tests : list of str
        Arguments of pytest.
    package : Path
        Directory that contains the package `tdint`.
    work : function
        Called with the session.
    """
    os.environ.update(TDINT_KERNELS="python", OPENBLAS_NUM_THREADS="1", TDINT_COMPILE="wait")
    sys.path.insert(0, str(package))
    os.chdir(ROOT)
    arguments = ["-q", "-p", "no:cacheprovider", "-p", "no:faulthandler", *tests]
    return int(pytest.main(arguments, plugins=[Session(work)]))


def in_copy(compute: Callable[[], object], output: Path) -> int:
    """Start a copy of this process that writes the result of a function as JSON, and return the id
    of the copy. The copy prints nothing."""
    sys.stdout.flush()
    child = os.fork()
    if child:
        return child
    status = 1
    try:
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 1)
        os.dup2(nothing, 2)
        output.write_text(json.dumps(compute()), "utf-8")
        status = 0
    except BaseException:
        output.with_suffix(".error").write_text(traceback.format_exc(), "utf-8")
    finally:
        os._exit(status)


def measure(session: Session, names: list[str], kernels: Path) -> dict[str, object]:
    """Run tests with unchanged sources, and return the failed tests, and the CPU time and the
    executed lines of each test.

    Parameters
    ----------
    session : Session
        Collected tests.
    names : list of str
        Names of the tests.
    kernels : Path
        Directory of the kernels.
    """
    from coverage import Coverage

    coverage = Coverage(data_file=None, config_file=False, include=[f"{kernels}/*"])
    found, failed = {}, []
    began = time.process_time()
    coverage.start()
    for name, failure in session.run(names):
        coverage.stop()
        with warnings.catch_warnings(action="ignore"):  # a test may execute no kernel
            data = coverage.get_data()
        found[name] = {
            "seconds": time.process_time() - began,
            "lines": {
                Path(file).relative_to(kernels).with_suffix("").as_posix(): data.lines(file)
                for file in data.measured_files()
            },
        }
        if failure:
            failed.append(name)
        coverage.erase()
        began = time.process_time()
        coverage.start()
    coverage.stop()
    return {"tests": found, "failed": failed}


def first_failure(session: Session, names: list[str], measured: dict[str, Test]) -> str:
    """Return the name of the first test that fails; an empty text if all pass.

    The process is ended by SIGXCPU if a test exceeds its time limit.
    """
    signal.signal(signal.SIGXCPU, signal.SIG_DFL)
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)

    def limit(name: str) -> None:
        seconds = time.process_time() + CPU_SECONDS + 3.0 * measured[name].seconds
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1, hard))

    if names:
        limit(names[0])
    for (name, failed), following in zip(session.run(names), [*names, ""][1:], strict=True):
        if failed:
            return name
        if following:
            limit(following)
    return ""


def result_of(child: int, output: Path) -> object:
    """Wait for a process of `in_copy`, and return its result; None if a signal ended the process.

    Raises
    ------
    RuntimeError
        The function raised an exception.
    """
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return None
    if not output.exists():
        raise RuntimeError(output.with_suffix(".error").read_text("utf-8"))
    return json.loads(output.read_text("utf-8"))


def main() -> None:
    """Try the mutant of a package in a new process.

    The arguments are the directory of the package, a JSON file with the times of the tests in the
    order in which they run, and the file for the name of the first test that fails.
    """
    package, given, output = map(Path, sys.argv[1:])
    measured = {
        name: Test(seconds, {}) for name, seconds in json.loads(given.read_text("utf-8")).items()
    }
    names = list(measured)
    files = sorted({name.partition("::")[0] for name in names})

    def work(session: Session) -> None:
        output.write_text(json.dumps(first_failure(session, names, measured)), "utf-8")

    collect(files, package, work)


if __name__ == "__main__":
    main()
