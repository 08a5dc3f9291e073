"""Numbers of a dashpot in the tables of the kernels."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tdint.kernels import layout as rows
from tdint.model.story import Story


def dashpot_rows(
    story: Story,
    coefficient: float,
    exponent: float,
    linear_below: float,
    brace: float,
    relief_force: float,
    relief_ratio: float,
) -> Iterator[tuple[int, float]]:
    """Yield rows of the linear terms with their numbers for a power-law dashpot of a story.

    The force of a dashpot without a brace at the drift rate v is c v (v^2 + v0^2)^POWER. For |v|
    much larger than v0 it is c |v|^exponent, so POWER = (exponent - 1) / 2. With the factor of an
    inclined dashpot, the coefficient of the story is factor^(1 + exponent) times c, v0 is divided
    by the factor, and the stiffness of the brace is multiplied by the square of the factor. The
    relief force is multiplied by the factor.
    """
    factor = story.damper_factor
    if factor != 1.0:
        coefficient *= factor ** (1.0 + exponent)
        linear_below /= factor
        brace *= factor**2
    if story.power_dashpot and story.power_dashpot.brace is not None:
        # A brace that the force at 1 m/s deforms by less than 1e-12 m is rigid. A stiffer one would
        # have only rounding errors.
        yield rows.BRACE, np.minimum(brace, 1e12 * coefficient)
        yield rows.BRACED_DAMPER, coefficient
        yield rows.BRACED_EXPONENT, exponent
        yield rows.BRACED_THRESHOLD, linear_below**2
        if story.power_dashpot.relief is not None:
            yield rows.BRACED_RELIEF, relief_force * factor
            yield rows.BRACED_RELIEF_RATIO, relief_ratio
    else:
        yield rows.POWER_DAMPER, coefficient
        yield rows.POWER, 0.5 * (exponent - 1.0)
        yield rows.THRESHOLD, linear_below**2
