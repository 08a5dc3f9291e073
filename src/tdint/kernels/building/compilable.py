"""Objects of compilation: kernels and laws with their signatures, and the variant that a building
needs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import islice
from typing import Any, NamedTuple


class Signature(NamedTuple):
    """Types of the result and of the arguments of a kernel. A signature among the arguments
    represents a kernel with this signature."""

    returns: Scalar
    arguments: tuple[Argument, ...]


class Scalar(NamedTuple):
    """Type of a number. A call with the types of arguments returns the signature of a function that
    returns such a number."""

    name: str

    def __call__(self, *arguments: Argument) -> Signature:
        """Return the signature of a function of these arguments with this type of result."""
        return Signature(self, arguments)


class ArrayOf(NamedTuple):
    """Type of an array of floating-point numbers in C order."""

    dimensions: int


Argument = Scalar | ArrayOf | Signature

F8 = Scalar("float64")
I8 = Scalar("int64")

NOTHING = Scalar("none")

TABLE = ArrayOf(2)

_ON_PATH = (TABLE, TABLE, I8, I8, I8)
HOOKS = {
    "force": F8(*_ON_PATH, F8),
    "strain_energy": F8(TABLE, TABLE, I8),
    "hysteretic_energy": F8(TABLE, TABLE, I8),
    "accumulate_dissipation": NOTHING(*_ON_PATH),
    "keep": NOTHING(*_ON_PATH),
    "commit": NOTHING(*_ON_PATH),
    "enter": NOTHING(TABLE, TABLE, I8),
    "advance": NOTHING(TABLE, TABLE, I8, I8, F8, F8),
    "switch": NOTHING(TABLE, TABLE, I8, I8, F8),
    "points": F8(TABLE, TABLE, I8, F8),
    "kink": F8(TABLE, TABLE, I8, I8, F8),
}
"""Signatures of the functions of a law that kernels call (`tdint.kernels.laws.hooks`), in the order
of the table of laws: each row of the table contains the addresses of the functions of a law, and
then its properties."""

LAWS_SYMBOL = "tdint.laws"
"""Symbol of the table of laws in the object files of kernels. Row 2 c belongs to the law with the
number c, so that a law that can fracture, with the number c + 1/2, has a row."""

LAW_PREFIX = "law."
"""Start of the name of a law in its module, which distinguishes it from a kernel."""

GROUPS: dict[str, Any] = {}
"""Named tuples of arguments by the names of the parameters of kernels (`stepping.py`)."""


def grouped(function: Callable[..., Any], values: Sequence[Any]) -> list[Any]:
    """Return values of the arguments of a kernel, with the fields of each named tuple in GROUPS
    combined if the function has such parameters."""
    rest = iter(values)
    names = function.__code__.co_varnames[: function.__code__.co_argcount]
    if len(names) == len(values):
        return [*values]
    return [
        GROUPS[name]._make(islice(rest, len(GROUPS[name]._fields)))
        if name in GROUPS
        else next(rest)
        for name in names
    ]


PLAIN = "plain"
FULL = "full"
ANY = "any"


class Variant(NamedTuple):
    """Form of the kernels and laws that a building needs.

    Attributes
    ----------
    form : str
        PLAIN for the kernels without optional features, FULL for the kernels with all features.
    laws : tuple of Compilable
        Laws (`tdint.kernels.laws.compiled`).
    """

    form: str = FULL
    laws: tuple[Compilable, ...] = ()


EVERYTHING = Variant()
"""Variant of kernels that are not for a single building, without laws."""


def bind(function: Callable[..., Any], *last: Any) -> Callable[..., Any]:
    """Return a compiled or Python function of a kernel as a function of its first arguments, with
    the constant last arguments `last`.

    Many calls with the same arrays are shorter, because the arrays are converted only one time.
    """
    if hasattr(function, "bind"):
        bound: Callable[..., Any] = function.bind(*last)
        return bound
    return lambda *first: function(*first, *last)


INSTALLED: set[str] = set()
"""Types of functions that this process has installed: "compiled", "interpreted" or both."""


def time_loops() -> str | None:
    """Return "interpreted" if this process executes a time loop as a Python function, otherwise
    "compiled"; None if it has installed no time loop."""
    # The set contains at most "compiled" and "interpreted".
    return "interpreted" if "interpreted" in INSTALLED else next(iter(INSTALLED), None)


class Compilable:
    """Code that is compiled to an object file in one or two forms: a kernel or a law.

    Attributes
    ----------
    has_forms : bool
        True if the code differs between the forms PLAIN and FULL.
    vectorized : bool
        True if the compiler may vectorize loops.
    """

    has_forms: bool = False
    vectorized: bool = False

    def __init__(self) -> None:
        """Nothing is compiled or loaded yet."""
        self._loaded: dict[str, Any] = {}  # by form

    @property
    def name(self) -> str:
        """Name in the process that compiles, as `package.module:function`; unique."""
        raise NotImplementedError

    @property
    def module(self) -> str:
        """Name of the module in which the code is defined."""
        return self.name.partition(":")[0]

    def form(self, variant: Variant) -> str:
        """Return the form of the object file for a variant; ANY if there is only one form."""
        return variant.form if self.has_forms else ANY

    def loaded(self, form: str) -> bool:
        """Return True if this process has loaded or installed the code."""
        return form in self._loaded

    def load(self, form: str, code: bytes, description: dict[str, Any]) -> None:
        """Load an object file with its description (`tdint.kernels.building.loading`).

        Raises
        ------
        RuntimeError, ValueError
            The object cannot be loaded, or does not contain all functions.
        """
        raise NotImplementedError

    def interpret(self, form: str, wrap: Callable[[Callable[..., Any]], Any]) -> None:
        """Install the Python function, as returned by `wrap`, instead of compiled code."""
        raise NotImplementedError
