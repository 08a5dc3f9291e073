"""Pictures; matplotlib is imported here alone, and each module when a picture of it is drawn.

A picture is the same wherever it is drawn: matplotlib would take settings from a file
`matplotlibrc` in the working directory or in the user's home, some of which call other programs
(`text.usetex`). Its own defaults are used.
"""

import logging
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.output.figures import assessment as assessment
    from tdint.output.figures import collapse as collapse
    from tdint.output.figures import comparison as comparison
    from tdint.output.figures import examples as examples
    from tdint.output.figures import runs as runs
    from tdint.output.figures import spectrum_curves as spectrum_curves
    from tdint.output.figures import style as style

# Where to keep its list of fonts is no one's matter here.
logging.getLogger("matplotlib").setLevel(logging.ERROR)

_found = modules_on_use(__name__)


def __getattr__(name: str) -> ModuleType:
    if name != "style":
        import_module(f"{__name__}.style")  # It is the first that imports matplotlib.
    return _found(name)
