"""The options of the commands, each declared once: a module for each heading of the help."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from tdint_cli.options.headings import command, option

if TYPE_CHECKING:
    from tdint_cli.options import analysis, building, output, record, spectra, studies

__all__ = ["analysis", "building", "command", "option", "output", "record", "spectra", "studies"]


def __getattr__(name: str) -> Any:
    """The headings that a command has, each imported when it is first used."""
    if name in __all__:
        return import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
