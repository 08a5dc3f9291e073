"""Decorators and types of kernels.

A kernel has one explicit signature. In a user process the decorated functions remain plain Python
functions, and a kernel is loaded from an object file when it is first called (see
`tdint.kernels.building`). If the object file does not exist, a separate process compiles it. In
that process the decorators of numba are used, and code for features that the variant does not need
is omitted.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import wraps
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.kernels.building import compilable
from tdint.kernels.building.compilable import (
    EVERYTHING,
    F8,
    I8,
    TABLE,
    ArrayOf,
    Compilable,
    Signature,
    Variant,
)

__all__ = [
    "CUBE",
    "F8",
    "FULL",
    "I8",
    "TABLE",
    "VECTOR",
    "Kernel",
    "copy_rows_within",
    "indirect_caller",
    "inline",
    "kernel",
    "local",
    "local_table",
    "outlined",
]

VECTOR = ArrayOf(1)
CUBE = ArrayOf(3)

COMPILES = os.environ.get("TDINT_KERNELS") == "compile"
"""True if this process compiles kernels. `tdint.kernels.building.process` starts such processes."""

FULL = os.environ.get("TDINT_KERNELS_FORM") != compilable.PLAIN
"""False in the plain form of the kernels, which omits the code for optional features: modal
damping, forces on floors, dashpots of a power law, braces of dampers, Rayleigh damping with the
tangent stiffness, elements, attachments, links and fracture. `tdint.model.building.variant` selects
the form. The compiler omits the code that this constant enables. The constant must be imported by
name: as an attribute of a module, it would be evaluated too late. In a process that does not
compile, TDINT_KERNELS_FORM is set by tests only."""


class Kernel(Compilable):
    """Function that is compiled for a single signature or loaded, when it is first requested.

    Attributes
    ----------
    function : callable
        Python function of the arguments in the signature.
    signature : Signature
        Types of the arguments and of the result.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        signature: Signature,
        has_forms: bool,
        vectorized: bool,
    ) -> None:
        """Store the function and its properties."""
        super().__init__()
        has_groups = function.__code__.co_argcount != len(signature.arguments)
        self.function = _function_of_fields(function) if has_groups else function
        self.signature = signature
        self.has_forms = has_forms
        self.vectorized = vectorized
        self.__doc__ = function.__doc__
        # Variant of the last call, because most calls request the same variant again
        self._last: Variant | None = None

    @property
    def name(self) -> str:
        """Name of the kernel, as `package.module:function`."""
        return f"{self.function.__module__}:{self.function.__qualname__}"

    @property
    def compiled(self) -> Callable[..., Any]:
        """Compiled kernel with all features.

        ValueError is raised if the kernel calls laws, which only `variant` loads.
        """
        from tdint.kernels.building.sources import closure

        if self.has_forms and "tdint.kernels.laws.selection" in closure(self.name):
            raise ValueError(f"{self.name} calls laws: use `variant` with the laws of the building")
        return self.variant(EVERYTHING)

    def variant(self, variant: Variant) -> Callable[..., Any]:
        """Return the compiled kernel for a building.

        The kernel and the laws of the building are loaded, and compiled if their object files do
        not exist.

        Parameters
        ----------
        variant : Variant
            Form of the kernels and laws that the building needs.
        """
        if variant is not self._last:
            from tdint.kernels.building.load_or_compile import load_or_compile

            load_or_compile([(self, variant)])
            self._last = variant
        function: Callable[..., Any] = self._loaded[self.form(variant)]
        return function

    def load(self, form: str, code: bytes, description: dict[str, Any]) -> None:
        """Load the compiled function."""
        from tdint.kernels.building.loading import Loaded

        self._loaded[form] = Loaded(code, description["symbol"], self.signature)
        compilable.INSTALLED.add("compiled")

    def interpret(self, form: str, wrap: Callable[[Callable[..., Any]], Any]) -> None:
        """Install the Python function, as returned by `wrap`."""
        self._loaded[form] = wrap(self.function)
        compilable.INSTALLED.add("interpreted")


def _function_of_fields(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function with the fields of the named tuples (GROUPS) as separate arguments."""

    @wraps(function)
    def call(*arguments: Any) -> Any:
        """Combine the fields to named tuples and call the function."""
        return function(*compilable.grouped(function, arguments))

    return call


def kernel(
    signature: Signature, has_forms: bool = True, vectorized: bool = False
) -> Callable[[Callable[..., Any]], Kernel]:
    """Return a decorator that converts a function to a `Kernel`.

    Loops are not vectorized by default. A loop over stories is short, and a compiled loop that can
    be vectorized first tests whether its rows overlap. This test costs a third of the run time of a
    building with three stories and up to a seventh with ten stories; with 300 stories vectorization
    would save a fifth. Loops over many oscillators save more than half.

    Parameters
    ----------
    signature : Signature
        Types of the arguments and of the result.
    has_forms : bool
        True if the code depends on the features of the building. Default: True.
    vectorized : bool
        True if the compiler may vectorize loops. Default: False.

    Returns
    -------
    callable
        Decorator: function -> Kernel.
    """
    return lambda function: Kernel(function, signature, has_forms, vectorized)


if COMPILES:
    from tdint.kernels.building.compiler import (
        copy_rows_within,
        indirect_caller,
        inline,
        local,
        local_table,
        outlined,
    )
else:
    # This process does not compile: it loads object files, or runs kernels as Python functions,
    # which a debugger can step through. The decorators return the function unchanged. Their
    # docstrings describe the effect in a process that compiles (`tdint.kernels.building.compiler`).

    def inline(function: Callable[..., Any]) -> Any:
        """Mark a function of an inner loop: when kernels are compiled, its code is copied into each
        caller.

        Without compilation, the function is returned unchanged, as by `outlined`.

        Parameters
        ----------
        function : callable
            Function of numbers and arrays that numba can compile.
        """
        return function

    def outlined(function: Callable[..., Any]) -> Any:
        """Mark a function that kernels call rarely: when kernels are compiled, it is compiled once
        and called, which reduces compile times. Without compilation, it is returned unchanged.

        Parameters
        ----------
        function : callable
            Function of numbers and arrays that numba can compile.
        """
        return function

    def indirect_caller(signature: Signature) -> Any:
        """Return a function that calls a kernel that was passed as an argument.

        Named tuples among its arguments are passed as their fields.

        Parameters
        ----------
        signature : Signature
            Signature of the kernel. Not used here, because Python functions need no signature; the
            function of the same name for compiled kernels requires it.
        """

        def call(kernel: Any, *arguments: Any) -> Any:
            """Call the kernel with the fields of its arguments."""
            groups = (item if isinstance(item, tuple) else (item,) for item in arguments)
            return kernel(*chain.from_iterable(groups))

        return call

    def local(size: int) -> Any:
        """Return an uninitialized array of `size` numbers for use during one call of a function.

        In compiled kernels, the array is on the stack of the function. It must not be created in a
        loop, because the memory is released only when the function returns. This also applies to an
        `inline` function that is called in a loop, because its code is copied into the loop.

        Parameters
        ----------
        size : int
            Number of elements, a constant.
        """
        return np.empty(size)

    def local_table(rows: int, columns: int) -> Any:
        """Return an uninitialized array with `rows` rows and `columns` columns, for use during one
        call of a function.

        In compiled kernels, the array is on the stack, as for `local`.

        Parameters
        ----------
        rows, columns : int
            Numbers of rows and columns, constants.
        """
        return np.empty((rows, columns))

    def copy_rows_within(table: NDArray[np.float64], source: int, target: int, count: int) -> None:
        """Copy `count` rows of a table from row `source` on to the rows from `target` on.

        The rows must not overlap. A compiled kernel copies them as one block of memory, which takes
        a fraction of the time of two nested loops.
        """
        if isinstance(table, memoryview):  # has no slices of rows
            for row in range(count):
                for i in range(table.shape[1]):
                    table[target + row, i] = table[source + row, i]
        else:
            table[target : target + count] = table[source : source + count]
