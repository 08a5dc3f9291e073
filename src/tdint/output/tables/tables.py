"""Tables as CSV: UTF-8, LF ends, a header, 12 significant digits, true/false, an empty cell for no value."""

from __future__ import annotations

import csv
import io
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from tdint.analysis.run.outcome import History, StoryErrors, StoryPeaks
    from tdint.analysis.spectra.elastic import Spectrum
    from tdint.analysis.spectra.rotated import RotatedSpectrum
    from tdint.ground_motion.record import Record
    from tdint.methods.method import Integrator
    from tdint.model.modes import Modes

Array = NDArray[np.float64]

Cell = bool | int | float | str | None

STORY_COLUMNS = (
    "story",
    "height_m",
    "peak_drift_m",
    "peak_drift_ratio",
    "residual_drift_m",
    "peak_shear_N",
    "ductility",
    "peak_displacement_m",
    "peak_velocity_m_s",
    "peak_acceleration_m_s2",
)
STORY_ERROR_COLUMNS = tuple(f"{name}_error" for name in STORY_COLUMNS[2:])
SPECTRUM_COLUMNS = (
    "record",
    "component",
    "damping",
    "period_s",
    "sd_m",
    "psv_m_s",
    "psa_m_s2",
    "sv_m_s",
    "sa_m_s2",
)
ROTATED_COLUMNS = ("geometric_mean_psa_m_s2", "rotd100_angle_deg")
METHOD_COLUMNS = ("name", "family", "parameters", "order", "implicit", "stability_limit", "rho_inf", "source")
MODE_COLUMNS = (
    "mode",
    "period_s",
    "frequency_hz",
    "damping",
    "participation",
    "mass_ratio",
    "cumulative_mass_ratio",
)

_ROWS_AT_ONCE = 4096


@dataclass(frozen=True)
class Table:
    """Column names and rows of as many cells."""

    columns: tuple[str, ...]
    rows: list[tuple[Cell, ...]]

    def csv(self, *, header: bool = True) -> bytes:
        """The table as CSV, without its first line if `header` is False."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        if header:
            writer.writerow(self.columns)
        writer.writerows(map(cell_text, row) for row in self.rows)
        # A file name that is not UTF-8 reaches Python with surrogates; it leaves with the bytes it had.
        return text.getvalue().encode("utf-8", "surrogateescape")


def cell_text(value: Cell) -> str:
    """One cell as text: 12 significant digits, true/false, nothing for None and nan."""
    match value:
        case None:
            return ""
        case bool() | np.bool_():
            return "true" if value else "false"
        case float() | np.floating():
            return "" if math.isnan(value) else format(value + 0.0, ".12g")  # + 0.0: zero has no sign
        case _:
            return str(value)


def story_table(stories: StoryPeaks, errors: StoryErrors | None = None) -> Table:
    """One row per story, from the ground up; with errors a column `<name>_error` for each peak, after all peaks."""
    columns = (stories.height, *_peaks(stories))
    if errors is None:
        return Table(STORY_COLUMNS, _numbered(columns))
    return Table((*STORY_COLUMNS, *STORY_ERROR_COLUMNS), _numbered((*columns, *_peaks(errors))))


def _peaks(of: StoryPeaks | StoryErrors) -> tuple[Array, ...]:
    """The peaks, or their errors, in the order of the columns."""
    return (
        of.peak_drift,
        of.peak_drift_ratio,
        of.residual_drift,
        of.peak_shear,
        of.ductility,
        of.peak_displacement,
        of.peak_velocity,
        of.peak_acceleration,
    )


def spectrum_table(spectra: Sequence[Spectrum], stated: Sequence[str] = ()) -> Table:
    """One row per record, component, damping ratio and period, in the order given.

    `stated`: which of the choices `maxima` and `interpolation` have columns of their own, at the end.
    """
    names = component_names([spectrum.record for spectrum in spectra])
    rows: list[tuple[Cell, ...]] = []
    for spectrum, name in zip(spectra, names, strict=True):
        record = spectrum.record
        columns = (spectrum.periods, spectrum.sd, spectrum.psv, spectrum.psa, spectrum.sv, spectrum.sa)
        choices = {"maxima": spectrum.maxima, "interpolation": spectrum.interpolation}
        ends = [choices[name] for name in stated]
        rows.extend(
            (record.source, name, spectrum.damping, *values, *ends)
            for values in zip(*(column.tolist() for column in columns), strict=True)
        )
    return Table((*SPECTRUM_COLUMNS, *stated), rows)


def rotated_table(spectra: Sequence[RotatedSpectrum], stated: Sequence[str] = ()) -> Table:
    """One row per motion, damping ratio and period, a column per percentile; `stated` as for `spectrum_table`."""
    rows: list[tuple[Cell, ...]] = []
    for spectrum in spectra:
        choices = {"maxima": spectrum.maxima, "interpolation": spectrum.interpolation}
        ends = [choices[name] for name in stated]
        columns = (spectrum.periods, *spectrum.psa, spectrum.geometric_mean, spectrum.angle)
        rows.extend(
            (spectrum.motion.source, spectrum.motion.component, spectrum.damping, *values, *ends)
            for values in zip(*(column.tolist() for column in columns), strict=True)
        )
    percentiles = (f"rotd{percentile:02d}_psa_m_s2" for percentile in spectra[0].percentiles)
    return Table((*SPECTRUM_COLUMNS[:4], *percentiles, *ROTATED_COLUMNS, *stated), rows)


def component_names(records: Sequence[Record]) -> list[str]:
    """The component of each record; its full id where others of the same file have the same component."""
    components = {(record.source, record.id, record.component) for record in records}
    count = Counter((source, component) for source, _, component in components)
    return [record.component if count[record.source, record.component] == 1 else record.id for record in records]


def method_table(integrators: Iterable[Integrator]) -> Table:
    """One row per method with its parameters' defaults and ranges; the other values are those at the defaults."""
    rows: list[tuple[Cell, ...]] = [
        (
            integrator.method.name,
            integrator.family.name,
            _parameters(integrator),
            integrator.order,
            integrator.implicit,
            integrator.stability_limit,
            integrator.rho_inf,
            integrator.method.source,
        )
        for integrator in integrators
    ]
    return Table(METHOD_COLUMNS, rows)


def _parameters(integrator: Integrator) -> str:
    """`beta=0.25 in [0, 1]; theta=1.02 in [1, 10], computed`: a computed default follows from the ones before it."""
    return "; ".join(
        f"{parameter.name}={cell_text(value)} in {parameter.range}" + (", computed" * callable(parameter.default))
        for parameter, value in zip(integrator.method.parameters, integrator.values, strict=True)
    )


def mode_table(modes: Modes, damping: Array | None) -> Table:
    """One row per mode, longest period first; empty cells for damping ratios (shape (n,)) that are None."""
    columns = (
        2.0 * math.pi / modes.omega,
        modes.omega / (2.0 * math.pi),
        np.full_like(modes.omega, math.nan) if damping is None else damping,
        modes.participation,
        modes.mass_ratio,
        np.cumsum(modes.mass_ratio),
    )
    return Table(MODE_COLUMNS, _numbered(columns))


def _numbered(columns: Sequence[Array]) -> list[tuple[Cell, ...]]:
    """Rows of a table whose first column counts from 1."""
    values = zip(*(column.tolist() for column in columns), strict=True)
    return [(i, *row) for i, row in enumerate(values, start=1)]


def history_columns(stories: int) -> tuple[str, ...]:
    """Columns of a history."""
    of_floor = ("displacement_m", "velocity_m_s", "acceleration_m_s2")
    of_story = ("drift_m", "shear_N")
    return (
        "time_s",
        "ground_acceleration_m_s2",
        *(f"floor_{i}_{name}" for i in range(1, stories + 1) for name in of_floor),
        *(f"story_{i}_{name}" for i in range(1, stories + 1) for name in of_story),
        *(f"energy_{name}" for name in ("input_J", "kinetic_J", "damping_J", "recoverable_J", "dissipated_J", "error")),
    )


def write_history(history: History, stream: BinaryIO) -> None:
    """Write a history as CSV, one row per step; some thousand rows are held as text at a time."""
    steps, stories = history.displacement.shape
    columns = history_columns(stories)
    stream.write((",".join(columns) + "\n").encode())
    line = ",".join(["%.12g"] * len(columns)) + "\n"
    energy = history.energy
    energies = (
        energy.input, energy.kinetic, energy.damping, energy.recoverable, energy.dissipated, energy.error,
    )  # fmt: skip
    for start in range(0, steps, _ROWS_AT_ONCE):
        part = slice(start, start + _ROWS_AT_ONCE)
        floors = np.stack([history.displacement[part], history.velocity[part], history.acceleration[part]], axis=2)
        springs = np.stack([history.drift[part], history.shear[part]], axis=2)
        table = np.column_stack(
            [
                history.time[part],
                history.ground_acceleration[part],
                floors.reshape(len(floors), -1),
                springs.reshape(len(springs), -1),
                *(values[part] for values in energies),
            ]
        )
        text = "".join([line % tuple(row) for row in (table + 0.0).tolist()])
        stream.write(text.replace("nan", "").encode())
