"""Why OpenSees' generalized-alpha falls to order 1: python
tests/benchmarks/opensees_generalized_alpha.py

An oscillator of 1 s under a sine, linear and with Steel01, no damping, rho_inf 0.8. With one solve
in a step (algorithm Linear) OpenSeesPy's motion is generalized-alpha. Each further iteration
balances the restoring force and the load of the weighted time with the acceleration at the END of
the step: the motion it converges to is that scheme's, found here apart.
"""

import math
from functools import partial

import numpy as np

from tdint.analysis.chart.opensees_worker import load

RHO = 0.8
OF_MASS, OF_FORCE = (2.0 - RHO) / (1.0 + RHO), 1.0 / (1.0 + RHO)  # weights of the end of the step
GAMMA, BETA = 0.5 + OF_MASS - OF_FORCE, 0.25 * (1.0 + OF_MASS - OF_FORCE) ** 2
STIFFNESS, YIELD, HARDENING = (2.0 * math.pi) ** 2, 0.8, 0.05
OMEGA, FORCE, DURATION = 5.0, -1.2, 4.0
STEPS = (0.02, 0.01, 0.005, 0.0025)


def opensees(ops, integrator, h, *, yields, algorithm):
    """Displacements, shape (steps + 1,), and iterations a step."""
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
    count, iterations, found = round(DURATION / h), 0, [0.0]
    for _ in range(count):
        if ops.analyze(1, h) != 0:
            raise SystemExit(f"{integrator}, step {h:g}: not converged")
        iterations += 1 if algorithm == "Linear" else ops.testIter()
        found.append(ops.nodeDisp(1, 1))
    return np.array(found), iterations / count


def scheme(h, *, yields, of_mass):
    """Displacements where the acceleration in the balance has this weight of the end of the
    step."""
    u = v = a = offset = 0.0
    found = [0.0]
    for step in range(round(DURATION / h)):
        load_there = FORCE * math.sin(OMEGA * h * (step + OF_FORCE))
        end = u
        for _ in range(200):
            a_end = (end - u) / (BETA * h * h) - v / (BETA * h) - (0.5 / BETA - 1.0) * a
            force, tangent, _ = spring((1.0 - OF_FORCE) * u + OF_FORCE * end, offset, yields)
            rest = load_there - (1.0 - of_mass) * a - of_mass * a_end - force
            if abs(rest) < 1e-12:
                break
            end += rest / (of_mass / (BETA * h * h) + OF_FORCE * tangent)
        offset = spring(end, offset, yields)[2]
        v += h * ((1.0 - GAMMA) * a + GAMMA * a_end)
        u, a = end, a_end
        found.append(u)
    return np.array(found)


def spring(u, offset, yields):
    """Force, tangent and plastic offset of a bilinear spring with kinematic hardening."""
    if not yields:
        return STIFFNESS * u, STIFFNESS, 0.0
    soft = (1.0 - HARDENING) * STIFFNESS
    part, limit = soft * (u - offset), (1.0 - HARDENING) * YIELD
    if abs(part) <= limit:
        return HARDENING * STIFFNESS * u + part, STIFFNESS, offset
    part = math.copysign(limit, part)
    return HARDENING * STIFFNESS * u + part, HARDENING * STIFFNESS, u - part / soft


def main():
    ops = load()
    average, alpha = ("Newmark", 0.5, 0.25), ("GeneralizedAlpha", OF_MASS, OF_FORCE)
    print(
        f"rho_inf {RHO:g}: (1 - alpha_m) / alpha_m = {(1.0 - OF_MASS) / OF_MASS:.3g}, the rate of "
        "its iterations"
    )
    print(
        "| spring | algorithm | dt (s) | iterations a step | error | off generalized-alpha | off "
        "the other scheme |"
    )
    print("|---|---|---|---|---|---|---|")
    for yields, algorithm in ((False, "Linear"), (False, "Newton"), (True, "Newton")):
        run = partial(opensees, ops, yields=yields, algorithm=algorithm)
        fine = run(average, STEPS[-1] / 20.0)[0]
        largest = np.max(np.abs(fine))
        for h in STEPS:
            u, iterations = run(alpha, h)
            others = (
                fine[:: round(h / STEPS[-1] * 20.0)],
                *(scheme(h, yields=yields, of_mass=w) for w in (OF_MASS, 1.0)),
            )
            errors = [np.max(np.abs(u - other)) / largest for other in others]
            words = " | ".join(f"{error:.1e}" for error in errors)
            print(
                f"| {'Steel01' if yields else 'Elastic'} | {algorithm} | {h:g} | {iterations:.1f} "
                f"| {words} |"
            )


if __name__ == "__main__":
    main()
