"""Execution of commands in this process, with separate standard error and standard output."""

import inspect
from typing import Any

from click.testing import CliRunner

# click before 8.2 mixes standard error into standard output by default.
_APART: dict[str, Any] = (
    {"mix_stderr": False} if "mix_stderr" in inspect.signature(CliRunner).parameters else {}
)


def runner() -> CliRunner:
    """Return a runner for commands whose results have stdout and stderr."""
    return CliRunner(**_APART)
