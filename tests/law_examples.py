"""An example of each hysteretic law with the parameters that `LAWS` declares, so that a new law has
an example as well."""

import math

from tdint.model.story_laws import LAWS, Law


def example(name, stiffness, strength):
    """Return a law with an initial stiffness (N/m) and forces of about `strength` (N) at yield."""
    values = []
    drift = strength / stiffness
    if name == "trilinear-pinching":
        return Law(name, (strength, 2.0 * strength, 15.0 * drift, 0.5, 0.3))
    if name == "imk":
        side = (strength, 4.0 * drift, 8.0 * drift, 1.2, 0.2, 40.0 * drift, 1.0)
        return Law(name, (*side, *side, *4 * [50.0 * drift], 1.0, 0.4, 0.6))
    if name == "multilinear-pinching":
        points = [(1.0, 1.0), (4.0, 1.6), (9.0, 1.2), (20.0, 1.0)]
        side = [number for d, f in points for number in (d * drift, f * strength)]
        return Law(
            name,
            (
                *side,
                *side,
                *2 * (0.5, 0.25, 0.05),
                math.inf,
                *3 * (0.0, 0.0, 1.0, 1.0, 0.0),
                math.inf,
            ),
        )
    if name == "bilinear":
        return Law(name, (strength, 0.1, strength))
    if name == "bouc-wen":
        return Law(name, (strength, 0.1, 2.0, 0.55))
    if name == "multilinear":
        side = (drift, strength, 3.0 * drift, 1.4 * strength, *76 * (math.inf,))
        return Law(name, (0.0, 0.05 * stiffness, *side, *side))
    for parameter in LAWS[name].parameters:
        if parameter.many:
            values += [stiffness, -0.1 * stiffness / drift, 0.05 * stiffness / drift**2]
        elif parameter.force or parameter.length:
            # Parameters with the dimension force^a length^b are scaled by strength^a (strength /
            # stiffness)^b.
            values.append(strength**parameter.force * drift**parameter.length)
        else:
            width = parameter.high - parameter.low
            values.append(
                parameter.low + min(1.0, 0.1 * width) if math.isfinite(parameter.low) else 0.5
            )
    return Law(name, tuple(values))
