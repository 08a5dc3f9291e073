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

import selection

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

# Reports of all tests have the same date, 14 November 2023, also at midnight.
os.environ.setdefault("SOURCE_DATE_EPOCH", "1700000000")

# If each test process has one processor, threads of linear algebra only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Libraries create many objects, and tests leave little garbage. Collect garbage seldom, because
# each collection visits all objects, and not before the first test (`pytest_collection_finish`).
gc.set_threshold(50_000, 20, 20)
gc.disable()

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

    With several processes, each process runs the files of its part of the suite, so that their
    fixtures are created once. The process that finishes first takes tests from the end of another
    part.
    """
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
    """Draw figures small and without layout and places of legends, which take most of the time.
    tests/output/test_plotting.py tests the layout of all types of figures."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    import legible
    from tdint.output.figures import style

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
        monkeypatch.setattr(style, "_place_legends", lambda figure, max_height: None)


@pytest.fixture
def short_matching(monkeypatch: pytest.MonkeyPatch) -> None:
    """Match motions at few periods in few rounds, for tests of commands and files.
    tests/studies/motions/test_matching.py tests the quality of matched motions."""
    from tdint.studies.motions import matching

    monkeypatch.setattr(matching, "_FIRST_PERIODS", 30)
    monkeypatch.setattr(matching, "_STAGES", 0)
    monkeypatch.setattr(matching, "_MAX_ROUNDS", (3,))


def pytest_configure(config: pytest.Config) -> None:
    """Know the selection of the tests before their files are imported."""
    selection.select_fast(config)


def pytest_pycollect_makeitem(collector: Any, obj: Any) -> list[Any] | None:
    """Create no items of slow and long tests that are not selected."""
    return [] if selection.is_omitted(obj, collector.obj) else None


def pytest_collection_finish() -> None:
    """Exclude imported objects from garbage collection, because they remain in memory, and enable
    the collection."""
    gc.freeze()
    gc.enable()


_FEW_FILES = 3
"""Maximum number of test files whose loops are compiled when a test needs them."""


def _selects_few_files(config: pytest.Config) -> bool:
    """Return True if so few test files are selected that compiling the loops that they need is
    faster than compiling all loops."""
    files = {Path(str(argument).partition("::")[0]) for argument in config.args}
    return (
        not config.getoption("numprocesses", None)
        and len(files) <= _FEW_FILES
        and all(map(Path.is_file, files))
    )


def _is_not_about_compilation(record: logging.LogRecord) -> bool:
    """Return False for messages about compilation, which are not a subject of the tests."""
    return not record.getMessage().startswith(("compiling ", "waiting for another tdint"))


_FRACTURING = ("linear", "bilinear", "tanh", "bouc-wen", "peak-oriented")
"""Laws that fracture in the fast tests. Compiled within a test, each needs a process of its own."""


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile all loops and laws, which users get, before the first test, in parallel, so that none
    is compiled in two processes or within a test."""
    config = session.config
    is_interpreted = os.environ.get("TDINT_KERNELS") == "python"
    if is_interpreted or config.option.collectonly or hasattr(config, "workerinput"):
        return
    if _selects_few_files(config):
        if not any("kernels" in str(argument) for argument in config.args):
            logging.getLogger("tdint").addFilter(_is_not_about_compilation)
        return
    from tdint.kernels.building.load_or_compile import (
        compile_ahead,
        counted,
        list_objects,
        required,
    )
    from tdint.kernels.laws import NAMES
    from tdint.kernels.laws.compiled import compiled_laws
    from tdint.kernels.laws.fracture import FRACTURING
    from tdint.response.runs.analysis_kernels import all_kernels

    kernels = all_kernels()
    kernel, variant = kernels[0]
    fracturing = compiled_laws(NAMES.index(name) + FRACTURING for name in _FRACTURING)
    kernels.append((kernel, variant._replace(laws=fracturing)))
    # Loops that were installed with a wheel are not compiled again.
    objects = zip(required(kernels), list_objects(kernels), strict=True)
    missing = [item for item, (*_, file, _) in objects if not file]
    terminal = config.pluginmanager.get_plugin("terminalreporter") if missing else None
    if terminal:
        terminal.write(f"compiling {counted(missing)} for all tests, once: ", flush=True)
    began = time.perf_counter()
    compile_ahead(kernels if missing else [], ["native"], None, lambda done: None)
    if terminal:
        terminal.write_line(f"{time.perf_counter() - began:.0f} s")
