"""Numbers of a dashpot in the tables of the kernels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from tdint.kernels import layout as rows
from tdint.model.story import PowerDashpot, Relief
from tdint.model.story_laws import of_samples


def dashpot_rows(damper: PowerDashpot, factor: float) -> Iterator[tuple[int, Any]]:
    """Yield rows of the linear terms with their numbers for a power-law dashpot (`_numbers`), which
    are arrays if numbers of the dashpot are arrays over samples."""
    *of_damper, relief = damper

    def of_sample(values: Sequence[Any]) -> list[tuple[int, float]]:
        """Return rows and numbers of one sample."""
        limited = Relief(*values[4:]) if relief else None
        return list(_numbers(PowerDashpot._make((*values[:4], limited)), factor))

    table = of_samples(of_sample, *of_damper, *(relief or ()))
    if isinstance(table, list):
        yield from table
        return
    for k, row in enumerate(table[0, :, 0].tolist()):
        yield int(row), table[:, k, 1]


def _numbers(damper: PowerDashpot, factor: float) -> Iterator[tuple[int, float]]:
    """Yield rows of the linear terms with their numbers for a power-law dashpot.

    The force of a dashpot without a brace at the drift rate v is c v (v^2 + v0^2)^POWER. For |v|
    much larger than v0 it is c |v|^exponent, so POWER = (exponent - 1) / 2. With the `factor` of an
    inclined dashpot, the coefficient of the story is factor^(1 + exponent) times c, v0 is divided
    by the factor, and the stiffness of the brace is multiplied by the square of the factor. The
    relief force is multiplied by the factor.
    """
    coefficient, threshold = damper.coefficient, damper.linear_below
    if factor != 1.0:
        coefficient *= factor ** (1.0 + damper.exponent)
        threshold /= factor
    if damper.brace is None:
        yield rows.POWER_DAMPER, coefficient
        yield rows.POWER, 0.5 * (damper.exponent - 1.0)
        yield rows.THRESHOLD, threshold**2
        return
    # A brace that the force at 1 m/s deforms by less than 1e-12 m is rigid. A stiffer one would
    # have only rounding errors.
    yield rows.BRACE, min(damper.brace * factor**2, 1e12 * coefficient)
    yield rows.BRACED_DAMPER, coefficient
    yield rows.BRACED_EXPONENT, damper.exponent
    yield rows.BRACED_THRESHOLD, threshold**2
    if damper.relief is not None:
        yield rows.BRACED_RELIEF, damper.relief.force * factor
        yield rows.BRACED_RELIEF_RATIO, damper.relief.ratio
