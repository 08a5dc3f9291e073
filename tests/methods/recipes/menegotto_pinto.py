"""Law of Menegotto and Pinto (1973) with the curvature of Filippou, Popov and Bertero (1983).

Each curve leads from a reversal (d0, f0) to the asymptote in the direction of loading. The line
with slope k through the reversal intersects the asymptote at dm:

    f* = b x + (1 - b) x / (1 + |x|^R)^(1/R),   x = (d - d0) / (dm - d0),   f* = (f - f0) / (k (dm - d0))
    R = R0 - a1 e / (a2 + e),   e = |maximum drift of this side - dm| / (Fy / k)
"""  # noqa: E501

from tdint.plugin import DriftLaw, LawFunctions, LawParameter, rows, yields_at_its_strength

STRENGTH, HARDENING, CURVATURE, FADING, HALF = range(rows.FIRST_PARAMETER, rows.FIRST_PARAMETER + 5)
SIDE, FROM_DRIFT, FROM_FORCE, REACH, POWER, HIGH, LOW, DONE, ROWS = range(
    9
)  # rows of the story's own


def _functions():
    import math

    from tdint.plugin import copy_extra_rows, extra_rows, inline, outlined

    @inline
    def on_curve(law_parameters, law_state, i, own, drift):
        """Return force and tangent at a drift on the present curve."""
        k = law_parameters[rows.STIFFNESS, i]
        b = law_parameters[HARDENING, i]
        reach = law_state[own + REACH, i]
        if reach == 0.0:  # the story has not moved yet
            return k * drift, k
        power = law_state[own + POWER, i]
        x = (drift - law_state[own + FROM_DRIFT, i]) / reach
        base = 1.0 + abs(x) ** power
        bent = base ** (-1.0 / power)
        force = law_state[own + FROM_FORCE, i] + k * reach * x * (b + (1.0 - b) * bent)
        return force, k * (b + (1.0 - b) * bent / base)

    @outlined
    def force(law_parameters, law_state, i, previous, trial, drift):
        k = law_parameters[rows.STIFFNESS, i]
        b = law_parameters[HARDENING, i]
        own = extra_rows(law_state, trial)
        copy_extra_rows(law_state, i, previous, trial)
        before = law_state[previous + rows.DRIFT, i]
        increment = drift - before
        if increment * law_state[own + SIDE, i] < 0.0 or (
            law_state[own + SIDE, i] == 0.0 and increment != 0.0
        ):
            # At a reversal, a new curve starts at the current point.
            side = math.copysign(1.0, increment)
            law_state[own + SIDE, i] = side
            law_state[own + FROM_DRIFT, i] = before
            law_state[own + FROM_FORCE, i] = law_state[previous + rows.FORCE, i]
            law_state[own + HIGH, i] = max(law_state[own + HIGH, i], before)
            law_state[own + LOW, i] = min(law_state[own + LOW, i], before)
            strength = side * (1.0 - b) * law_parameters[STRENGTH, i]
            meets = (strength - law_state[previous + rows.FORCE, i] + k * before) / (k * (1.0 - b))
            law_state[own + REACH, i] = meets - before
            farthest = law_state[own + HIGH, i] if side > 0.0 else law_state[own + LOW, i]
            excess = max(0.0, side * (farthest - meets)) * k / law_parameters[STRENGTH, i]
            faded = law_parameters[FADING, i] * excess / (law_parameters[HALF, i] + excess)
            law_state[own + POWER, i] = law_parameters[CURVATURE, i] - faded
        f, tangent = on_curve(law_parameters, law_state, i, own, drift)
        middle = on_curve(law_parameters, law_state, i, own, before + 0.5 * increment)[0]
        law_state[own + DONE, i] += (
            increment / 6.0 * (law_state[previous + rows.FORCE, i] + 4.0 * middle + f)
        )  # Simpson
        law_state[trial + rows.FORCE, i] = f
        return tangent

    @inline
    def strain_energy(law_parameters, law_state, i):
        return 0.5 * law_state[rows.FORCE, i] ** 2 / law_parameters[rows.STIFFNESS, i]

    @inline
    def hysteretic_energy(law_parameters, law_state, i):
        return law_state[extra_rows(law_state, rows.COMMITTED) + DONE, i] - strain_energy(
            law_parameters, law_state, i
        )

    @inline
    def keep(law_parameters, law_state, i, previous, trial):
        copy_extra_rows(law_state, i, trial, rows.COMMITTED)
        law_state[rows.RATE_SIGN, i] = law_state[extra_rows(law_state, trial) + SIDE, i]

    @inline
    def switch(law_parameters, law_state, i, block, event):
        """Store the new sign of the drift rate; `force` detects reversals itself."""
        law_state[block + rows.RATE_SIGN, i] = -law_state[block + rows.RATE_SIGN, i]

    return LawFunctions(
        force=force,
        strain_energy=strain_energy,
        hysteretic_energy=hysteretic_energy,
        keep=keep,
        switch=switch,
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
