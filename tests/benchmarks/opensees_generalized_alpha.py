"""Show why generalized-alpha of OpenSees has order 1 if it iterates.

    python tests/benchmarks/opensees_generalized_alpha.py

The undamped oscillator has a period of 1 s and a sine load; its spring is linear or Steel01.
rho_inf is 0.8. With one solution per step (algorithm Linear), the displacements of OpenSeesPy
agree with generalized-alpha. With Newton's method, each further iteration balances the restoring
force and the load at the weighted time with the acceleration at the END of the step. `integrate`
implements both schemes, and the table compares OpenSeesPy with them.
"""

import math
from functools import partial

import numpy as np

from tdint.assessment.chart.opensees_worker import load

RHO = 0.8
# Weights of the end of the step in the inertia force and in the restoring force and the load. In
# the notation of Chung and Hulbert (1993): 1 - alpha_m and 1 - alpha_f.
OF_MASS, OF_FORCE = (2.0 - RHO) / (1.0 + RHO), 1.0 / (1.0 + RHO)
GAMMA, BETA = 0.5 + OF_MASS - OF_FORCE, 0.25 * (1.0 + OF_MASS - OF_FORCE) ** 2
# Unit mass: stiffness, N/m, yield force, N, and ratio of the stiffness after yielding.
STIFFNESS, YIELD, HARDENING = (2.0 * math.pi) ** 2, 0.8, 0.05
OMEGA, FORCE, DURATION = 5.0, -1.2, 4.0  # load FORCE sin(OMEGA t): rad/s, N, s
STEPS = (0.02, 0.01, 0.005, 0.0025)  # s


def run_opensees(ops, integrator, h, *, yields, algorithm):
    """Integrate the oscillator with OpenSeesPy.

    Parameters
    ----------
    ops : module
        OpenSeesPy.
    integrator : tuple
        Name and coefficients of the integrator.
    h : float
        Time step, s.
    yields : bool
        True for a spring with the material Steel01, False for a linear spring.
    algorithm : {"Linear", "Newton"}
        Linear solves once per step.

    Returns
    -------
    displacements : ndarray, shape (steps + 1,)
        Displacements at the ends of the steps, m, from t = 0 on.
    iterations : float
        Mean number of iterations per step.
    """
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    for node in (0, 1):
        ops.node(node, 0.0)
    ops.fix(0, 1)
    ops.mass(1, 1.0)
    ops.uniaxialMaterial(
        *(("Steel01", 1, YIELD, STIFFNESS, HARDENING) if yields else ("Elastic", 1, STIFFNESS))
    )
    ops.element("zeroLength", 1, 0, 1, "-mat", 1, "-dir", 1)
    ops.timeSeries("Trig", 1, 0.0, 1e9, 2.0 * math.pi / OMEGA, "-factor", FORCE)
    ops.pattern("Plain", 1, 1)
    ops.load(1, 1.0)
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("BandSPD")
    ops.test("NormUnbalance", 1e-11, 400)
    ops.algorithm(algorithm)
    ops.integrator(*integrator)
    ops.analysis("Transient")
    count, iterations, displacements = round(DURATION / h), 0, [0.0]
    for _ in range(count):
        if ops.analyze(1, h) != 0:
            raise SystemExit(f"{integrator}, time step {h:g} s: no convergence")
        iterations += 1 if algorithm == "Linear" else ops.testIter()
        displacements.append(ops.nodeDisp(1, 1))
    return np.array(displacements), iterations / count


def integrate(h, *, yields, of_mass):
    """Integrate the oscillator with generalized-alpha or with the scheme of OpenSees.

    Parameters
    ----------
    h : float
        Time step, s.
    yields : bool
        True for a bilinear spring, False for a linear spring.
    of_mass : float
        Weight of the acceleration at the end of the step in the equation of motion: `OF_MASS` for
        generalized-alpha, 1 for the scheme to which the iterations of OpenSees converge.

    Returns
    -------
    ndarray, shape (steps + 1,)
        Displacements at the ends of the steps, m, from t = 0 on.
    """
    u = v = a = offset = 0.0
    displacements = [0.0]
    for step in range(round(DURATION / h)):
        weighted_load = FORCE * math.sin(OMEGA * h * (step + OF_FORCE))
        end = u
        for _ in range(200):
            a_end = (end - u) / (BETA * h * h) - v / (BETA * h) - (0.5 / BETA - 1.0) * a
            force, tangent, _ = spring((1.0 - OF_FORCE) * u + OF_FORCE * end, offset, yields)
            residual = weighted_load - (1.0 - of_mass) * a - of_mass * a_end - force
            if abs(residual) < 1e-12:
                break
            end += residual / (of_mass / (BETA * h * h) + OF_FORCE * tangent)
        offset = spring(end, offset, yields)[2]
        v += h * ((1.0 - GAMMA) * a + GAMMA * a_end)
        u, a = end, a_end
        displacements.append(u)
    return np.array(displacements)


def spring(u, offset, yields):
    """Return force, tangent stiffness and new plastic displacement of a spring.

    Parameters
    ----------
    u : float
        Displacement, m.
    offset : float
        Plastic displacement before, m.
    yields : bool
        True for a bilinear spring with kinematic hardening, False for a linear spring.
    """
    if not yields:
        return STIFFNESS * u, STIFFNESS, 0.0
    # A linear spring in parallel with an elastoplastic spring.
    stiffness, limit = (1.0 - HARDENING) * STIFFNESS, (1.0 - HARDENING) * YIELD
    plastic_force = stiffness * (u - offset)
    if abs(plastic_force) <= limit:
        return HARDENING * STIFFNESS * u + plastic_force, STIFFNESS, offset
    plastic_force = math.copysign(limit, plastic_force)
    force = HARDENING * STIFFNESS * u + plastic_force
    return force, HARDENING * STIFFNESS, u - plastic_force / stiffness


def main():
    """Print the convergence rate of the iterations, and a table of errors and differences."""
    ops = load()
    average, alpha = ("Newmark", 0.5, 0.25), ("GeneralizedAlpha", OF_MASS, OF_FORCE)
    print(
        f"rho_inf {RHO:g}: (1 - alpha_m) / alpha_m = {(1.0 - OF_MASS) / OF_MASS:.3g} is the "
        "convergence rate of its iterations"
    )
    print(
        "| spring | algorithm | dt (s) | iterations per step | error | difference from "
        "generalized-alpha | difference from the scheme with the acceleration at the end |"
    )
    print("|---|---|---|---|---|---|---|")
    for yields, algorithm in ((False, "Linear"), (False, "Newton"), (True, "Newton")):
        run = partial(run_opensees, ops, yields=yields, algorithm=algorithm)
        fine = run(average, STEPS[-1] / 20.0)[0]
        maximum = np.max(np.abs(fine))
        for h in STEPS:
            u, iterations = run(alpha, h)
            references = (
                fine[:: round(h / STEPS[-1] * 20.0)],
                *(integrate(h, yields=yields, of_mass=weight) for weight in (OF_MASS, 1.0)),
            )
            differences = [np.max(np.abs(u - reference)) / maximum for reference in references]
            cells = " | ".join(f"{difference:.1e}" for difference in differences)
            print(
                f"| {'Steel01' if yields else 'Elastic'} | {algorithm} | {h:g} | {iterations:.1f} "
                f"| {cells} |"
            )


if __name__ == "__main__":
    main()
