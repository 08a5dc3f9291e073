"""Convergence tests and line search of Newton's method, shared by the implicit methods.

The equations of a step are solved by Newton's method with factorizations that are reused. A kink of
a hysteretic law can make the iteration cycle without convergence if the time step is large.
Therefore, after UNDAMPED_ITERATIONS full corrections, a correction must reduce the squared norm S
of the residual r, weighted with the inverse masses. With a fraction q of the correction applied,

    S = sum_i r_i^2 / m_i,     S(q) <= (1 - _REQUIRED_DECREASE q) S(0)

The fraction q starts at 1 and is halved until the condition is satisfied. If q is at most
MIN_STEP_FRACTION, the correction is accepted even if the condition is not satisfied. The method
moment4 applies the condition to every correction and has a separate norm and residual tolerance.
"""

from __future__ import annotations

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined

# Corrections of a step before it counts as not converged. Halving a correction is not counted.
MAX_ITERATIONS = 30

# Corrections that are applied fully, without a line search and without computing the norm.
UNDAMPED_ITERATIONS = 6

# Dimensionless. A correction is not halved again once its fraction is at most this value; the
# smallest fraction that is tried is therefore 2^-10.
MIN_STEP_FRACTION = 1e-3

# Dimensionless. Maximum residual relative to the sum of the absolute values of its terms.
RESIDUAL_TOLERANCE = 1e-11

# Dimensionless. Upper limit of the tolerance of `tolerance_of_run`. As a fixed tolerance, it would
# limit the accuracy of peak drifts to about 5e-5.
_MAX_TOLERANCE = 1e-4

# Dimensionless. Maximum correction relative to the unknown (usually a displacement) that is
# regarded as rounding error.
ROUNDING = 1e-14

# Unit of the residual. Absolute tolerance, added to the relative one. Ahead of a wave front the
# forces are so small that their products underflow, and a relative tolerance cannot be satisfied.
RESIDUAL_FLOOR = 1e-250

# Dimensionless. Change of a tangent relative to the initial stiffness (for dashpots: of h times the
# damping coefficient relative to the mass) that still permits the existing factorization.
TANGENT_TOLERANCE = 1e-3

# Dimensionless. Relative decrease of the squared norm that is required of a full correction.
_REQUIRED_DECREASE = 1e-4


@inline
def update_run_maxima(scratch, row, mismatch, size):
    """Update the maxima over the run, in columns 0 and 1 of `row`, that determine the tolerance of
    Newton's method.

    `mismatch` is a sum of squared differences between two approximations of the accelerations of
    the floors, `size` the corresponding sum of squared accelerations. The quotient of their maxima
    is a measure of the error of the steps, of order 4 in the time step.
    """
    scratch[row, 0] = max(mismatch, scratch[row, 0])
    scratch[row, 1] = max(size, scratch[row, 1])


@inline
def tolerance_of_run(scratch, row, tolerance_per_mismatch):
    """Return the relative tolerance of the residuals of Newton's method in a step:
    `tolerance_per_mismatch` times the relative mismatch (`update_run_maxima`), between
    RESIDUAL_TOLERANCE and _MAX_TOLERANCE.
    """
    # Without maxima, as in the first step of a run, the strictest tolerance is used.
    tolerance = RESIDUAL_TOLERANCE
    if scratch[row, 1] > 0.0:
        mismatch = scratch[row, 0] / scratch[row, 1]
        tolerance = min(_MAX_TOLERANCE, max(RESIDUAL_TOLERANCE, tolerance_per_mismatch * mismatch))
    return tolerance


@outlined
def squared_norm(linear_terms, scratch, row, n):
    """Return the sum of r_i^2 / m_i over `n` floors, with the residuals r_i and the masses m_i.

    Parameters
    ----------
    row : int
        Row of the residuals in `scratch`.

    Returns
    -------
    float
        Squared norm in the squared unit of the residuals per kg: N^2/kg for forces.
    """
    total = 0.0
    for i in range(n):
        total += linear_terms[rows.INVERSE_MASS, i] * scratch[row, i] * scratch[row, i]
    return total


@inline
def must_halve(norm, previous_norm, fraction):
    """Return True if the line search must halve the applied fraction of a correction.

    A correction is accepted if S(q) is nan: the iteration then ends without convergence, and the
    time loop halves the step. An infinite `previous_norm` accepts every correction.
    """
    limit = previous_norm * (1.0 - _REQUIRED_DECREASE * fraction)
    return norm > limit and fraction > MIN_STEP_FRACTION


@outlined
def copy_rows(source, first, target, first_target, row_count, n):
    """Copy the first `n` columns of consecutive rows of the table `source` to the table `target`,
    which can be the same.

    Parameters
    ----------
    first, first_target : int
        First row in the source and in the target.
    """
    for row in range(row_count):
        for i in range(n):
            target[first_target + row, i] = source[first + row, i]


@outlined
def add_rows(factor, scratch, source, target, row_count, n):
    """Add `factor` times consecutive rows to other rows of the scratch array.

    The line search uses this function to apply or remove a fraction of a correction.

    Parameters
    ----------
    factor : float
        Factor of the source rows, of either sign.
    """
    for row in range(row_count):
        for i in range(n):
            scratch[target + row, i] += factor * scratch[source + row, i]


@inline
def is_balanced(is_last, tolerance, step_status, i, residual, scale):
    """Return True if the residual of an equation is within the tolerance; False for an infinite
    residual.

    `scale` is the sum of the absolute values of the terms. If `is_last`, no further iteration is
    allowed: the largest relative residual and the index of its floor are stored in `step_status`
    for the error message. The caller sets RESIDUAL to 0 before the first equation.
    """
    # With an infinite force, the difference of residual and scale is nan, so that the condition is
    # False.
    is_small = abs(residual) - tolerance * scale <= RESIDUAL_FLOOR
    # "not ... <=" is also True for nan, so that an equation with invalid values is reported. A
    # later equation that is not balanced replaces a stored nan.
    if is_last and not is_small and not abs(residual) / scale <= step_status[rows.RESIDUAL]:
        step_status[rows.RESIDUAL] = abs(residual) / scale
        step_status[rows.WORST_STORY] = i
    return is_small
