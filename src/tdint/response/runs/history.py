"""Response histories: their values at each time step, and their estimated errors."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields, replace
from functools import reduce
from operator import sub
from typing import TYPE_CHECKING, Annotated

import numpy as np

from tdint.arrays import Array, each_array, immutable, join_arrays
from tdint.kernels import layout as rows
from tdint.methods.workspace import Workspace
from tdint.model.building import Building
from tdint.model.force_arrays import add_force_history
from tdint.model.story import column_name
from tdint.number_parsing import pluralize
from tdint.response.runs.energy import ENERGY_TERMS, EnergyTerms
from tdint.tabular import Described, WithTable
from tdint.units import Quantity

if TYPE_CHECKING:
    from xarray import Dataset

Loads = tuple[Array, Array]
"""Forces on floors and points of their tables (`load_arrays`)."""

FieldFunction = Callable[[Building, Loads, Array, Array], Array]
"""Function that computes one quantity of the response history for all floors or stories.

Its arguments are the building, the forces on its floors, the times of the rows of the history table
(s), and the history table. It returns an array, shape (rows, n).
"""


@immutable
class ErrorHistory(Described):
    """Estimated error at all time steps, true minus computed value, shape (steps + 1, n).

    The true value is estimated by the additional run for the error estimate.
    """

    displacement: Annotated[
        Array, Quantity("m", "estimated error, true less computed", shown=("floor",))
    ]
    velocity: Annotated[
        Array, Quantity("m/s", "estimated error, true less computed", shown=("floor",))
    ]
    drift: Annotated[Array, Quantity("m", "estimated error, true less computed", shown=("story",))]
    shear: Annotated[Array, Quantity("N", "estimated error, true less computed", shown=("story",))]


@immutable
class DeviceHistory(Described):
    """Response histories of attachments and then links, shape (steps + 1, devices), SI units.

    The drift is the deformation. Of links, only `drift`, `shear` and `damper_force` have a meaning.
    `attachments` and `links` are the names in columns.
    """

    attachments: tuple[str, ...]
    links: tuple[str, ...]
    displacement: Array
    velocity: Array
    absolute_acceleration: Array
    drift: Array
    shear: Array
    damper_force: Array


@immutable
class EnergyHistory(EnergyTerms[Array]):
    """Energy terms at all time steps, J, and the imbalance divided by the maximum input energy.

    The arrays have the shape (steps + 1,).
    """

    error: Array


@immutable
class History(WithTable):
    """Response history at all time steps.

    `time` and `ground_acceleration` have the shape (steps + 1,), the other fields (steps + 1, n).
    `error` contains the estimated errors of all quantities except accelerations if they were
    requested, otherwise None.

    Attributes
    ----------
    time : ndarray, shape (steps + 1,)
        Time from the first sample, s.
    ground_acceleration : ndarray, shape (steps + 1,)
        Acceleration of the ground, m/s^2.
    displacement, velocity : ndarray, shape (steps + 1, n)
        Motion of the floors relative to the ground, m and m/s.
    absolute_acceleration : ndarray, shape (steps + 1, n)
        Absolute accelerations of the floors from equilibrium, m/s^2.
    drift : ndarray, shape (steps + 1, n)
        Displacements relative to the floor below, m.
    shear : ndarray, shape (steps + 1, n)
        Restoring forces of the stories without viscous forces, N.
    damper_force : ndarray, shape (steps + 1, n)
        Forces of the dashpots of the stories, N.
    total_shear : ndarray, shape (steps + 1, n)
        Restoring, P-delta and all viscous forces that act on the floors above, N.
    energy : EnergyHistory
        Energy terms, J.
    error : ErrorHistory | None
        Estimated errors of all quantities except accelerations, if they were requested.
    element_force : ndarray, shape (steps + 1, elements), or None
        Forces of the elements of stories with several elements, N; None without such stories.
    element_labels : tuple of str
        Story and name of each element, such as `story_1_moat_wall`.
    devices : DeviceHistory or None
        Histories of attachments and links; None without attachments and links.
    rows : tuple of str
        Names of rows that are not floors, in columns; empty for a building.
    """

    time: Annotated[Array, Quantity("s", "time from the first sample", shown=("ground",))]
    ground_acceleration: Annotated[
        Array, Quantity("m/s^2", "acceleration of the ground", shown=("ground",))
    ]
    displacement: Annotated[Array, Quantity("m", "relative to the ground", shown=("floor",))]
    velocity: Annotated[Array, Quantity("m/s", "relative to the ground", shown=("floor",))]
    absolute_acceleration: Annotated[
        Array, Quantity("m/s^2", "absolute, from equilibrium", shown=("floor",))
    ]
    drift: Annotated[Array, Quantity("m", "relative to the floor below", shown=("story",))]
    shear: Annotated[
        Array, Quantity("N", "restoring force, without viscous forces", shown=("story",))
    ]
    damper_force: Annotated[Array, Quantity("N", "force of the story's dashpots", shown=("story",))]
    total_shear: Annotated[
        Array,
        Quantity(
            "N",
            "moves all floors above: restoring, P-delta and all viscous forces",
            shown=("story",),
        ),
    ]
    energy: EnergyHistory
    error: ErrorHistory | None = None
    element_force: Array | None = None
    element_labels: tuple[str, ...] = ()
    devices: DeviceHistory | None = None
    rows: tuple[str, ...] = ()

    def _headline(self) -> str:
        stories = pluralize(self.displacement.shape[1], "story")
        steps = pluralize(len(self.time) - 1, "step")
        return f"of {stories}, {steps} to {self.time[-1]:.6g} s"

    @staticmethod
    def joined(chunks: "Iterable[History]") -> "History":
        """Return the chunks of a history as a single history.

        Parameters
        ----------
        chunks : iterable of History
            Chunks in the order of time.
        """
        parts = list(chunks)
        return parts[0] if len(parts) == 1 else each_array(join_arrays, *parts)

    def to_xarray(self) -> "Dataset":
        """Return the quantities with units, as `Runs.to_xarray`.

        Returns
        -------
        xarray.Dataset
            Dimensions time and story, energies with the prefix energy; forces of elements with
            the dimension element; quantities of attachments and links with the prefix device and
            the dimension device.

        Raises
        ------
        UsageError
            xarray is not installed.
        """
        dataset: Dataset = type(self).tables().history_to_xarray(self)
        return dataset

    def every(self, steps: int) -> "History":
        """Return every N-th step, from the first, as views of the arrays.

        Parameters
        ----------
        steps : int
            Interval of the rows in time steps, N.
        """
        thinned: History = each_array(lambda array: array[::steps], self)
        return thinned


def named_history(
    building: Building,
    loads: Loads,
    space: Workspace,
    h: float,
    max_input_energy: float | None = None,
) -> History:
    """Return the response history that a time integration stored in its workspace: the complete
    run, or a chunk of the run.

    Parameters
    ----------
    max_input_energy : float, optional
        Reference energy of the complete run, J, for the imbalance at each time. The default is the
        reference energy that the workspace contains. If the workspace contains a chunk, this is the
        maximum up to the end of the chunk, so the argument must be specified.
    """
    n = building.stories
    table = space.history
    # The table of a chunk of the run continues after `rows_before` rows of earlier chunks.
    time = h * (
        space.steps_per_row
        * np.arange(space.rows_before, space.rows_before + len(table), dtype=np.float64)
    )
    # The first energy is the input energy; the imbalance is the part of the input and the initial
    # energy that no other term contains.
    first_energy = 1 + (rows.HISTORY_FIELDS + building.braced) * n
    terms = list(table[:, first_energy : first_energy + rows.ENERGY_TERMS].T)
    initial = space.totals[rows.ENERGY_INITIAL]
    if max_input_energy is None:
        max_input_energy = space.totals[rows.ENERGY_REFERENCE]
    imbalance = reduce(sub, terms[1:], initial + terms[0])
    # The reference energy is 0 only for a building that remains at rest.
    has_energy = max_input_energy > 0.0
    relative = imbalance / max_input_energy if has_energy else np.zeros_like(imbalance)
    has_elements = building.elements > 0
    part = slice(building.floors)
    series = {name: compute(building, loads, time, table) for name, compute in HISTORIES.items()}
    return History(
        time=time,
        ground_acceleration=table[:, 0],
        energy=EnergyHistory(**dict(zip(ENERGY_TERMS, terms, strict=True)), error=relative),
        element_force=_element_force(building, loads, time, table) if has_elements else None,
        element_labels=building.element_labels,
        devices=_device_history(building, loads, time, table) if building.branched else None,
        rows=building.system.names if building.system is not None else (),
        **{name: values[:, part] for name, values in series.items()},  # type: ignore[arg-type]
    )


def _device_history(building: Building, loads: Loads, time: Array, table: Array) -> DeviceHistory:
    """Return the histories of attachments and links; arguments as for `FieldFunction`."""
    return DeviceHistory(
        attachments=tuple(column_name(item.name) for item in building.attachments),
        links=tuple(column_name(item.name) for item in building.links),
        **{
            name.removeprefix(DEVICE): compute(building, loads, time, table)
            for name, compute in _HISTORIES_OF_DEVICES.items()
        },
    )


def values_of(history: History, name: str) -> Array:
    """Return a quantity of `HISTORIES_OF_MANY`, without columns if the building has none."""
    owner = history.devices if name.startswith(DEVICE) else history
    values = getattr(owner, name.removeprefix(DEVICE), None)
    return np.zeros((history.time.size, 0)) if values is None else values


def chunks_with_error(
    chunks: Callable[[int], Iterator[History]],
    other_chunks: Callable[[int], Iterator[History]],
    ratio: int,
    every: int = 1,
) -> Iterator[History]:
    """Yield the chunks of a history with the estimated errors at each row; `ratio` is the number of
    time steps of the additional run in one time step of the run.
    """
    return map(with_error, chunks(every), other_chunks(ratio * every))


def with_error(history: History, other: History) -> History:
    """Return a history with its estimated errors: the values of `other`, the history of the
    additional run at the same times, minus the values of `history`.
    """
    # The additional run includes the motion after the record, which a file omits.
    count = history.time.size
    errors = {
        field.name: getattr(other, field.name)[:count] - getattr(history, field.name)
        for field in fields(ErrorHistory)
    }
    return replace(history, error=ErrorHistory(**errors))


# Positions of the fields in a row of the history table, in units of n columns, after the first
# column with the ground acceleration.
_DISPLACEMENT_FIELD, _VELOCITY_FIELD, _ACCELERATION_FIELD, _SHEAR_FIELD, _BRACE_FIELD = range(5)


def _stored_field(field: int) -> FieldFunction:
    """Return a `FieldFunction` that reads one field from the history table."""
    return lambda building, loads, time, table: table[
        :, 1 + field * building.stories : 1 + (field + 1) * building.stories
    ]


def _floor_difference(field: int) -> FieldFunction:
    """Return a `FieldFunction` that computes the difference of a field between the floors above and
    below each story, such as the drift from the displacements."""
    of_floors = _stored_field(field)
    return lambda building, loads, time, table: building.drifts(
        of_floors(building, loads, time, table)
    )


def _total_shear(building: Building, loads: Loads, time: Array, table: Array) -> Array:
    """Return the shear in each story that balances the forces on all floors above the story, N.

    This shear contains the forces of springs, dampers and P-delta. It is the sum of applied force
    minus mass times absolute acceleration over these floors.
    """
    acceleration = _absolute_acceleration(building, loads, time, table)
    system = building.system
    if system is not None:
        floor_forces = -acceleration[:, : building.masses] @ system.loaded_mass
    else:
        floor_forces = -building.linear_terms[rows.MASS, :-1] * acceleration
    add_force_history(*loads, time, floor_forces)
    if system is not None:
        return np.asarray(floor_forces @ system.cuts.T)
    # Sum from the roof down, attachments first.
    if building.branched:
        for i, item in enumerate(building.attachments, start=building.floors):
            if item.floor:  # not on the ground
                floor_forces[:, item.floor - 1] += floor_forces[:, i]
        floor_forces = floor_forces[:, : building.floors]
    return np.asarray(np.cumsum(floor_forces[:, ::-1], axis=1)[:, ::-1])


_absolute_acceleration = _stored_field(_ACCELERATION_FIELD)
_DRIFT_RATE = _floor_difference(_VELOCITY_FIELD)


def _damper_force(building: Building, loads: Loads, time: Array, table: Array) -> Array:
    """Return the forces along the dampers, N; arguments as for `FieldFunction`."""
    force = building.device_force(_DRIFT_RATE(building, loads, time, table))
    if building.braced:
        force = force + _stored_field(_BRACE_FIELD)(building, loads, time, table)
    return building.damper_force(force)


def _element_force(building: Building, loads: Loads, time: Array, table: Array) -> Array:
    """Return the forces of the elements, N, shape (rows, elements), the last columns of a row."""
    return table[:, table.shape[1] - building.elements :]


HISTORIES: dict[str, FieldFunction] = {
    "displacement": _stored_field(_DISPLACEMENT_FIELD),
    "velocity": _stored_field(_VELOCITY_FIELD),
    "absolute_acceleration": _absolute_acceleration,
    "drift": _floor_difference(_DISPLACEMENT_FIELD),
    "shear": _stored_field(_SHEAR_FIELD),
    "damper_force": _damper_force,
    "total_shear": _total_shear,
}
"""Functions that compute the fields of `History` for stories and floors, shape (rows, n)."""

ELEMENT_FORCE = "element_force"
"""Field of `History` with a column for each element instead of each story."""

DEVICE = "device_"
"""Prefix of the fields of `DeviceHistory` in the histories of many runs."""


def _of_devices(name: str) -> FieldFunction:
    """Return a `FieldFunction` of a quantity of attachments and then links. Deformations and forces
    of links have the sign for their direction in the model."""

    def compute(building: Building, loads: Loads, time: Array, table: Array) -> Array:
        """Return the values, shape (rows, devices)."""
        values = HISTORIES[name](building, loads, time, table)[:, building.device_columns]
        is_signed = name in ("drift", "shear", "damper_force")
        return values * building.device_signs if is_signed else values

    return compute


_HISTORIES_OF_DEVICES = {
    f"{DEVICE}{name}": _of_devices(name) for name in HISTORIES if name != "total_shear"
}

HISTORIES_OF_MANY = HISTORIES | {ELEMENT_FORCE: _element_force} | _HISTORIES_OF_DEVICES
"""Functions that compute the histories of many runs."""
