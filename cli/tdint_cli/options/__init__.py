"""The options of the commands, each declared once: a module for each heading of the help."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use
from tdint_cli.options.grammar import argument, command, of, option, request

if TYPE_CHECKING:
    from tdint_cli.options import analysis, output, record, spectra

__all__ = ["analysis", "output", "record", "spectra"]
__all__ += ["argument", "command", "of", "option", "request"]

__getattr__ = modules_on_use(__name__)
