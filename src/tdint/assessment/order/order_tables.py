"""Table of observed orders of convergence."""

from __future__ import annotations

from tdint.output.tables.table import METHOD_SPEC, TEXT, Column


def _order(quantity: str) -> Column:
    """Return the column of the observed order of accuracy of a quantity, such as `velocity`."""
    return Column(
        f"{quantity}_order",
        "1",
        lambda order: order.order(quantity),
        f"observed order of accuracy of the {quantity}",
    )


ORDER = (
    METHOD_SPEC,
    Column.named("load", "load of the oscillator", TEXT),
    Column.named("law", "hysteretic law of the oscillator", TEXT),
    Column.named(
        "frequency_ratio", "frequency of the load divided by the frequency of the oscillator"
    ),
    *map(_order, ("displacement", "velocity", "acceleration", "algorithmic_acceleration")),
    Column(
        "displacement_error",
        "1",
        lambda result: float(result.displacement[-1]),
        "maximum error with the smallest time step, divided by the maximum displacement",
    ),
)
