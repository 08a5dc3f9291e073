"""What a drift law is: what a model file may say about it, and its compiled functions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class LawParameter:
    """A parameter of a law.

    `force` and `length` are the exponents of its dimension (a stiffness is force^1 length^-1); a
    parameter with `many` is a list whose j-th entry (from 1) has the dimension force^1 length^-j.
    One of `points` is a list of two to four points [drift, force], each within the bounds; it has
    eight rows: four points, those that are left out put between the others.

    `default` stands for a parameter that is left out: a number, or the name of the one whose value
    it takes over; None if it must be given. Parameters of the same `group` stand in a mapping of
    that name, which may be left out as a whole if `without` says what each is then; a `shared`
    group may also be one number for all. A group inside another is written `outer.inner`.
    """

    name: str
    force: int = 0
    length: int = 0
    low: float = -math.inf
    high: float = math.inf
    low_allowed: bool = True
    high_allowed: bool = True
    many: bool = False
    points: bool = False
    default: float | str | None = None
    group: str = ""
    without: float | None = None
    shared: bool = False

    @property
    def path(self) -> str:
        """The name with its group."""
        return f"{self.group}.{self.name}" if self.group else self.name


@dataclass(frozen=True)
class LawFunctions:
    """The compiled functions of a law. They work on column i of the tables `law_parameters` and
    `law_state` (`tdint.kernels.layout`).

    Attributes
    ----------
    force : function
        (law_parameters, law_state, i, previous, trial, drift) -> tangent, N/m: force of the story
        at
        `drift`, reached straight from the state in block `previous`; writes FORCE and what else the
        state of the law is to block `trial`.
    recoverable : function
        (law_parameters, law_state, i) -> energy stored in the committed state, J.
    dissipated : function, optional
        (law_parameters, law_state, i) -> energy dissipated until the committed state, J, where that
        is not the row DISSIPATED.
    settle : function, optional
        (law_parameters, law_state, i, previous, trial): adds up DISSIPATED in block `trial`.
        Without it
        that stays as it is.
    keep : function, optional
        (law_parameters, law_state, i, previous, trial): commits rows beyond the plain ones. A law
        that
        has it always knows its branch; one that has no `accumulate_dissipation` may look at that
        first
        (`tdint.kernels.laws.branch_following.branch_first`).
    enter : function, optional
        (law_parameters, law_state, i): branch of the committed state: SLOPE, UPPER, LOWER, where
        they
        are not k and without end.
    advance : function, optional
        (law_parameters, law_state, i, block, step, mean_force): what else changes on the way along
        a
        branch; without it the row WORK adds up.
    switch : function, optional
        (law_parameters, law_state, i, block, event): the branch that follows when the present one
        ends by `event` (ABOVE, BELOW, TURNED): sets SLOPE, LOWER, UPPER and TURN of the block
        (`walking.put_on_branch`), and FORCE and INTERNAL where they change.
    points : function, optional
        (law_parameters, law_state, i, way) -> Gauss points on a path of drift that is `way` long
        (m),
        for a curved law. Without it many are taken.
    kink : function, optional
        (law_parameters, law_state, i, block, side) -> how far ahead of the state in `block`, on the
        way to `side`, the force of a curved law bends sharply, m; infinite if it does not.
    """

    force: Any
    strain_energy: Any
    hysteretic_energy: Any = None
    accumulate_dissipation: Any = None
    keep: Any = None
    enter: Any = None
    advance: Any = None
    switch: Any = None
    points: Any = None
    kink: Any = None


@dataclass(frozen=True)
class DriftLaw:
    """A drift law: d is the story's drift, k its initial stiffness, f the restoring force.

    Attributes
    ----------
    formula : str
        One line for people.
    functions : callable
        () -> LawFunctions. Only this imports numba.
    apart : bool
        Whether the law is compiled on its own, when a model has it, and called at its address; else
        it is part of every loop.
    extra_rows : int
        Rows of `law_state` that the law needs beyond the common ones
        (`tdint.kernels.layout.EXTRA_ROWS`).
    parameters : tuple of LawParameter
        In the order of the rows of `law_parameters` from FIRST_PARAMETER on (a `many` parameter
        comes last).
    curved : bool
        Whether the force is curved; else it is linear branch by branch.
    kinked : bool
        Whether the tangent jumps somewhere, so that the law has a `switch`; where it does is
        located in a step.
    stiffens : callable
        Parameter values -> whether a story can become stiffer than at rest.
    initial_stiffness : callable, optional
        The law's own initial stiffness from the parameter values; None where the story gives it.
    yield_drift : callable
        (initial stiffness, parameter values) -> drift at first yield, m; nan for a law that does
        not yield.
    fault : callable
        (initial stiffness, parameter values) -> what is wrong with them together; None if nothing
        is.
    failed : float
        What row INTERNAL is, from then on, of a story that carries nothing any more; nan if that
        does not happen.
    """

    name: str
    formula: str
    functions: Callable[[], LawFunctions]
    parameters: tuple[LawParameter, ...] = ()
    curved: bool = False
    kinked: bool = False
    apart: bool = False
    extra_rows: int = 0
    stiffens: Callable[[Sequence[float]], bool] = lambda values: False
    initial_stiffness: Callable[[Sequence[float]], float] | None = None
    yield_drift: Callable[[float, Sequence[float]], float] = lambda stiffness, values: math.nan
    fault: Callable[[float, Sequence[float]], str | None] = lambda stiffness, values: None
    failed: float = math.nan


def yields_at_its_strength(stiffness: float, values: Sequence[float]) -> float:
    """Drift at first yield of a law whose first parameter is its yield force, m."""
    return values[0] / stiffness
