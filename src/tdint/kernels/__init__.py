"""Compiled time loops. They use numpy and numba only, operate on numbers and arrays, and do not
validate their arguments. The layers above provide the validated interface."""
