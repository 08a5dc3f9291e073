"""Campaigns: buildings under suites of ground motions at many levels, in a persistent store."""

import sys

from tdint.tabular import FunctionPackage

sys.modules[__name__].__class__ = FunctionPackage
