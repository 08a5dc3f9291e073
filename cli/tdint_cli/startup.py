"""A quick start of numba, for a process that only runs tdint."""

from __future__ import annotations

import sys


def load_numba() -> None:
    """Load numba without SciPy's linear algebra.

    When numba gets ready to compile or to load from its cache it looks for SciPy's BLAS, a fifth of the time that a
    whole command takes. tdint's kernels have no use for it; elsewhere in the process SciPy is imported as ever.
    """
    if "scipy.linalg" in sys.modules:
        return
    sys.modules["scipy.linalg"] = None  # type: ignore[assignment]
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        del sys.modules["scipy.linalg"]
