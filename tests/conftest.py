"""Common fixtures and settings of all tests."""

import gc
import logging
import os
import shutil
import signal
import sys
import time
from pathlib import Path
from typing import Any

import platformdirs
import pytest
from hypothesis import settings

# Container images often forbid bytecode files to stay small. Without these files, each process that
# a test starts would parse the package again, and pytest would rewrite all assertions again.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# Compiled loops are stored in a separate directory: in the cache of the user they would replace the
# user's own loops. All clones share the directory, because names of loops contain a hash of their
# sources.
os.environ.setdefault(
    "TDINT_CACHE_DIR", str(platformdirs.user_cache_path("tdint-tests", appauthor=False))
)

# Runs wait until their loops are compiled. By default, a short run is interpreted meanwhile.
os.environ.setdefault("TDINT_COMPILE", "wait")

# If each test process has one processor, threads of linear algebra only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Libraries create many objects, and tests leave little garbage. Collect garbage seldom, because
# each collection visits all objects.
gc.set_threshold(50_000, 20, 20)

# Examples have no time limit, because they take longer on a busy machine.
settings.register_profile("any machine", deadline=None, max_examples=50)
settings.load_profile("any machine")

# Background jobs of a script such as .ci/run ignore interrupts, and so do their child processes.
# Restore the default: otherwise commands that a test interrupts would never end.
signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP"):  # nohup causes the same for hang-up signals.
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Set the environment before the first import of tdint.

    Most tests integrate many different buildings, and compiling one variant of each kernel for all
    buildings is faster than compiling the specific variants (tests/kernels/test_variants.py tests
    specific variants). Tests that are selected by name, and files of command tests, need only a few
    specific kernels. In a fresh clone, files with short runs are tested without compilation.

    With several processes, each process runs the files of its part of the suite, so that their
    fixtures are created once. The process that finishes first takes tests from the end of another
    part.
    """
    if "TDINT_KERNELS" not in os.environ:
        os.environ["TDINT_KERNELS"] = _kernels_of(config)
    if _has_space(_MEMORY_FILES):
        os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(_MEMORY_FILES))
    if config.getoption("numprocesses", None) and config.getoption("dist", "") == "no":
        config.option.dist = "worksteal"


_MEMORY_FILES = Path("/dev/shm")
"""File system in memory of Linux. Stores of runs wait for the disk after each transaction, and half
of the tests create a directory."""
_REQUIRED_SPACE = 2e9
"""Free space (bytes) for the files of the tests; pytest keeps those of the last three calls, which
need 0.2e9 bytes. Containers may have 64e6 bytes of memory files."""


def _has_space(directory: Path) -> bool:
    """Return True if a directory exists, can be written, and has the space for all tests."""
    return os.access(directory, os.W_OK) and shutil.disk_usage(directory).free > _REQUIRED_SPACE


@pytest.fixture
def laid_out() -> None:
    """Keep the complete layout of figures in a test that also uses `not_laid_out`."""


@pytest.fixture
def not_laid_out(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw figures small and without layout, which takes a third of the time.
    tests/output/test_plotting.py tests the layout of all types of figures."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    import legible

    savefig = Figure.savefig

    def save(self: Figure, *arguments: Any, **options: Any) -> None:
        self.set_layout_engine(None)
        legible.check(self)
        savefig(
            self, *arguments, **options | ({"dpi": 40} if options.get("format") == "png" else {})
        )

    if "laid_out" not in request.fixturenames:
        monkeypatch.setattr(Figure, "savefig", save)
        monkeypatch.setattr(ConstrainedLayoutEngine, "execute", lambda engine, figure: None)


@pytest.fixture
def short_matching(monkeypatch: pytest.MonkeyPatch) -> None:
    """Match motions at few periods in few rounds, for tests of commands and files.
    tests/studies/motions/test_matching.py tests the quality of matched motions."""
    from tdint.studies.motions import matching

    monkeypatch.setattr(matching, "_FIRST_PERIODS", 30)
    monkeypatch.setattr(matching, "_STAGES", 0)
    monkeypatch.setattr(matching, "_MAX_ROUNDS", (3,))


def pytest_collection_finish() -> None:
    """Exclude imported objects from garbage collection, because they remain in memory."""
    gc.freeze()


_FEW_FILES = 3
"""Maximum number of test files whose own loops are compiled faster than the loops for all laws."""


def _selects_few_files(config: pytest.Config) -> bool:
    """Return True if so few test files are selected that compiling their specific kernels is faster
    than compiling all loops."""
    files = {Path(str(argument).partition("::")[0]) for argument in config.args}
    return (
        not config.getoption("numprocesses", None)
        and len(files) <= _FEW_FILES
        and all(map(Path.is_file, files))
    )


_SHORT_COMMANDS = (
    *("against", "errors", "floors", "grammar", "inventory", "isolators", "law", "limits"),
    *("output_units", "rotation", "run", "sequence", "spectrum"),
)
_SHORT_RUNS = {
    "tests/response/runs/test_steps.py",
    "tests/model/test_limits.py",
    *(f"tests/cli/test_{name}.py" for name in _SHORT_COMMANDS),
}
"""Files of tests with short runs. Without compilation they need less time than a compilation."""


def _kernels_of(config: pytest.Config) -> str:
    """Return the setting TDINT_KERNELS for the selected tests: whole, python, or specific kernels
    (empty)."""
    arguments = list(map(str, config.args))
    if not _selects_few_files(config):
        return "whole"
    root = Path(__file__).parents[1]
    files = {Path(argument.partition("::")[0]).resolve() for argument in arguments}
    if all(file.is_relative_to(root) for file in files):
        names = {file.relative_to(root).as_posix() for file in files}
        if names <= _SHORT_RUNS:
            return "" if _is_compiled() else "python"
    is_few = all("::" in argument or "/cli/" in argument for argument in arguments)
    return "" if is_few else "whole"


def _is_compiled() -> bool:
    """Return True if a time loop for all buildings was compiled from the present sources, by an
    earlier run of all tests."""
    from tdint.kernels.building import compilable, load_or_compile
    from tdint.kernels.time_loop.loop import integrate

    return bool(load_or_compile.list_objects([(integrate, compilable.EVERYTHING)])[0][2])


def _is_not_about_compilation(record: logging.LogRecord) -> bool:
    """Return False for messages about compilation, which are not a subject of the tests."""
    return not record.getMessage().startswith(("compiling ", "waiting for another tdint"))


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the kernels before the first test, in parallel, so that no kernel is compiled in two
    processes or within a test."""
    config = session.config
    is_interpreted = os.environ["TDINT_KERNELS"] == "python"
    if is_interpreted or config.option.collectonly or hasattr(config, "workerinput"):
        return
    if _selects_few_files(config):
        if not any("kernels" in str(argument) for argument in config.args):
            logging.getLogger("tdint").addFilter(_is_not_about_compilation)
        return
    from tdint.kernels.building.load_or_compile import compile_ahead, list_objects
    from tdint.response.runs.analysis_kernels import all_kernels

    # Loops that were installed with a wheel are not compiled again.
    missing = [pair for pair in all_kernels() if not list_objects([pair])[0][2]]
    terminal = config.pluginmanager.get_plugin("terminalreporter") if missing else None
    if terminal:
        terminal.write(f"compiling {len(missing)} time loops for all tests, once: ", flush=True)
    began = time.perf_counter()
    compile_ahead(missing, ["native"], None, lambda done: None)
    if terminal:
        terminal.write_line(f"{time.perf_counter() - began:.0f} s")
