"""Compiled time loops: numpy and numba only, raw floats and arrays, no checks. The layers above are
the safe way in."""
