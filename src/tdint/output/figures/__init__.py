"""Pictures; matplotlib is imported here alone, and each module when a picture of it is drawn.

A picture is the same wherever it is drawn: matplotlib would take settings from a file `matplotlibrc` in the working
directory or in the user's home, some of which call other programs (`text.usetex`). Its own defaults are used.
"""

import logging
from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.output.figures import assessment as assessment
    from tdint.output.figures import collapse as collapse
    from tdint.output.figures import comparison as comparison
    from tdint.output.figures import demands as demands
    from tdint.output.figures import failure_matrix as failure_matrix
    from tdint.output.figures import records as records
    from tdint.output.figures import runs as runs
    from tdint.output.figures import spectrum_curves as spectrum_curves
    from tdint.output.figures import statics as statics
    from tdint.output.figures import style as style
    from tdint.output.figures import suites as suites
    from tdint.output.figures import work_precision as work_precision

# Where to keep its list of fonts is no one's matter here.
logging.getLogger("matplotlib").setLevel(logging.ERROR)

__getattr__ = modules_on_use(__name__)
