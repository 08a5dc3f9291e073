"""The keys `stiffness_matrix`, `matrices` and `base` of a model file: linear models without springs
of stories.

A matrix is a list of rows, or a CSV file of numbers without a header.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tdint.arrays import Array
from tdint.model.config.matrix_keys import MATRICES
from tdint.model.config.number_tables import square_table
from tdint.model.config.sections import ModelUnits, read_inertia
from tdint.model.definition import Attachment, Link, Matrices
from tdint.model.keys.fields import Section, Value
from tdint.model.keys.nodes import ListNode
from tdint.model.story import Story, column_name, is_linear
from tdint.model.story_laws import LINEAR

MAX_ROWS = 2000
"""Maximum number of rows of a matrix model: a matrix of numbers of 8 bytes then has 32 MB."""

_ASYMMETRY = 1e-6
"""Dimensionless. Maximum difference of two entries of a symmetric matrix, divided by the root of
the product of their diagonal entries: the rounding of printed numbers. The mean is used."""

_MIN_PIVOT = 1e-12
"""Dimensionless. Smallest pivot of a positive definite matrix, divided by its diagonal entry."""

_NO_STIFFNESS = (
    "has no stiffness left with the rows before it free: the model is not supported or unstable"
)
_NO_MASS = "has no mass left beside the rows before it; a row without mass has zeros only"
_NEGATIVE_DAMPING = "adds energy with the rows before it: the damping must not be negative"
_LIST_OF_ROWS = "a list of rows of numbers, or a CSV file of numbers without a header"


def read_linear_stories(
    section: Section, unit: ModelUnits, stories: tuple[Story, ...], *, p_delta: bool
) -> tuple[Matrices | None, tuple[Story, ...]]:
    """Return the matrices of a model with flexural stories, a stiffness matrix or a base that
    moves, None for other models, and its stories. Shear stories on a base are flexural stories that
    do not bend."""
    value, base = section.get("stiffness_matrix"), section.get("base")
    is_chain = value is None and not any(story.flexural for story in stories)
    if base and is_chain:
        stories = _rigid_in_bending(base, stories, p_delta)
    elif is_chain:
        return None, stories
    if not _fits(section.value, len(stories)):
        return None, stories
    if not any(story.mass for story in stories):
        section.value.fault("at least one floor needs a mass")
        return None, stories
    flexural = [story.flexural is not None for story in stories]
    if value is not None:
        if base:
            base.fault("cannot be used with `stiffness_matrix`; include its springs in the matrix")
        if any(flexural):
            value.fault("cannot be used with `flexural` stories; give one of the two")
        stiffness = _read_matrix(value, unit.factor(force=1, length=-1), len(stories))
        _require_definite(value, stiffness, _numbers(len(stories)), _NO_STIFFNESS)
        return Matrices(stiffness=stiffness), stories
    if not all(flexural):
        if not (base and is_chain):
            number = flexural.index(False) + 1
            section.value.fault(
                f"story {number} needs `flexural`: either all stories bend, or none"
            )
        return None, stories
    return _read_base(section.inner("base"), unit), stories


def _read_base(section: Section, unit: ModelUnits) -> Matrices:
    """Return the springs, dashpots and inertia of a base; report those of a motion without a
    spring, which fixes the base."""
    values = []
    for motion, length, inertia in (("rotation", 1, "rotary_inertia"), ("translation", -1, "mass")):
        dashpot = f"{motion}_dashpot"
        if not section.has(motion):
            section.refuse((dashpot, inertia), f"needs `{motion}`, without which the base is fixed")
        values.append(
            (
                section.number(motion, scale=unit.factor(1, length), default=math.inf),
                section.number(dashpot, scale=unit.factor(1, length), default=0.0),
                read_inertia(section, unit, inertia, length=1 + length),
            )
        )
    springs, dashpots, inertias = zip(*values, strict=True)
    return Matrices(base=springs, base_dashpots=dashpots, base_inertia=inertias)


def _rigid_in_bending(base: Value, stories: tuple[Story, ...], p_delta: bool) -> tuple[Story, ...]:
    """Return shear stories as flexural stories with an infinite bending stiffness and the shear
    stiffness k h; report stories that are not linear springs with a height."""
    result, reported = [], set[str]()
    for number, story in enumerate(stories, start=1):
        further = {
            "no height, which the rotation of the base needs": story.height is None,
            "a law or elements; the floors above a base that moves are linear": (
                bool(story.elements) or story.law != LINEAR
            ),
            "a dashpot; give the damping as `damping`": (
                story.dashpot != 0.0 or story.power_dashpot is not None
            ),
            "`isolator`; give its stiffness as `translation` of the base": story.isolator,
            "`inertance`; write the model as `matrices`": story.inertance != 0.0,
            "P-delta; write the model as `matrices`": (
                p_delta if story.p_delta is None else story.p_delta
            ),
            "no Rayleigh damping; omit `rayleigh: false`": not (story.rayleigh or story.isolator),
        }
        for reason, is_present in further.items():
            if is_present and reason not in reported:
                reported.add(reason)
                base.fault(f"story {number} has {reason}")
        if story.height is not None and not any(further.values()):
            shear = story.stiffness * story.height
            story = replace(story, stiffness=math.nan, flexural=(math.inf, shear))
        result.append(story)
    return tuple(result)


def read_matrices(
    section: Section, value: Value, unit: ModelUnits
) -> tuple[Matrices | None, tuple[Story, ...]]:
    """Return the matrices of the key `matrices`, and a story without a height for each row; None
    and no stories after an error."""
    section.refuse(
        ("stories", "building", "stiffness_matrix", "base", "p_delta"),
        "cannot be used with `matrices`, which contains the complete model",
    )
    inner = value.section(MATRICES)
    if inner is None:
        return None, ()
    stiffness_value = inner.need("stiffness", f"give {_LIST_OF_ROWS}")
    mass_value = inner.need("mass", "give the masses of the rows, or a matrix")
    if stiffness_value is None or mass_value is None:
        return None, ()
    stiffness = _read_matrix(stiffness_value, unit.factor(force=1, length=-1))
    count = len(stiffness)
    if not _fits(stiffness_value, count):
        return None, ()
    names = _read_names(inner.get("names"), count)
    if unit.mass_is_open:
        mass_value.fault("the unit of mass is required: add mass to `units`")
    mass = _read_matrix(mass_value, unit.mass, count, diagonal=True)
    _require_definite(stiffness_value, stiffness, names, _NO_STIFFNESS)
    inertance: Array | tuple[()] = ()
    if inertance_value := inner.get("inertance"):
        inertance = _read_matrix(inertance_value, unit.mass, count, diagonal=True)
        if not np.any(mass):
            mass_value.fault("at least one row needs a mass")
        _require_definite(inertance_value, mass + inertance, names, _NO_MASS, zeros_allowed=True)
    else:
        _require_definite(mass_value, mass, names, _NO_MASS, zeros_allowed=True)
    damping_value = inner.get("damping")
    damping: Array | tuple[()] = ()
    if damping_value:
        damping = _read_matrix(damping_value, unit.factor(force=1, length=-1), count, diagonal=True)
        _require_definite(damping_value, damping, names, _NEGATIVE_DAMPING, is_semidefinite=True)
    if damping_value and section.has("damping"):
        damping_value.fault("cannot be used with `damping` of the model; give one of the two")
    influence = tuple(inner.read("influence") or (1.0,) * count)
    if len(influence) != count:
        inner.value.fault(f"influence must have {count} numbers, one per row, got {len(influence)}")
    if not any(influence):
        inner.value.fault("influence must not be zero in all rows")
    stories = tuple(Story(float(mass[i, i]), None, math.nan, LINEAR, 0.0) for i in range(len(mass)))
    return Matrices(stiffness, names, mass, damping, influence, inertance=inertance), stories


def check_devices(value: Value, devices: Sequence[Attachment | Link]) -> None:
    """Report attachments and links that are not linear."""
    for device in devices:
        if not is_linear(device.spring):
            value.fault(
                f"{device.name}: beside `flexural`, `base`, `stiffness_matrix` and `matrices`, the "
                "springs and dampers of attachments and links are linear, without a brace"
            )


def _fits(value: Value, count: int) -> bool:
    """Return False after reporting too many rows, or a missing row."""
    if count > MAX_ROWS:
        value.fault(f"a linear model of matrices has at most {MAX_ROWS} rows, got {count}")
    return 0 < count <= MAX_ROWS


def _numbers(count: int) -> tuple[str, ...]:
    """Return floor numbers as names of rows."""
    return tuple(str(i) for i in range(1, count + 1))


def _read_names(value: Value | None, count: int) -> tuple[str, ...]:
    """Return the unique names of the rows; default: row_1, row_2, ..."""
    if value is None:
        return tuple(f"row_{i}" for i in range(1, count + 1))
    names = tuple(value.read() or ())
    if names and len(names) != count:
        value.fault(f"must have {count} names, one per row of the stiffness, got {len(names)}")
    if len({column_name(name) for name in names}) < len(names):
        value.fault("must be different names")
    return names if len(names) == count else tuple(f"row_{i}" for i in range(1, count + 1))


def _read_matrix(
    value: Value, scale: float, count: int | None = None, *, diagonal: bool = False
) -> Array:
    """Return a symmetric matrix in SI units; unit numbers after reporting an error.

    `count` is the number of rows, if it is known. With `diagonal`, a list of numbers is the
    diagonal.
    """
    failed = np.eye(min(count or 0, MAX_ROWS))
    items = value.node.items if isinstance(value.node, ListNode) else ()
    if diagonal and items and not isinstance(items[0], ListNode):
        if len(items) != count:
            value.fault(f"must have {count} numbers, one per row, got {len(items)}")
            return failed
        entries = value.items("a list of numbers") or ()
        rows: Array | None = np.diag([entry.number() for entry in entries])
    else:
        rows = square_table(value, count, MAX_ROWS, _LIST_OF_ROWS)
    if rows is None or np.isnan(rows).any():  # the error has been reported
        return failed
    matrix = rows * scale
    size = np.sqrt(np.abs(np.outer(np.diagonal(matrix), np.diagonal(matrix))))
    difference = np.abs(matrix - matrix.T)
    wrong = np.argwhere(difference > _ASYMMETRY * size)
    if len(wrong):
        i, j = wrong[0].tolist()
        value.fault(
            f"must be symmetric; [{i + 1}, {j + 1}] is {rows[i, j]:.10g}, [{j + 1}, {i + 1}] is "
            f"{rows[j, i]:.10g}"
        )
    return np.asarray(0.5 * (matrix + matrix.T))


def _require_definite(
    value: Value,
    matrix: Array,
    names: Sequence[str],
    reason: str,
    *,
    zeros_allowed: bool = False,
    is_semidefinite: bool = False,
) -> None:
    """Report the first row where a matrix is not positive definite, with a reason. With
    `zeros_allowed`, rows of zeros are allowed, but not in all rows; with `is_semidefinite`, any
    positive semidefinite matrix up to the rounding of printed numbers."""
    diagonal = np.diagonal(matrix)
    if is_semidefinite:
        if not matrix.any():
            return
        zeros_allowed = True
        matrix = matrix + np.diag(_ASYMMETRY * diagonal)
    wrong = np.flatnonzero(diagonal < 0.0 if zeros_allowed else diagonal <= 0.0)
    kept = np.flatnonzero(matrix.any(axis=1))
    if wrong.size:
        row, reason = int(wrong[0]), f"is {diagonal[wrong[0]]:.6g} in SI units"
    elif not kept.size:
        value.fault("at least one row needs a mass")
        return
    else:
        pivot = _first_pivot(matrix[np.ix_(kept, kept)])
        if pivot is None:
            return
        row = int(kept[pivot])
    value.fault(
        f"must be positive {'semidefinite' if is_semidefinite else 'definite'}; row {row + 1}, "
        f"column {row + 1} ({names[row]}) {reason}"
    )


def _first_pivot(matrix: Array) -> int | None:
    """Return the index of the first row that is not positive definite."""
    from scipy.linalg.lapack import dpotrf

    factor, failed = dpotrf(matrix, lower=1)
    pivots = np.square(np.diagonal(factor))
    count = failed - 1 if failed > 0 else len(matrix)
    small = np.flatnonzero(pivots[:count] <= _MIN_PIVOT * np.diagonal(matrix)[:count])
    if small.size:
        return int(small[0])
    return failed - 1 if failed > 0 else None
