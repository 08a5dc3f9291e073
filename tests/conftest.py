"""What all tests have in common."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest

# The tests integrate so many different buildings that one variant of each kernel is compiled sooner than all that they
# need. What a scene alone would get is tested in tests/kernels/test_variants.py.
os.environ.setdefault("TDINT_KERNELS", "whole")

# Jobs that a script starts in the background, as .ci/run does, ignore an interrupt, and hand that on to what they
# start: commands that a test interrupts would never end.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the kernels before the first of several tests: side by side, and none of them in two processes.

    Only where more than one file of tests is asked for; a test alone compiles what it meets.
    """
    config = session.config
    files = {name.partition("::")[0] for name in config.args}
    alone = len(files) == 1 and Path(*files).suffix == ".py"
    written_ones = os.environ["TDINT_KERNELS"] == "python"
    if alone or written_ones or config.option.collectonly or hasattr(config, "workerinput"):
        return
    from path_kernels import KERNELS
    from tdint.analysis.run.compilation import of_everything
    from tdint.kernels.building.ahead import compile_ahead
    from tdint.kernels.building.variant import EVERYTHING

    wanted = [*of_everything(), *((kernel, EVERYTHING) for kernel in KERNELS)]
    began = time.perf_counter()
    written = compile_ahead(wanted, ["native"], None, lambda done: None)
    terminal = config.pluginmanager.get_plugin("terminalreporter")
    if written and terminal:
        terminal.write_line(f"{len(written)} time loops compiled for all tests in {time.perf_counter() - began:.0f} s")
