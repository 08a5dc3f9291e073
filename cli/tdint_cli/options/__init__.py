"""The options of the commands, each declared once: a module for each heading of the help."""

from tdint_cli.options import analysis, building, output, record, spectra, studies
from tdint_cli.options.headings import command, option

__all__ = ["analysis", "building", "command", "option", "output", "record", "spectra", "studies"]
