"""A case: something that is known from elsewhere, and how this program computes it."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from importlib.resources import files
from typing import Any

import numpy as np

from tdint.arrays import Array as Array

ROUNDING = "rounding of the source"
NUMERICAL = "numerical error"
MODEL = "model error"


@dataclass(frozen=True)
class ValidationCase:
    """What is known, from where, and how it is computed here.

    Attributes
    ----------
    name : str
        Short, as in tables.
    title : str
        What it shows, in a sentence.
    source : str
        Author, year, table or equation.
    unit : str
        Of the numbers; "1" for none.
    quantities : tuple of str
        What the numbers are, each.
    published : tuple of float
        The known numbers.
    computed : callable
        Computes as many numbers with the installed program.
    tolerance : float
        Largest difference that the case allows, in the unit; relative if `relative`.
    difference_is : str
        `ROUNDING`, `NUMERICAL` or `MODEL`: what the difference is made of.
    relative : bool
        Differences are taken over the published numbers.
    remark : str
        What a reader should know of the difference.
    """

    name: str
    title: str
    source: str
    unit: str
    quantities: tuple[str, ...]
    published: tuple[float, ...]
    computed: Callable[[], Sequence[float] | Array]
    tolerance: float
    difference_is: str
    relative: bool = False
    remark: str = ""

    def __reduce__(self) -> tuple[Any, ...]:
        return _without_computing, (
            {one.name: getattr(self, one.name) for one in fields(self) if one.name != "computed"},
        )


def _without_computing(values: dict[str, Any]) -> ValidationCase:
    """A case that has travelled to another process: it tells what it is, and computes nothing."""
    return ValidationCase(**values, computed=tuple)


def cases_of(
    group: str,
    computed: Mapping[str, Callable[[], Array]],
    known: Mapping[str, tuple[float, ...]],
) -> tuple[ValidationCase, ...]:
    """The cases of a group of `cases.toml`: by their names what computes them, and the numbers that a formula gives."""
    text = (files("tdint.validation") / "cases.toml").read_text(encoding="utf-8")
    found = []
    for said in tomllib.loads(text)[group]:
        name = said["name"]
        published = tuple(said.pop("published", ())) or known[name]
        quantities = tuple(said.pop("quantities"))
        found.append(ValidationCase(**said, published=published, quantities=quantities, computed=computed[name]))
    return tuple(found)


@dataclass(frozen=True)
class ValidationResult:
    """A case and what came of it.

    Attributes
    ----------
    computed, differences : ndarray
        Numbers, and computed less published (over published where the case is relative).
    """

    case: ValidationCase
    computed: Array
    differences: Array

    @property
    def largest(self) -> float:
        """The largest difference; infinite if a number is not finite."""
        sizes = np.abs(self.differences)
        return float(np.max(sizes)) if np.all(np.isfinite(sizes)) else float("inf")

    @property
    def within(self) -> bool:
        """Whether every number is within the tolerance."""
        return self.largest <= self.case.tolerance


def carry_out(case: ValidationCase) -> ValidationResult:
    """Compute a case.

    Raises
    ------
    TdintError
        A run that the case needs failed.
    """
    computed = np.asarray(case.computed(), float)
    published = np.asarray(case.published, float)
    if computed.shape != published.shape:
        raise ValueError(f"{case.name}: {computed.size} numbers for {published.size}")
    differences = computed - published
    return ValidationResult(case, computed, differences / np.abs(published) if case.relative else differences)
