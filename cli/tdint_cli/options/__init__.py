"""The options of the commands. `options.csv` lists them; a module for each heading declares options
with functions of their own."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use
from tdint_cli.options.grammar import argument, command, of, option, request

if TYPE_CHECKING:
    from tdint_cli.options import analysis, output, record, spectra

__all__ = ["analysis", "output", "record", "spectra"]
__all__ += ["argument", "command", "of", "option", "request"]

__getattr__ = modules_on_use(__name__)
