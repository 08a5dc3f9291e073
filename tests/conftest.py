"""What all tests have in common."""

from __future__ import annotations

import os

# The tests integrate so many different buildings that one variant of each kernel is compiled sooner than all that they
# need. What a scene alone would get is tested in tests/kernels/test_variants.py.
os.environ.setdefault("TDINT_KERNELS", "whole")
