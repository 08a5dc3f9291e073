"""Time-integration methods: one file per family, and the catalogue of all of them."""

import sys

from tdint.tabular import FunctionPackage

sys.modules[__name__].__class__ = FunctionPackage
