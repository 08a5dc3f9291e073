"""Numbers of a dashpot in the tables of the kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tdint.kernels import layout as rows


def dashpot_rows(factor: float, numbers: Sequence[Any]) -> list[tuple[int, float]]:
    """Return rows of the linear terms with their values for a power-law dashpot with the numbers of
    a `PowerDashpot`, the last two from its `Relief`.

    The force of a dashpot without a brace at the drift rate v is c v (v^2 + v0^2)^POWER. For |v|
    much larger than v0 it is c |v|^exponent, so POWER = (exponent - 1) / 2. With the `factor` of an
    inclined dashpot, the coefficient of the story is factor^(1 + exponent) times c, v0 is divided
    by the factor, and the stiffness of the brace is multiplied by the square of the factor. The
    relief force is multiplied by the factor.
    """
    coefficient, exponent, threshold, brace, relief_force, relief_ratio = numbers
    if factor != 1.0:
        coefficient *= factor ** (1.0 + exponent)
        threshold /= factor
    if brace is None:
        return [
            (rows.POWER_DAMPER, coefficient),
            (rows.POWER, 0.5 * (exponent - 1.0)),
            (rows.THRESHOLD, threshold**2),
        ]
    # A brace that the force at 1 m/s deforms by less than 1e-12 m is rigid. A stiffer one would
    # have only rounding errors.
    result = [
        (rows.BRACE, min(brace * factor**2, 1e12 * coefficient)),
        (rows.BRACED_DAMPER, coefficient),
        (rows.BRACED_EXPONENT, exponent),
        (rows.BRACED_THRESHOLD, threshold**2),
    ]
    if relief_force is not None:
        result.append((rows.BRACED_RELIEF, relief_force * factor))
        result.append((rows.BRACED_RELIEF_RATIO, relief_ratio))
    return result
