"""The law of Menegotto and Pinto (1973) with the isotropic curvature of Filippou, Popov and Bertero
(1983).

From each turn (d0, f0) to the asymptote of the side moved towards, which the line of slope k meets
at dm:

    f* = b x + (1 - b) x / (1 + |x|^R)^(1/R),   x = (d - d0) / (dm - d0),   f* = (f - f0) / (k (dm - d0))
    R = R0 - a1 e / (a2 + e),   e = |farthest drift of that side - dm| / (Fy / k)
"""  # noqa: E501

from tdint.plugin import DriftLaw, LawFunctions, LawParameter, at, yields_at_its_strength

STRENGTH, HARDENING, CURVATURE, FADING, HALF = range(at.FIRST_PARAMETER, at.FIRST_PARAMETER + 5)
SIDE, FROM_DRIFT, FROM_FORCE, REACH, POWER, HIGH, LOW, DONE, ROWS = range(
    9
)  # rows of the story's own


def _functions():
    import math

    from tdint.plugin import called, copy_extra_rows, extra_rows, inlined

    @inlined
    def on_curve(law_parameters, springs, i, own, drift):
        """Force and tangent at a drift on the present curve."""
        k = law_parameters[at.STIFFNESS, i]
        b = law_parameters[HARDENING, i]
        reach = springs[own + REACH, i]
        if reach == 0.0:  # nothing has moved yet
            return k * drift, k
        power = springs[own + POWER, i]
        x = (drift - springs[own + FROM_DRIFT, i]) / reach
        base = 1.0 + abs(x) ** power
        bent = base ** (-1.0 / power)
        force = springs[own + FROM_FORCE, i] + k * reach * x * (b + (1.0 - b) * bent)
        return force, k * (b + (1.0 - b) * bent / base)

    @called
    def force(law_parameters, springs, i, past, trial, drift):
        k = law_parameters[at.STIFFNESS, i]
        b = law_parameters[HARDENING, i]
        own = extra_rows(springs, trial)
        copy_extra_rows(springs, i, past, trial)
        before = springs[past + at.DRIFT, i]
        way = drift - before
        if way * springs[own + SIDE, i] < 0.0 or (springs[own + SIDE, i] == 0.0 and way != 0.0):
            # A turn: a new curve begins where the story stands.
            side = math.copysign(1.0, way)
            springs[own + SIDE, i] = side
            springs[own + FROM_DRIFT, i] = before
            springs[own + FROM_FORCE, i] = springs[past + at.FORCE, i]
            springs[own + HIGH, i] = max(springs[own + HIGH, i], before)
            springs[own + LOW, i] = min(springs[own + LOW, i], before)
            strength = side * (1.0 - b) * law_parameters[STRENGTH, i]
            meets = (strength - springs[past + at.FORCE, i] + k * before) / (k * (1.0 - b))
            springs[own + REACH, i] = meets - before
            farthest = springs[own + HIGH, i] if side > 0.0 else springs[own + LOW, i]
            excess = max(0.0, side * (farthest - meets)) * k / law_parameters[STRENGTH, i]
            faded = law_parameters[FADING, i] * excess / (law_parameters[HALF, i] + excess)
            springs[own + POWER, i] = law_parameters[CURVATURE, i] - faded
        f, tangent = on_curve(law_parameters, springs, i, own, drift)
        middle = on_curve(law_parameters, springs, i, own, before + 0.5 * way)[0]
        springs[own + DONE, i] += (
            way / 6.0 * (springs[past + at.FORCE, i] + 4.0 * middle + f)
        )  # Simpson
        springs[trial + at.FORCE, i] = f
        return tangent

    @inlined
    def recoverable(law_parameters, springs, i):
        return 0.5 * springs[at.FORCE, i] ** 2 / law_parameters[at.STIFFNESS, i]

    @inlined
    def dissipated(law_parameters, springs, i):
        return springs[extra_rows(springs, at.COMMITTED) + DONE, i] - recoverable(
            law_parameters, springs, i
        )

    @inlined
    def keep(law_parameters, springs, i, past, trial):
        copy_extra_rows(springs, i, trial, at.COMMITTED)
        springs[at.TURN, i] = springs[extra_rows(springs, trial) + SIDE, i]

    @inlined
    def switch(law_parameters, springs, i, block, event):
        """The drift rate has turned: `force` sees that by itself."""
        springs[block + at.TURN, i] = -springs[block + at.TURN, i]

    return LawFunctions(
        force=force, recoverable=recoverable, dissipated=dissipated, keep=keep, switch=switch
    )


LAWS = (
    DriftLaw(
        "menegotto-pinto",
        "f from turn to asymptote, curvature R = R0 - a1 e / (a2 + e): yield force Fy, hardening b",
        _functions,
        parameters=(
            LawParameter("yield_force", force=1, low=0.0, low_allowed=False),
            LawParameter("hardening", low=0.0, high=1.0, high_allowed=False),
            LawParameter("curvature", low=1.0, high=50.0, default=20.0),
            LawParameter("fading", low=0.0, high=50.0, default=18.5),
            LawParameter("half", low=0.0, low_allowed=False, default=0.15),
        ),
        curved=True,
        kinked=True,
        extra_rows=ROWS,
        yield_drift=yields_at_its_strength,
        fault=lambda stiffness, values: (
            None if values[2] - values[3] >= 1.0 else "curvature - fading must be at least 1"
        ),
    ),
)
