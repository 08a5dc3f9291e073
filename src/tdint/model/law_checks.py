"""Verify the declarations of a plug-in hysteresis model (law) before a run uses it.

`impulse4` and `moment4` follow the branches of a law. If a branch has a finite slope (row SLOPE),
they treat the story as linear between the ends of the branch. A law that does not declare `curved`
and has no branches is treated as a single unlimited branch with the initial stiffness, so that
these methods never evaluate its `force`. All other methods evaluate only `force`. The functions of
the module therefore execute a law in plain Python along a path of drifts, compare the forces of
both approaches, and name the missing declaration if the forces differ.

The path of a law is verified before the first time integration of a story, with the parameters of
the story.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from tdint.arrays import Array
from tdint.errors import AnalysisError, UsageError
from tdint.kernels import layout as rows
from tdint.kernels.laws import LAWS, OURS
from tdint.kernels.laws.branch_following import branch_follower
from tdint.kernels.laws.law import DriftLaw, LawFunctions
from tdint.model.plugins import faults_of

_TURNS = (0.0, 1.0, 0.4, 1.5, -1.2, 0.1, -2.0, 2.0, -0.3)
"""Turning points of the path divided by its size: loading, short and long unloading, and reversals
through zero."""
_POINTS_PER_SEGMENT = 8
"""Number of drifts from one turning point to the next, including both turning points."""

_DECADES = (1e-4, 1e-3, 1e-2, 0.1, 1.0)
"""Sizes of paths, m, from the drift at first cracking of a stiff wall to drifts that no story
reaches. At least one of the paths is then long enough to exceed the first branch of a law."""

_YIELD_MULTIPLES = (0.3, 3.0, 20.0)
"""Sizes of paths divided by the drift at first yield: an elastic path, and paths with moderate and
large ductility."""

_FORCE_TOLERANCE = 1e-6
"""Tolerance of forces, relative to the maximum force. The forces of correct laws differ by about
1e-12."""

_TANGENT_TOLERANCE = 1e-2
"""Tolerance of tangents, relative to the maximum slope of the path."""

_SLOPE_INCREMENT = 1e-5
"""Increment of drift of the finite differences for slopes, divided by the size of the path."""

_MAX_SETS = 128
"""Maximum number of parameter sets of a law that are verified in a process. Declarations do not
depend on the parameters, and a study of 10 000 random buildings would otherwise spend a minute on
the verification of the same declaration."""

Guard = Callable[[Array, str], Array]
"""Function that wraps an array, given its name, to detect the use of undeclared rows."""


def _no_guard(array: Array, name: str) -> Array:
    """Return the array unchanged."""
    return array


_verified: dict[int, tuple[DriftLaw, set[bytes]]] = {}
"""Parameter sets that this process has verified, by the number of the law."""


class _PathPoint(NamedTuple):
    """Results of a law at a drift of the path.

    Attributes
    ----------
    drift, force : float
        Drift, m, and force from the function `force` of the law, N.
    branch_force : float
        Force from the branches of the law, N; nan if the current branch is curved.
    tangent : float
        Tangent that `force` returns, N/m.
    slopes : tuple of float
        Slopes of the force before and after the drift, N/m.
    force_after_commit : float
        Force at the same drift after the state is committed, N.
    tangents_after_commit : tuple of float
        Tangents slightly below and slightly above the drift, from the committed state, N/m: of a
        smooth law they are equal, whether the path continues or reverses.
    """

    drift: float
    force: float
    branch_force: float
    tangent: float
    slopes: tuple[float, float]
    force_after_commit: float
    tangents_after_commit: tuple[float, float]


def verify_laws(law_parameters: Array) -> None:
    """Verify the plug-in laws of a building with the parameters of its stories.

    Each set of parameters is verified only once per process.

    Parameters
    ----------
    law_parameters : ndarray, shape (..., rows, columns)
        Table of the drift laws of a building, or of buildings that share a model.

    Raises
    ------
    AnalysisError
        A declaration of a law is missing or wrong.
    """
    # Laws of plug-ins are numbered from `OURS` on.
    codes = law_parameters[..., rows.CODE, :]
    # Each row of `columns` is the column of the table for a story with a plug-in law.
    columns = np.moveaxis(law_parameters, -2, -1)[codes >= OURS]
    for column in np.unique(columns, axis=0):
        code = int(column[rows.CODE])
        law = LAWS[code]
        verified_law, verified = _verified.get(code, (None, set()))
        # A plug-in that was loaded later can have the number of an earlier law.
        if verified_law is not law:
            _verified[code] = law, verified = law, set()
        key = column.tobytes()
        if key in verified or len(verified) >= _MAX_SETS:
            continue
        file = getattr(sys.modules.get(law.functions.__module__), "__file__", None)
        try:
            with faults_of(file or f"law {law.name}"):
                faults = path_faults(law, column, _yield_drift(law, column))
        except UsageError as error:  # the functions of the law cannot be executed
            faults = [str(error)]
        if faults:
            raise AnalysisError("; ".join(faults))
        verified.add(key)


def path_faults(
    law: DriftLaw,
    column: Array,
    yield_drift: float = math.nan,
    guard: Guard = _no_guard,
) -> list[str]:
    """Compare the force of a law with its declarations along paths of drifts.

    Parameters
    ----------
    column : ndarray, shape (rows,)
        Number of the law, initial stiffness (N/m) and parameters, as in `law_parameters`.
    yield_drift : float
        Drift at first yield, m; nan if it is unknown.
    guard : callable
        Function that wraps an array, given its name, to detect the use of undeclared rows. By
        default, arrays are not wrapped.

    Returns
    -------
    list of str
        Message about the first difference; empty if there is no difference.
    """
    has_branches = law.functions().switch is not None
    yield_sizes = []
    if 0.0 < yield_drift < math.inf:
        yield_sizes = [yield_drift * multiple for multiple in _YIELD_MULTIPLES]
    # The tangent of a curved law is verified on short paths only. On long paths, finite differences
    # of nearly constant forces are inaccurate. The forces of a law with branches are also compared
    # on long paths, because a branch with a finite slope can start at large drifts.
    sizes = sorted([*yield_sizes, *_DECADES])
    short_sizes = (yield_sizes[:2] or _DECADES[:3]) if law.curved else sizes
    decisive = max(yield_sizes or _DECADES[:3])
    for size in sizes if law.kinked else short_sizes:
        max_force = max_slope = 0.0
        for point in _follow(law, column, guard, _path_drifts(size), _SLOPE_INCREMENT * size):
            # A law that stiffens without a limit has no finite force at drifts far beyond yield,
            # where a run ends with a message.
            if size > decisive and not math.isfinite(point.force):
                break
            max_force = max(max_force, abs(point.force))
            max_slope = max(max_slope, *map(abs, point.slopes))
            tolerance = _FORCE_TOLERANCE * max_force
            # A curved branch does not determine the force, so the forces are compared only on
            # branches with a finite slope.
            is_on_curve = law.curved and not math.isfinite(point.branch_force)
            if not (is_on_curve or abs(point.branch_force - point.force) <= tolerance):
                return [_branch_force_fault(law, point)]
            if not abs(point.force_after_commit - point.force) <= tolerance:
                return [
                    f"law {law.name}: its force at drift {point.drift:.6g} m is "
                    f"{point.force:.6g} N in the first evaluation and "
                    f"{point.force_after_commit:.6g} N after the state is committed; `keep` must "
                    "copy all values that `force` reads from the trial state to the committed state"
                ]
            if size not in short_sizes:
                continue
            # At a kink the tangent may have any value between the slopes before and after it.
            tolerance = _TANGENT_TOLERANCE * max_slope
            if not min(point.slopes) - tolerance <= point.tangent <= max(point.slopes) + tolerance:
                slope_before, slope_after = point.slopes
                return [
                    f"law {law.name}: the tangent is not the slope of the force: `force` returns "
                    f"{point.tangent:.6g} N/m at drift {point.drift:.6g} m, the slopes before and "
                    f"after it are {slope_before:.6g} and {slope_after:.6g} N/m"
                ]
            # Methods locate the reversals only of laws with branches. Otherwise, methods of fourth
            # order would be of second order without a message.
            below, above = point.tangents_after_commit
            if not has_branches and abs(above - below) > tolerance:
                return [
                    f"law {law.name}: its tangent jumps where the drift reverses: at drift "
                    f"{point.drift:.6g} m it is {below:.6g} N/m towards smaller and {above:.6g} "
                    "N/m towards larger drifts; declare `kinked=True`, and add `enter` and "
                    "`switch`, which end the branch at a reversal (`set_branch`)"
                ]
    return _memory_faults(law, column, guard, yield_drift)


def _branch_force_fault(law: DriftLaw, point: _PathPoint) -> str:
    """Return the message, with the remedy, about a law with a force that differs from the force on
    its branch.
    """
    forces = (
        f"{point.branch_force:.6g} N at drift {point.drift:.6g} m, but `force` returns "
        f"{point.force:.6g} N"
    )
    if law.functions().switch is None:
        return (
            f"law {law.name}: its tangent is not constant, but it declares neither `curved=True` "
            f"nor branches. Its initial stiffness gives {forces}; declare `curved=True`, or add "
            "`enter` and `switch` and declare `kinked=True`"
        )
    curved = "set row SLOPE to infinity on this branch" if law.curved else "declare `curved=True`"
    return (
        f"law {law.name}: its branches (`enter`, `switch`, `advance`) give {forces}; set the ends "
        "of the branch (rows LOWER, UPPER, TURN) and all other rows in `enter` and `switch` "
        f"(`set_branch` does this), or, if the force is not linear on the branch, {curved}"
    )


def _memory_faults(law: DriftLaw, column: Array, guard: Guard, yield_drift: float) -> list[str]:
    """Return a message if a law dissipates energy but has no function that computes this energy. A
    law dissipates energy if its force at a drift is different after a larger drift.

    Fixed path sizes are used if the drift at first yield is not positive and finite.
    """
    functions = law.functions()
    if functions.accumulate_dissipation is not None or functions.hysteretic_energy is not None:
        return []
    path_sizes = (3.0 * yield_drift,) if 0.0 < yield_drift < math.inf else _DECADES[:3]
    for path_size in path_sizes:
        # Load to 0.4 of the path size, continue to 1.5, and return to 0.4.
        relative_drifts = [0.1, 0.2, 0.3, 0.4, 0.7, 1.0, 1.25, 1.5, 1.0, 0.7, 0.4]
        drifts = path_size * np.array(relative_drifts)
        points = _follow(law, column, guard, drifts, _SLOPE_INCREMENT * path_size)
        forces = [point.force for point in points]
        first_index = relative_drifts.index(0.4)
        drift, force_before, force_after = drifts[first_index], forces[first_index], forces[-1]
        if not abs(force_after - force_before) <= _FORCE_TOLERANCE * max(map(abs, forces)):
            return [
                f"law {law.name}: its force at drift {drift:.6g} m is {force_before:.6g} N before "
                f"and {force_after:.6g} N after a larger drift, so that it dissipates energy, but "
                "it has neither `accumulate_dissipation` nor `hysteretic_energy`: add one of them"
            ]
    return []


# ---- Execution of a law in plain Python


def falls_on_path(law: DriftLaw, column: Array) -> bool:
    """Return True if the force of a law falls in the direction of the drift on a path that the
    checks follow.

    `column` contains number, initial stiffness and parameters, as in `law_parameters`.
    """
    yield_drift = _yield_drift(law, column)
    sizes: tuple[float, ...] = _DECADES
    if 0.0 < yield_drift < math.inf:
        sizes = tuple(yield_drift * multiple for multiple in _YIELD_MULTIPLES)
    limit = -_TANGENT_TOLERANCE * column[rows.STIFFNESS]
    for size in sizes:
        points = _follow(law, column, _no_guard, _path_drifts(size), _SLOPE_INCREMENT * size)
        # A law may be undefined at large drifts (overflow).
        with suppress(ArithmeticError, ValueError):
            if any(min(point.tangent, *point.slopes) < limit for point in points):
                return True
    return False


def tangent_at(law: DriftLaw, column: Array, drift: float) -> float:
    """Return the tangent stiffness of a law that is loaded from rest to a drift (m), N/m.

    `column` contains number, initial stiffness and parameters, as in `law_parameters`.
    """
    functions = law.functions()
    table = np.column_stack([column, np.zeros_like(column)])
    law_state = np.zeros((rows.EXTRA_ROWS + rows.LAW_STATE_BLOCKS * law.extra_rows, 2))
    _enter(law, functions, table, law_state)
    _evaluate(functions, table, law_state, 0.0)
    _commit(law, functions, table, law_state)
    return _evaluate(functions, table, law_state, drift)[1]


def _path_drifts(size: float) -> Array:
    """Return the drifts of a path that starts from rest, m, without the first drift (zero).

    The turning points are the drifts `_TURNS` multiplied by `size` (m).
    """
    turning_points = size * np.array(_TURNS)
    # The first drift of a segment is the last drift of the preceding segment, so omit it.
    return np.concatenate(
        [
            np.linspace(start, end, _POINTS_PER_SEGMENT)[1:]
            for start, end in pairwise(turning_points)
        ]
    )


def _follow(
    law: DriftLaw, column: Array, guard: Guard, drifts: Array, increment: float
) -> Iterator[_PathPoint]:
    """Evaluate a law at each drift of a path, and commit its state after each evaluation.

    The functions of the law are called directly, because the law may not have a number yet.
    `increment` is the increment of drift of the finite differences for slopes, m.
    """
    functions = law.functions()
    # The table of a building of one story has a second, empty column.
    table = guard(np.column_stack([column, np.zeros_like(column)]), "law_parameters")
    row_count = rows.EXTRA_ROWS + rows.LAW_STATE_BLOCKS * law.extra_rows
    law_state = guard(np.zeros((row_count, 2)), "law_state")
    follow_branches = branch_follower(functions.switch or _no_branch, functions.advance)
    with np.errstate(all="ignore"):
        _enter(law, functions, table, law_state)
        _evaluate(functions, table, law_state, 0.0)
        _commit(law, functions, table, law_state)
        for drift in drifts.tolist():
            branch_force = math.nan
            if law_state[rows.SLOPE, 0] < math.inf:
                follow_branches(table, law_state, 0, rows.COMMITTED, rows.SECOND_TRIAL, drift)
                branch_force = float(law_state[rows.SECOND_TRIAL + rows.FORCE, 0])
            # The force at the two neighboring drifts gives the slopes by finite differences.
            force_below, _ = _evaluate(functions, table, law_state, drift - increment)
            force_above, _ = _evaluate(functions, table, law_state, drift + increment)
            force, tangent = _evaluate(functions, table, law_state, drift)
            _commit(law, functions, table, law_state)
            force_after_commit, _ = _evaluate(functions, table, law_state, drift)
            tangent_below, tangent_above = (
                _evaluate(functions, table, law_state, drift + change)[1]
                for change in (-increment, increment)
            )
            slopes = (force - force_below) / increment, (force_above - force) / increment
            yield _PathPoint(
                drift,
                force,
                branch_force,
                tangent,
                slopes,
                force_after_commit,
                (tangent_below, tangent_above),
            )


def _no_branch(law_parameters: Array, law_state: Array, i: int, block: int, event: int) -> None:
    """Keep the branch unchanged; used as `switch` for laws without branches.

    `block` is the first row of the block of `law_state` with the branch. `event` is the event that
    ends the current branch: ABOVE, BELOW or REVERSED.
    """


def _evaluate(
    functions: LawFunctions, table: Array, law_state: Array, drift: float
) -> tuple[float, float]:
    """Return the force (N) and the tangent (N/m) of a story (first column) at a drift, starting
    from its committed state. The state at the drift is written to the first trial block of
    `law_state`.
    """
    law_state[rows.FIRST_TRIAL + rows.DRIFT, 0] = drift
    tangent = functions.force(table, law_state, 0, rows.COMMITTED, rows.FIRST_TRIAL, drift)
    return float(law_state[rows.FIRST_TRIAL + rows.FORCE, 0]), float(tangent)


def _commit(law: DriftLaw, functions: LawFunctions, table: Array, law_state: Array) -> None:
    """Accept the first trial state of a law (first column) as its committed state, as the time loop
    does.

    The dissipated energy of the step is added first. The function `keep` of a law copies its
    additional rows, which include its branch; this function copies the rows that all laws use. A
    law without `keep` does not store a branch in its trial state: a new branch starts from the
    committed state.
    """
    if functions.accumulate_dissipation is not None:
        functions.accumulate_dissipation(table, law_state, 0, rows.COMMITTED, rows.FIRST_TRIAL)
    if functions.keep is not None:
        functions.keep(table, law_state, 0, rows.COMMITTED, rows.FIRST_TRIAL)
    for row in range(rows.COMMON_ROWS):
        law_state[row, 0] = law_state[rows.FIRST_TRIAL + row, 0]
    if functions.keep is None:
        _enter(law, functions, table, law_state)


def _enter(law: DriftLaw, functions: LawFunctions, table: Array, law_state: Array) -> None:
    """Start the branch of the committed state of a law (first column), as `branches.enter` does.

    It is an unlimited branch with the initial stiffness; for a curved law, an infinite slope
    indicates that the branch is not linear. A law with the function `enter` then replaces this
    branch.
    """
    law_state[rows.SLOPE, 0] = math.inf if law.curved else table[rows.STIFFNESS, 0]
    law_state[rows.RATE_SIGN, 0] = 0.0
    law_state[rows.UPPER, 0] = math.inf
    law_state[rows.LOWER, 0] = -math.inf
    if functions.enter is not None:
        functions.enter(table, law_state, 0)


# ---- Parameters of a story


def _yield_drift(law: DriftLaw, column: Array) -> float:
    """Return the drift at first yield that a law declares for its parameters, m.

    `column` contains the values of the story: number of the law, stiffness and the parameters of
    the law.
    """
    return float(
        law.yield_drift(float(column[rows.STIFFNESS]), column[rows.FIRST_PARAMETER :].tolist())
    )
