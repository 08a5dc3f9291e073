"""Pictures; matplotlib is imported here alone.

A picture is the same wherever it is drawn: matplotlib would take settings from a file `matplotlibrc` in the working
directory or in the user's home, some of which call other programs (`text.usetex`). Its own defaults are used.
"""

import logging

# Where to keep its list of fonts is no one's matter here.
logging.getLogger("matplotlib").setLevel(logging.ERROR)

import matplotlib as mpl  # noqa: E402

mpl.rcdefaults()
