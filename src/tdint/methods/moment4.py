"""Method moment4: impulse and first moment of the equations of motion over a step; order 4.

The paper of 2022 integrates the equations of motion once over the step: the impulse is equal to the
change of momentum. This method integrates them twice, with the weight 1 (impulse) and with the
weight 12 s (first moment), where s = t - 1/2 and t increases from 0 to 1 over the step:

    impulse        M A0 + C U0 + int f(u) dt              = mean of p
    first moment   M A1 + C U1 + 12 int s f(u) dt + r h K U1 = 12 (mean of s p)
    path           u(t) = u0 + h U0 t + h U1 (t^2 - t) / 2
                   U0 = v0 + h (A0 / 2 - A1 / 12),   U1 = h A0 + r h A1
    end            u1 = u0 + h U0,   v1 = v0 + h A0

with the acceleration A0 + A1 s, K the initial stiffness and r = (1 - rho_inf) / (6 (1 + rho_inf)).
The velocity along the path is U0 + U1 s. The sum of the first equation times h U0 and of the second
equation times h U1 / 12 is therefore the energy balance:

    change of kinetic energy + work of the restoring forces along the path
        = work of the load - h (U0 C U0 + U1 C U1 / 12) - h^2 r / 12 (A1 M A1 + U1 K U1)

If both integrals of the restoring force are exact, the work along the path is equal to the change
of the strain energy of an elastic story for any step length. The energy is then conserved up to
rounding for rho_inf = 1, and it never increases for rho_inf < 1. The energy dissipated by a
hysteretic story is the work along the path.

Reversals and branch ends on a parabola are roots of quadratics. A law that is linear on its
branches is therefore integrated exactly, without a search for branch changes
(`tdint.kernels.stories.path`). The load enters by its impulse and its first moment, which are exact
for a sampled record over any number of samples. For rho_inf < 1, the first moment of a force on a
floor is replaced by a value with which stiff parts of the building follow the force at the
endpoints of the steps (`tdint.kernels.linear_terms.mean_load`).

| here | in the code (`tdint.kernels.equations.moment4`) | equation |
|---|---|---|
| h U0, h U1 | `scratch[RISE]`, `scratch[BEND]`: the unknowns | path |
| h^2 A0, h^2 A1 | `scratch[A0]`, `scratch[A1]`, from rise, bend and v0 | path |
| int f dt, 12 int s f dt | `MEAN`, `MOMENT` of `tdint.kernels.stories.path`, for each story | impulse, moment |
| mean of p, 12 (mean of s p) | `scratch[LOAD]`, two rows (`mean_load`) | impulse, moment |
| r, 12 / (1 + 6 r) | `coefficients[R]`, `coefficients[BY_RISE]` | path, first moment |
| tolerance of the residuals | `coefficients[TOLERANCE]` | impulse, first moment |

In a linear building, the step is equal to the step of impulse4 with the same rho_inf if the load is
linear within the step. For rho_inf = 1 it is the energy-preserving collocation method of order 4
(Hairer 2010), which is the continuous Galerkin method of degree 2 in time (Betsch and Steinmann
2000).
"""  # noqa: E501

from __future__ import annotations

from tdint.kernels import layout as rows
from tdint.kernels.equations.corners import update_peaks_at_corners
from tdint.kernels.equations.moment4 import (
    MAX_RESIDUAL,
    ROW,
    R,
    scratch_rows,
    solve_step,
    update_state,
)
from tdint.kernels.linear_terms import finite, mean_load
from tdint.kernels.stepping import step_kernel
from tdint.methods.method import SIMPSON_MEAN, Family, Method, Parameter


@step_kernel
def step(coefficients, scene, h, load, memory):
    """Integrate the equations of motion over one time step of moment4.

    The unknowns are D0 = h U0 and D1 = h U1. P0 = int p dt is the mean of the load p, and P1 = 12
    int s p dt its first moment. For r > 0, the moment in P1 of an external force q on a floor is
    replaced by q1 - q0 + 12 r ((q0 + q1) / 2 - mean of q), with the values q0 at the start and q1
    at the end (`mean_load`). The term r h K U1 results from the same rule for the linear force K
    u(t).

    If a story changes its branch or reverses, the peaks within the step are computed before the
    update of the state, because they require the state at the start of the step. The state row
    ACCELERATION is only the first guess of the next step.
    """
    linear_terms, _, _, forces, _ = scene
    state, _, scratch, _ = memory
    mean_load(linear_terms, forces, load, h, coefficients[R], scratch, ROW.LOAD)
    # D0 and D1
    code = solve_step(coefficients, scene, h, memory)
    if code < 0:
        return code
    update_peaks_at_corners(coefficients, scene, h, load, memory)
    update_state(coefficients, scene, h, memory)
    return code if finite(state, linear_terms.shape[1] - 1) else rows.NOT_FINITE


def coefficients(rho_inf: float) -> tuple[float, ...]:
    """Return the coefficients of the step: r, 12 / (1 + 6 r) and the tolerance of the residuals.

    The second coefficient is a factor in the change of the acceleration over the step, h^2 A1 = (h
    U1 / 2 - h U0 + h v0) 12 / (1 + 6 r).
    """
    r = (1.0 - rho_inf) / (6.0 * (1.0 + rho_inf))
    return r, 12.0 / (1.0 + 6.0 * r), MAX_RESIDUAL


def estimating_coefficients(rho_inf: float) -> tuple[float, ...]:
    """Return the coefficients of a run of moment4 that estimates the errors of another run.

    They are r = (1 - rho_inf) / (6 (1 + rho_inf)), 12 / (1 + 6 r) and the tolerance of the
    residuals, which is larger than in `coefficients` to save iterations (_ESTIMATING_TOLERANCE).
    """
    return *coefficients(rho_inf)[:-1], _ESTIMATING_TOLERANCE


_ESTIMATING_TOLERANCE = 1e-7
"""Dimensionless. Tolerance of the residuals of a run that estimates errors. A single iteration
per step instead of two reduces the time to 0.8. 99 % of its peaks change by less than 3e-6, a third
of the smallest error estimate (24 random buildings, time steps of 1 to 1/4 sample).
"""

FAMILY = Family(
    "moment4",
    step,
    scratch_rows,
    memory=(rows.DISPLACEMENT, rows.VELOCITY),
    own_work=True,
    parabolic=True,
    mean_rule=SIMPSON_MEAN,
    step_peaks=ROW.PEAKS,
    devices=True,
    braced_devices=True,
)
METHODS = (
    Method(
        name="moment4",
        family=FAMILY,
        parameters=(Parameter("rho_inf", 1.0, 0.0, 1.0),),
        coefficients=coefficients,
        estimating_coefficients=estimating_coefficients,
        order=lambda rho_inf: 4 if rho_inf == 1.0 else 3,
        rho_inf=lambda rho_inf: rho_inf,
        braces=True,
        tangent_damping=lambda *values: True,
        variants=("rho_inf=0.5", "rho_inf=0"),
        source="tdint: impulse and first moment; rho_inf = 1 is Hairer's energy-preserving "
        "collocation (2010), s = 2",
    ),
)
