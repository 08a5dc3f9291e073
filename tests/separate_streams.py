"""Commands in this process, with standard error apart from standard output."""

import inspect
from typing import Any

from click.testing import CliRunner

# click before 8.2 mixes standard error into standard output unless told not to.
_APART: dict[str, Any] = (
    {"mix_stderr": False} if "mix_stderr" in inspect.signature(CliRunner).parameters else {}
)


def runner() -> CliRunner:
    """What invokes a command; its result has stdout and stderr."""
    return CliRunner(**_APART)
