"""Many runs: buildings under suites of records at many levels, kept in a store that survives
whatever ends them."""

import sys

from tdint.tabular import FunctionPackage

sys.modules[__name__].__class__ = FunctionPackage
