"""Definition of a hysteresis model of a story (a drift law).

A drift law consists of a declaration (`DriftLaw` with one `LawParameter` for each parameter that a
model file can specify) and its compiled functions (`LawFunctions`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

MAX_POINTS = 40
"""Maximum number of points of a backbone curve on each side. They occupy two rows each in the table
of parameters, and a law may need a row of each state for each point."""

SIDES = ("both", "positive", "negative")
"""Sides on which a law with the parameter `sides` acts."""


@dataclass(frozen=True, eq=False)
class LawParameter:
    """Parameter of a drift law, as specified in a model file.

    Attributes
    ----------
    name : str
        Key in the model file.
    force : int
    length : float
        Exponents of the dimension. A stiffness has force 1 and length -1.
    low, high : float
        Bounds of the value, in SI units.
    low_allowed, high_allowed : bool
        True if the bound is a valid value.
    many : bool
        True if the parameter is a list of any length. Entry j (counted from 1) has the dimension
        force^1 length^-j.
    points : int
        Maximum number of points if the parameter is a list of points [drift, force], otherwise 0.
        Each number must be within the bounds. The parameter occupies two rows for each of `points`
        points.
    least_points : int
        Minimum number of points of such a list.
    long_form : str
        Law with this list, for messages about lists that are too long for another law.
    open_ended : bool
        Points that are not specified are infinite (True), or are inserted between the last two
        specified points (False, for four points).
    choices : tuple of str
        Allowed names, if the value is a name instead of a number. The value in the table is the
        index of the name.
    default : float, str or None
        Value if the model file omits the parameter: a number, or the name of the parameter with the
        same value. None if the parameter is required.
    group : str
        Name of the mapping that contains the parameter; "" for none. A group within another group
        is written `outer.inner`.
    without : float | None
        Value if the model file omits the complete group. None if the group is required.
    shared : bool
        True if one number may be specified for all parameters of the group.
    is_ratio : bool
        True if a number without a unit and of at most 1 is a ratio, which may be a percentage.
    """

    name: str
    force: int = 0
    length: float = 0
    low: float = -math.inf
    high: float = math.inf
    low_allowed: bool = True
    high_allowed: bool = True
    many: bool = False
    points: int = 0
    least_points: int = 2
    long_form: str = ""
    open_ended: bool = False
    choices: tuple[str, ...] = ()
    default: float | str | None = None
    group: str = ""
    without: float | None = None
    shared: bool = False
    is_ratio: bool = True

    @property
    def path(self) -> str:
        """Name of the parameter with its group, as in `group.name`."""
        return f"{self.group}.{self.name}" if self.group else self.name

    @property
    def point_count_text(self) -> str:
        """Allowed number of points as text, for a list of points."""
        words = {1: "one", 2: "two", 4: "four"}
        least, most = (words.get(count, str(count)) for count in (self.least_points, self.points))
        return f"{least} to {most} points"


@dataclass(frozen=True, eq=False)
class LawFunctions:
    """Compiled functions of a drift law.

    `tdint.kernels.layout` describes the tables and blocks that the arguments denote. Functions with
    a default of None are optional. A law documents only its formulas, not these arguments.

    Attributes
    ----------
    force : function
        (law_parameters, law_state, i, previous, trial, drift) -> tangent stiffness, N/m. Computes
        the force of the story if the drift changes monotonically from the state in block `previous`
        to `drift` (m). Writes FORCE and all other rows of the law's state except DRIFT, which the
        caller writes, to block `trial`.
    strain_energy : function
        (law_parameters, law_state, i) -> energy stored in the committed state, J.
    hysteretic_energy : function, optional
        (law_parameters, law_state, i) -> energy dissipated until the committed state, J. Default:
        row DISSIPATED.
    accumulate_dissipation : function, optional
        (law_parameters, law_state, i, previous, trial). Sets DISSIPATED of block `trial` to
        DISSIPATED of block `previous` plus the energy dissipated between the two states (J). Both
        blocks already contain the other rows of the state. Default: copies DISSIPATED.
    keep : function, optional
        (law_parameters, law_state, i, previous, trial). Copies all rows except the common rows from
        block `trial` to the committed state. A law with this function stores its branch in every
        state. If the law has no `accumulate_dissipation`, it can use
        `tdint.kernels.laws.branch_following.branch_first`.
    enter : function, optional
        (law_parameters, law_state, i). Sets SLOPE, UPPER and LOWER of the committed state. Default:
        initial stiffness and no limits.
    advance : function, optional
        (law_parameters, law_state, i, block, step, mean_force). Updates the rows other than DRIFT
        and FORCE, which the caller has set, after a change of the drift by `step` (m) along a
        branch, with the mean force `mean_force` (N). Default: adds the work to row WORK.
    switch : function, optional
        (law_parameters, law_state, i, block, event). Selects the branch that follows when the
        current branch ends by `event` (ABOVE, BELOW or REVERSED). Sets SLOPE, LOWER, UPPER and
        RATE_SIGN of the block (see `tdint.kernels.laws.branch_following.set_branch`), and FORCE and
        INTERNAL if their values change.
    points : function, optional
        (law_parameters, law_state, i, drift_change) -> number of Gauss points on a path with this
        change of drift (m, not negative), for a curved law. Default: 16.
    kink : function, optional
        (law_parameters, law_state, i, block, side) -> drift change in the direction `side` (1 or
        -1) after which the force of a curved law has a kink, m; infinite if the force has no kink.
    branch_first : bool
        True if `force` and `keep` are those of `tdint.kernels.laws.branch_following.branch_first`.
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
    branch_first: bool = False


@dataclass(frozen=True, eq=False)
class DriftLaw:
    """Drift law: hysteresis model of a story.

    In formulas, d is the story drift, k the initial stiffness and f the restoring force.

    Attributes
    ----------
    name : str
        Value of the key `type` in a model file.
    formula : str
        Description in one line, for the documentation and for messages.
    functions : callable
        () -> LawFunctions. Only this function imports numba.
    parameters : tuple of LawParameter
        Parameters in the order of the rows of `law_parameters` from FIRST_PARAMETER on. A `many`
        parameter must be the last.
    curved : bool
        True if a branch of the force is curved. False if all branches are linear.
    kinked : bool
        True if the tangent stiffness is discontinuous. The law then has a `switch`, and the changes
        of branch are located within a time step.
    concave : bool
        True if the force from a position of rest on is a concave function of the drift, in both
        directions: without pinching, slack or stiffening. The work up to a drift is then at least
        half of the largest force times the distance.
    extra_rows : int
        Number of rows of `law_state` that each state needs in addition to the common rows (see
        `tdint.kernels.layout.EXTRA_ROWS`).
    stiffens : callable
        Parameter values -> True if the story can become stiffer than its initial stiffness.
    symmetric : callable
        Parameter values -> True if the law is elastic, and forces at opposite drifts are opposite.
        The peak shear of a story then occurs at its peak drift.
    equal_directions : callable
        Parameter values -> True if opposite paths of the drift have opposite forces. Not required
        of a law that is `symmetric`. By default False, because only the law can state it.
    initial_stiffness : callable, optional
        Parameter values -> initial stiffness, N/m. None if the model file specifies the stiffness
        of the story.
    yield_drift : callable
        (initial stiffness, parameter values) -> drift at first yield, m; nan for a law without
        yielding.
    fault : callable
        (initial stiffness, parameter values) -> error message if the combination of parameters is
        invalid, otherwise None.
    stiffness_after_yield : callable, optional
        (initial stiffness, parameter values) -> stiffness after the first yield and before
        softening, N/m. Default: the slope is measured a tenth above `yield_drift`. A law without
        `yield_drift` does not yield.
    warning : callable
        (initial stiffness, parameter values) -> warning about allowed but unusual parameters,
        otherwise None.
    falls : callable
        (initial stiffness, parameter values) -> True if the tangent stiffness can be negative
        before `last_line`. The stiffness after yield and the last line are considered in any case.
    largest_stiffness : callable, optional
        (initial stiffness, parameter values) -> largest stiffness that can occur, N/m. Default: the
        initial stiffness.
    other_keys : tuple of (str, str)
        Names of parameters of other programs, each with the parameter that is meant, or a remedy.
    stops : callable
        Parameter values -> distances of the stops on the positive and on the negative side, m, 0
        for none, and their stiffness, N/m^stop_exponent.
    stop_exponent : float
        Exponent of the penetration in the force of a stop.
    tangent_damping : callable
        (parameter values, mass of two bodies in contact, kg) -> coefficient of damping with the
        tangent stiffness that belongs to the law, s; of the law `hertz`, without unit. Only the
        laws of attachments and links may have it, because the elements of a story share one
        coefficient.
    failed : float
        Value of row INTERNAL after the story has lost its strength permanently; nan if the law has
        no such state.
    last_line : callable
        (initial stiffness, parameter values, side 1 or -1) -> force at zero drift, N, and slope,
        N/m, of the line that limits the force of a side at large drifts; positive in the direction
        of the side. None for a law without such a line. A time integration ends where a falling
        line has no force, because the law continues the line.
    """

    name: str
    formula: str
    functions: Callable[[], LawFunctions]
    parameters: tuple[LawParameter, ...] = ()
    curved: bool = False
    kinked: bool = False
    concave: bool = False
    extra_rows: int = 0
    stiffens: Callable[[Sequence[float]], bool] = lambda values: False
    symmetric: Callable[[Sequence[float]], bool] = lambda values: False
    equal_directions: Callable[[Sequence[float]], bool] = lambda values: False
    initial_stiffness: Callable[[Sequence[float]], float] | None = None
    yield_drift: Callable[[float, Sequence[float]], float] = lambda stiffness, values: math.nan
    fault: Callable[[float, Sequence[float]], str | None] = lambda stiffness, values: None
    stiffness_after_yield: Callable[[float, Sequence[float]], float] | None = None
    largest_stiffness: Callable[[float, Sequence[float]], float] | None = None
    warning: Callable[[float, Sequence[float]], str | None] = lambda stiffness, values: None
    falls: Callable[[float, Sequence[float]], bool] = lambda stiffness, values: False
    other_keys: tuple[tuple[str, str], ...] = ()
    stops: Callable[[Sequence[float]], tuple[float, float, float]] = lambda values: (0.0, 0.0, 0.0)
    stop_exponent: float = 1.0
    tangent_damping: Callable[[Sequence[float], float], float] = lambda values, mass: 0.0
    failed: float = math.nan
    last_line: Callable[[float, Sequence[float], float], tuple[float, float] | None] = (
        lambda stiffness, values, side: None
    )


def can_fall(law: DriftLaw, stiffness: float, values: Sequence[float]) -> bool:
    """Return True if the tangent stiffness of a law can be negative."""
    if law.falls(stiffness, values):
        return True
    after_yield = law.stiffness_after_yield
    slopes = [after_yield(stiffness, values)] if after_yield else []
    lines = [law.last_line(stiffness, values, side) for side in (1.0, -1.0)]
    return min([*slopes, *(line[1] for line in lines if line)], default=0.0) < 0.0


def yields_at_its_strength(stiffness: float, values: Sequence[float]) -> float:
    """Return the drift at first yield, m, of a law whose first parameter is the yield force.

    Parameters
    ----------
    stiffness : float
        Initial stiffness, N/m.
    values : sequence of float
        Parameters of the law.
    """
    return values[0] / stiffness


def hardening_stiffness(stiffness: float, values: Sequence[float]) -> float:
    """Return the stiffness after yield, N/m, of a law whose second parameter is the hardening
    ratio."""
    return values[1] * stiffness
