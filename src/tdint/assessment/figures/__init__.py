"""Figures of this package; each module is imported at its first use."""

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.assessment.figures import assessment as assessment
    from tdint.assessment.figures import chart_notes as chart_notes
    from tdint.assessment.figures import chart_profiles as chart_profiles
    from tdint.assessment.figures import examples as examples
    from tdint.assessment.figures import failure_matrix as failure_matrix

_import_module = modules_on_use(__name__)


def __getattr__(name: str) -> ModuleType:
    """Import a module of figures when it is first used, after the module of styles."""
    import_module("tdint.output.figures.style")
    return _import_module(name)
