"""Kernel of one line that is compiled quickly, with a function of its own file and a function of
another file."""

from tdint.kernels.compiling import F8, VECTOR, inline, kernel
from tdint.kernels.time_loop.loop import ground_at


@inline
def twice(x):
    return 2.0 * x


@kernel(F8(VECTOR, F8), has_forms=False)
def scaled(ground, x):
    """Return 2 x times the second sample of the ground motion."""
    return twice(x) * ground_at(ground, 1, 1, 1)
