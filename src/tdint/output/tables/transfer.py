"""Tables of transfer functions of a building."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tdint.model.story import column_name
from tdint.output.tables.columns import declared
from tdint.output.tables.table import Column, Table, placeholder
from tdint.units import suffix

if TYPE_CHECKING:
    from tdint.response.spectra.transfer import TransferFunction

_transfer: TransferFunction = placeholder()


def transfer_columns(labels: Sequence[int | str], source: str | int) -> tuple[Column, ...]:
    """Return the columns of transfer functions: frequency, and amplitude and phase of each floor
    and attachment, given by their numbers and names."""
    unit, meaning = "m/N", f"displacement divided by the force on floor {source}"
    if source == "ground":
        unit, meaning = "1", "absolute acceleration divided by the ground acceleration"
    return (
        Column.named("frequency", "frequency of the harmonic motion", "Hz"),
        *(
            column
            for i, label in enumerate(labels)
            for name in [column_name(label) if isinstance(label, str) else f"floor_{label}"]
            for column in (
                Column(
                    f"{name}_amplitude{suffix(unit)}",
                    unit,
                    _transfer.amplitude[:, i],
                    f"amplitude of the floor: {meaning}",
                ),
                Column(
                    f"{name}_phase_deg",
                    "degree",
                    _transfer.phase[:, i],
                    "phase of the floor, negative for a delay",
                ),
            )
        ),
    )


def transfer_table(result: TransferFunction) -> Table:
    """Return the table of transfer functions, with a row per frequency."""
    return Table.of_results(transfer_columns(result.labels, result.source), [result])


RESONANCE = declared("transfer.resonance")
RESONANCE_OF_FORCE = (
    *RESONANCE[:2],
    Column.named("amplitude", "maximum displacement over force", "m/N"),
)


def resonance_table(result: TransferFunction) -> Table:
    """Return the table of the maximum amplitudes, with a row per floor from the ground and per
    attachment."""
    columns = RESONANCE if result.source == "ground" else RESONANCE_OF_FORCE
    return Table.of_results(columns, result.maxima)
