"""Impulse and first moment of the equation of motion over the step: order 4, and energy never made.

The paper of 2022 integrates the equation of motion once over the step: impulse equals change of
momentum. Here it is integrated twice, with the weights 1 and s = t - 1/2, t in [0, 1] (times 12):

    impulse        M A0 + C U0 + int f(u) dt              = mean of p
    first moment   M A1 + C U1 + 12 int s f(u) dt + r h K U1 = 12 (mean of s p)
    path           u(t) = u0 + h U0 t + h U1 (t^2 - t) / 2
                   U0 = v0 + h (A0 / 2 - A1 / 12),   U1 = h A0 + r h A1
    end            u1 = u0 + h U0,   v1 = v0 + h A0

with the acceleration A0 + A1 s, K the initial stiffness and r = (1 - rho_inf) / (6 (1 + rho_inf)).
The rate on the path is U0 + U1 s, so that h (U0 impulse + U1 first moment / 12) is the balance of
energy:

    change of kinetic energy + work of the restoring forces along the path
        = work of the load - h (U0 C U0 + U1 C U1 / 12) - h^2 r / 12 (A1 M A1 + U1 K U1)

With both integrals of the restoring force exact, the work along the path is the change of what an
elastic story stores, at any step: for rho_inf = 1 energy is kept to rounding, and below it never
made. What a story with a memory dissipates is the work along the path. Turning points and branch
ends on a parabola are roots of quadratics, so a law that is linear branch by branch is integrated
exactly, without a search for events (`tdint.kernels.stories.path`). The load enters by its impulse
and first moment, which a record tells exactly over any number of samples. For rho_inf below 1 a
floor force has, in place of its moment, the one that makes stiff parts follow it at the ends of the
steps.

| here | in the code (`tdint.kernels.equations.moment4`) | equation |
|---|---|---|
| h U0, h U1 | `work[RISE]`, `work[BEND]`: the unknowns | path |
| h^2 A0, h^2 A1 | `work[A0]`, `work[A1]`, from rise, bend and v0 | path |
| int f dt, 12 int s f dt | `MEAN`, `MOMENT` of `tdint.kernels.stories.path`, by story | impulse, moment |
| mean of p, 12 (mean of s p) | `work[LOAD]`, two rows (`mean_load`) | impulse, moment |
| r, 12 / (1 + 6 r) | `coefficients[R]`, `coefficients[BY_RISE]` | path, first moment |

In a linear building the step is that of impulse4 with the same rho_inf, as long as the load is
linear in it. For rho_inf = 1 it is the energy-preserving collocation method of order 4 (Hairer
2010), which is the continuous Galerkin method of degree 2 in time (Betsch and Steinmann 2000).
"""  # noqa: E501

from __future__ import annotations

from tdint.kernels import layout as rows
from tdint.kernels.compiling import kernel
from tdint.kernels.equations.corners import update_peaks_at_corners
from tdint.kernels.equations.moment4 import ROW, R, finish, move, scratch_rows
from tdint.kernels.laws.selection import HAS_NONLINEAR_FORCE
from tdint.kernels.linear_terms import finite, mean_load
from tdint.kernels.stepping import STEP, Memory, Scene
from tdint.methods.method import Family, Method, Parameter


@kernel(STEP)
def step(
    coefficients,
    linear_terms,
    modal,
    law_parameters,
    forces,
    flags,
    h,
    load,
    state,
    law_state,
    scratch,
    step_status,
):
    """One step. State row ACCELERATION is the next one's first guess, where it needs one."""
    mean_load(linear_terms, forces, load, h, coefficients[R], scratch, ROW.LOAD)
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, law_state, scratch, step_status)
    code = move(coefficients, scene, h, memory)
    if code < 0:
        return code
    if HAS_NONLINEAR_FORCE:
        update_peaks_at_corners(scene, h, load, memory)
    finish(coefficients, scene, h, memory)
    return code if finite(state, linear_terms.shape[1] - 1) else rows.NOT_FINITE


def coefficients(rho_inf: float) -> tuple[float, ...]:
    """r, and 12 / (1 + 6 r), for a spectral radius rho_inf at infinity."""
    r = (1.0 - rho_inf) / (6.0 * (1.0 + rho_inf))
    return r, 12.0 / (1.0 + 6.0 * r)


FAMILY = Family(
    "moment4",
    step,
    scratch_rows,
    memory=(rows.DISPLACEMENT, rows.VELOCITY),
    own_work=True,
    parabolic=True,
)
METHODS = (
    Method(
        name="moment4",
        family=FAMILY,
        parameters=(Parameter("rho_inf", 1.0, 0.0, 1.0),),
        coefficients=coefficients,
        order=lambda rho_inf: 4 if rho_inf == 1.0 else 3,
        rho_inf=lambda rho_inf: rho_inf,
        source="tdint: impulse and first moment; rho_inf = 1 is Hairer's energy-preserving "
        "collocation (2010), s = 2",
    ),
)
