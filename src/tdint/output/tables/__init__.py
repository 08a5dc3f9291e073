"""CSV tables: columns and their order; each module is imported when a table of it is made."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.output.tables import buildings as buildings
    from tdint.output.tables import devices as devices
    from tdint.output.tables import directions as directions
    from tdint.output.tables import elements as elements
    from tdint.output.tables import histories as histories
    from tdint.output.tables import methods as methods
    from tdint.output.tables import responses as responses
    from tdint.output.tables import runs as runs
    from tdint.output.tables import spectra as spectra
    from tdint.output.tables import table as table
    from tdint.output.tables import transfer as transfer
    from tdint.output.tables import values as values

__getattr__ = modules_on_use(__name__)
