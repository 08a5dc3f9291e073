"""Figures. Only this package imports matplotlib, and only when a figure is plotted.

A figure is the same on every machine: matplotlib would read settings from a file `matplotlibrc` in
the working directory or in the home directory, and some settings start other programs
(`text.usetex`). Therefore, the defaults of matplotlib are used.
"""

import logging
from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.output.figures import floor_spectra as floor_spectra
    from tdint.output.figures import loads as loads
    from tdint.output.figures import mode_shapes as mode_shapes
    from tdint.output.figures import runs as runs
    from tdint.output.figures import spectrum_curves as spectrum_curves
    from tdint.output.figures import static_curves as static_curves
    from tdint.output.figures import style as style

# The messages of matplotlib about its font cache are not relevant to users.
logging.getLogger("matplotlib").setLevel(logging.ERROR)

__getattr__ = modules_on_use(__name__, f"{__name__}.style")
