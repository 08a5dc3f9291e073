"""What all tests have in common."""

from __future__ import annotations

import os
import signal

import pytest

# The tests integrate so many different buildings that one variant of each kernel is compiled sooner than all that they
# need. What a scene alone would get is tested in tests/kernels/test_variants.py.
os.environ.setdefault("TDINT_KERNELS", "whole")

# Jobs that a script starts in the background, as .ci/run does, ignore an interrupt, and hand that on to what they
# start: commands that a test interrupts would never end.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure(config: pytest.Config) -> None:
    """Compile all kernels before several processes of the whole suite would each compile what they meet first."""
    several = getattr(config.option, "numprocesses", None) and not hasattr(config, "workerinput")
    if several and not config.option.collectonly and config.args_source is pytest.Config.ArgsSource.TESTPATHS:
        from tdint.analysis.run.compilation import of_everything
        from tdint.kernels.building.ahead import compile_ahead

        compile_ahead(of_everything(), ["native"], None, lambda done: None)
