"""Figures of this package; each module is imported at its first use."""

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.studies.figures import collapse as collapse
    from tdint.studies.figures import many_runs as many_runs
    from tdint.studies.figures import matching as matching
    from tdint.studies.figures import recorded as recorded
    from tdint.studies.figures import sensitivity as sensitivity
    from tdint.studies.figures import suites as suites

_import_module = modules_on_use(__name__)


def __getattr__(name: str) -> ModuleType:
    """Import a module of figures when it is first used, after the module of styles."""
    import_module("tdint.output.figures.style")
    return _import_module(name)
