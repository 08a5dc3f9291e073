"""Objects of compilation: a function with its signature, and the variant with the features that the
compiled code supports."""

from __future__ import annotations

import os
from collections.abc import Callable
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

WHOLE = os.environ.get("TDINT_KERNELS") == "whole"
"""True if one variant with all features is used for all buildings. This reduces compile times if
many different buildings are integrated."""


FRACTURES = "~"
"""End of the name of a law in a variant, if the law can fracture."""


class Variant(NamedTuple):
    """Features that the compiled code of a kernel supports.

    Attributes
    ----------
    laws : tuple of str
        Names of the drift laws of the stories, in the order of `tdint.kernels.laws.LAWS`. Empty for
        all laws of tdint that cannot fracture. The name of a law of a plug-in includes its number:
        `name@9`. A law that can fracture has a separate name, `name~` or `name@9~`.
    power_dampers : bool
        Dashpots of a power law.
    elements : bool
        Stories with several elements (springs in parallel).
    braces : bool
        Dampers in series with a brace.
    tangent_damping : bool
        Rayleigh damping with the tangent stiffness.
    tree : bool
        Attachments or links, so that a spring can be on any floor.
    links : bool
        Links between any two floors.
    """

    laws: tuple[str, ...] = ()
    modal: bool = True
    forces: bool = True
    power_dampers: bool = True
    elements: bool = True
    braces: bool = True
    tangent_damping: bool = True
    tree: bool = True
    links: bool = True

    @property
    def text(self) -> str:
        """Text that identifies the variant in a file name, for example `linear,bilinear+modal`.

        The names of the laws (`all` without names) are followed by the features. `parse` reads
        this text.
        """
        features = "".join(f"+{name}" for name in FEATURES if getattr(self, name))
        return (",".join(self.laws) or "all") + features

    @property
    def outside(self) -> dict[str, int]:
        """Numbers of the laws of plug-ins in this variant, by name.

        The law `name@9` of the variant has the number 9.
        """
        split_names = (law.removesuffix(FRACTURES).partition("@") for law in self.laws)
        return {name: int(code) for name, separator, code in split_names if separator}

    def only(self, parts: tuple[str, ...]) -> Variant:
        """Return this variant with all features switched on, except the attributes in `parts`.

        The result is the variant of a kernel that depends only on these attributes. The other
        attributes get the values of EVERYTHING, so that one compiled kernel serves more buildings.
        """
        unused = {name: getattr(EVERYTHING, name) for name in PARTS if name not in parts}
        return self._replace(**unused)


EVERYTHING = Variant()
PARTS = Variant._fields
"""Attributes of a variant: the laws and the features."""

FEATURES = PARTS[1:]
"""Names of the features that a variant has or has not: all attributes except the laws."""


def parse(text: str) -> Variant:
    """Return the variant of a text written by `Variant.text`.

    Raises
    ------
    ValueError
        The text contains an unknown feature.
    """
    laws, *features = text.split("+")
    if unknown := set(features) - set(FEATURES):
        raise ValueError(f"variant {text!r}: unknown features {', '.join(sorted(unknown))}")
    law_names = () if laws == "all" else tuple(laws.split(","))
    return Variant(law_names, **{name: name in features for name in FEATURES})


def bind(function: Callable[..., Any], *last: Any) -> Callable[..., Any]:
    """Return a compiled or Python function of a kernel as a function of its first arguments, with
    the constant last arguments `last`.

    Many calls with the same arrays are shorter, because the arrays are converted only one time.
    """
    if hasattr(function, "bind"):
        bound: Callable[..., Any] = function.bind(*last)
        return bound
    return lambda *first: function(*first, *last)


_INSTALLED: set[str] = set()
"""Types of functions that this process has installed: "compiled", "interpreted" or both."""


def time_loops() -> str | None:
    """Return "interpreted" if this process executes a time loop as a Python function, otherwise
    "compiled"; None if it has installed no time loop."""
    # The set contains at most "compiled" and "interpreted".
    return "interpreted" if "interpreted" in _INSTALLED else next(iter(_INSTALLED), None)


class Compilable:
    """Function with its signature and its compiled or loaded variants.

    Parameters
    ----------
    parts : tuple of str
        Attributes of `Variant` that the kernel depends on.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        signature: Signature,
        parts: tuple[str, ...],
        vectorized: bool = False,
    ) -> None:
        """Store the function and its properties; no variant is compiled or loaded yet."""
        self.function = function
        self.signature = signature
        self.parts = parts
        self.vectorized = vectorized
        self.__doc__ = function.__doc__
        # By the variant that the kernel requires (`required_variant`)
        self._loaded: dict[Variant, Callable[..., Any]] = {}
        # Results of `Variant.only` for the parts of the kernel, which each run requires
        self._required: dict[Variant, Variant] = {}
        # Variant and function of the last call, because most calls request the same variant again.
        # If the function is None, the variant is not used.
        self._last: tuple[Variant, Callable[..., Any] | None] = (EVERYTHING, None)

    @property
    def name(self) -> str:
        """Name of the kernel, as `package.module:function`."""
        return f"{self.function.__module__}:{self.function.__qualname__}"

    def required_variant(self, variant: Variant) -> Variant:
        """Return the variant that this kernel requires for a building with the features of
        `variant` (`Variant.only`).

        TDINT_KERNELS=whole replaces it by EVERYTHING, except for a kernel that contains laws of
        plug-ins or laws that can fracture, which EVERYTHING does not contain.
        """
        required = self._required.get(variant)
        if required is None:
            required = self._required[variant] = variant.only(self.parts)
        # WHOLE is not part of the stored result, because tests change it.
        is_included = not required.outside and FRACTURES not in "".join(required.laws)
        return EVERYTHING if WHOLE and is_included else required

    def loaded(self, variant: Variant) -> bool:
        """Return True if this process has loaded or installed the kernel for a variant."""
        # Most calls request the variant of the last call; this test avoids the hash of a variant.
        last_variant, function = self._last
        if function is not None and variant is last_variant:
            return True
        return self.required_variant(variant) in self._loaded

    def install(
        self, variant: Variant, function: Callable[..., Any], *, interpreted: bool = False
    ) -> None:
        """Store a compiled or Python function, which later calls of the kernel use if they require
        exactly `variant` (a result of `required_variant`).

        The variant is not replaced here: a function without some features must never become the
        function for all buildings.
        """
        _INSTALLED.add("interpreted" if interpreted else "compiled")
        self._loaded[variant] = function
        # The function of the last call may have been replaced.
        self._last = EVERYTHING, None
