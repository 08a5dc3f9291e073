"""Pictures; matplotlib is imported here alone.

A picture is the same wherever it is drawn: matplotlib would take settings from a file `matplotlibrc` in the working
directory or in the user's home, some of which call other programs (`text.usetex`). Its own defaults are used.
"""

import matplotlib as mpl

mpl.rcdefaults()
