"""Transfer functions of a linear building: harmonic steady-state response over the frequency.

With the ground acceleration or the force on a floor proportional to exp(i w t), the absolute
displacements z of the floors satisfy D z = f with the complex dynamic stiffness

    D = K + i w C + K_b - w^2 M,    K_b = k i w c / (k + i w c) in each story

for the initial stiffness K with P-delta, the damping matrix C, and dampers (coefficient c) in
series with a brace (stiffness k). The dampers are therefore included exactly, without modes and
without equivalent damping ratios. For a ground displacement g, f = (K + i w C + K_b) 1 g.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tdint.arrays import Array
from tdint.errors import ModelError, UsageError
from tdint.kernels import layout as rows
from tdint.model.building import Building, assemble
from tdint.model.definition import Model
from tdint.model.keys.fields import ROOF
from tdint.response.arguments import AnyModel, model_of
from tdint.tabular import Tabular

GROUND = "ground"
"""Source of the motion: the ground acceleration."""

# The frequencies start with a geometric sequence from a fraction of the lowest to a multiple of the
# highest natural frequency. An interval is halved while the response of a floor at its center
# differs from the linear interpolation by more than a fraction of its amplitude. Amplitudes below a
# fraction of the maximum of the floor are negligible.
_FIRST, _LAST, _COUNT = 0.05, 2.0, 200
_MAX_DIFFERENCE, _NEGLIGIBLE = 0.01, 0.01
_MIN_HALVINGS, _MAX_HALVINGS = 6, 12


class Resonance(NamedTuple):
    """Maximum amplitude of a floor: number of the floor or name of the attachment, frequency (Hz),
    and amplitude."""

    floor: int | str
    frequency: float
    amplitude: float


@dataclass(frozen=True, eq=False, repr=False)
class TransferFunction(Tabular):
    """Complex response of each floor to a harmonic ground acceleration or floor force.

    Attributes
    ----------
    model : Model
        The building, linear with the initial stiffness of its stories.
    source : str or int
        `ground`, or the number of the floor with the force.
    frequency : ndarray, shape (k,)
        Frequencies, Hz.
    response : ndarray of complex, shape (k, n)
        Absolute acceleration of each floor and then of each attachment divided by the ground
        acceleration, or displacement divided by the force, m/N. The time factor is
        exp(2 pi i f t), so that a negative phase is a delay.
    is_damped : bool
        False if a mode is undamped, so that the amplitude at its frequency is unbounded.
    """

    model: Model
    source: str | int
    frequency: Array
    response: Array
    is_damped: bool

    def _headline(self) -> str:
        roof = self.roof
        unit = "" if self.source == GROUND else " m/N"
        source = GROUND if self.source == GROUND else f"a force on floor {self.source}"
        return (
            f"of {self.model.name!r} for {source}: roof at most {roof.amplitude:.4g}{unit}, at "
            f"{roof.frequency:.4g} Hz"
        )

    @property
    def amplitude(self) -> Array:
        """Absolute values of the response, shape (k, n)."""
        return np.abs(self.response)

    @property
    def phase(self) -> Array:
        """Phases of the response from -180 to 180 degrees, shape (k, n)."""
        return np.degrees(np.angle(self.response))

    @property
    def maxima(self) -> list[Resonance]:
        """Maximum amplitude of each floor, from the ground, and of each attachment."""
        amplitude = self.amplitude
        return [
            Resonance(label, float(self.frequency[i]), float(amplitude[i, column]))
            for column, (label, i) in enumerate(
                zip(self.labels, np.argmax(amplitude, axis=0).tolist(), strict=True)
            )
        ]

    @property
    def labels(self) -> tuple[int | str, ...]:
        """Numbers of the floors from the ground, then names of the attachments."""
        floors = range(1, len(self.model.stories) + 1)
        return (*floors, *(item.name for item in self.model.attachments))

    @property
    def roof(self) -> Resonance:
        """Maximum amplitude of the roof."""
        return self.maxima[len(self.model.stories) - 1]


def transfer_function(
    model: AnyModel, frequency: Array | None = None, *, source: str | int = GROUND
) -> TransferFunction:
    """Compute the transfer functions of a building with its initial stiffness.

    Parameters
    ----------
    model : Model, str, Path or mapping
        Model, model file or its content, as for `tdint.run`.
    frequency : ndarray, shape (k,), optional
        Frequencies, Hz. By default, from 1/20 of the lowest to twice the highest natural frequency,
        denser at resonances.
    source : str or int
        `ground` for floor accelerations divided by the ground acceleration, or the number of a
        floor, from 1, or `roof`, for displacements divided by a force on this floor.

    Returns
    -------
    TransferFunction
        Complex response of all floors.

    Raises
    ------
    ModelError
        The model is invalid, P-delta effects exceed the stiffness of a story, or a story has no
        initial stiffness or a damper with a force that is not proportional to the velocity.
    UsageError
        The floor does not exist, or a frequency is not positive.
    """
    model = model_of(model)
    model.require_floors("the transfer function")
    building = assemble(model)
    source = building.floors if source == ROOF else source
    is_floor = isinstance(source, int) and 1 <= source <= building.floors
    if source != GROUND and not is_floor:
        raise UsageError(
            f"source: the force must be on a floor from 1 to {building.floors} or the {ROOF}, or "
            f"the source must be {GROUND}, got {source!r:.40}"
        )
    check_dampers(model, building, "transfer function")
    if not building.modes().omega[0]:
        raise ModelError(
            f"{model.name}: the transfer function needs the periods, and a story has no initial "
            "stiffness; use time histories"
        )
    stiffness = _DynamicStiffness(building, source)
    if frequency is None:
        frequency, response = _resolved(stiffness)
    else:
        frequency = np.asarray(frequency, dtype=float)
        if not (frequency.size and np.all(np.isfinite(frequency)) and np.all(frequency > 0.0)):
            raise UsageError("frequency: the frequencies must be positive numbers, Hz")
        response = stiffness.response(frequency)
    ratios = building.modes().own_damping(building.damping_matrix())
    is_damped = building.braced or building.power_damped or bool(np.all(ratios > 0.0))
    return TransferFunction(model, source, frequency, response, is_damped)


def check_dampers(model: Model, building: Building, subject: str) -> None:
    """Raise ModelError if the force of a damper is not proportional to the velocity, so that the
    building has no `subject`."""
    terms = building.linear_terms[:, :-1]
    is_power = (terms[rows.POWER_DAMPER] != 0.0) & (terms[rows.POWER] != 0.0)
    is_power |= (terms[rows.BRACE] != 0.0) & (
        (terms[rows.BRACED_EXPONENT] != 1.0) | (terms[rows.BRACED_RELIEF] != 0.0)
    )
    if is_power.any():
        i = int(np.argmax(is_power))
        devices = [item.name for item in model.devices]
        place = f"story {i + 1}" if i < building.floors else devices[i - building.floors]
        raise ModelError(
            f"{model.name}: {place} has a power-law dashpot, whose damping depends on the "
            f"amplitude, so that it has no {subject}; use a dashpot with "
            "exponent 1"
        )


class _DynamicStiffness:
    """Complex dynamic stiffness of a building, and its response to a unit source."""

    def __init__(self, building: Building, source: str | int) -> None:
        terms = building.linear_terms[:, :-1]
        self.building = building
        self.source = source
        self.link = terms[rows.LINK]
        self.dampers = building.story_dampers + np.where(
            terms[rows.BRACE] == 0.0, terms[rows.POWER_DAMPER], 0.0
        )
        self.brace = terms[rows.BRACE]
        self.braced_damper = np.where(self.brace != 0.0, terms[rows.BRACED_DAMPER], 0.0)
        masses = building.masses
        # Damping between several floors, N s/m; zero without modal damping.
        self.coupling = building.modal[:, :masses].T @ building.modal[:, :masses]
        self.floor_damper = terms[rows.FLOOR_DAMPER, :masses]

    def response(self, frequency: Array) -> Array:
        """Return the responses of all floors and attachments at frequencies (Hz), shape (k, n)."""
        is_chain = not (self.building.modal.size or self.building.branched)
        solve = self._banded if is_chain else self._dense
        if self.building.system is not None:
            solve = self._of_system
        shown = self.building.floors + len(self.building.attachments)  # without rotations
        return np.array([solve(2.0 * math.pi * value)[:shown] for value in frequency])

    def _of_system(self, omega: float) -> Array:
        """Return the response of a model of matrices at a circular frequency. A unit displacement
        of the ground causes the inertia forces omega^2 M r in the motion relative to the ground."""
        system = self.building.system
        assert system is not None
        matrix = system.stiffness + 1j * omega * system.damping - omega**2 * system.mass
        if self.source != GROUND:
            return np.asarray(np.linalg.solve(matrix, self._unit_force(len(matrix))))
        load = omega**2 * system.loaded_mass @ system.influence
        return np.asarray(np.linalg.solve(matrix, load) + system.influence)

    def _unit_force(self, size: int) -> Array:
        """Return a unit force on the floor of the source, N."""
        load = np.zeros(size, dtype=complex)
        load[int(self.source) - 1] = 1.0
        return load

    def _springs(self, omega: float) -> Array:
        """Return the complex stiffness of each spring with its dampers and braces, N/m."""
        rate = 1j * omega * self.braced_damper
        series = np.divide(
            self.brace * rate, self.brace + rate, out=np.zeros_like(rate), where=self.brace != 0.0
        )
        return np.asarray(self.building.initial_stiffness + 1j * omega * self.dampers + series)

    def _banded(self, omega: float) -> Array:
        """Return the response of a chain without modal damping at a circular frequency from its
        three diagonals."""
        from scipy.linalg import solve_banded

        springs, to_ground = self._springs(omega), 1j * omega * self.floor_damper
        bands = np.zeros((3, springs.size), dtype=complex)
        bands[0, 1:] = bands[2, :-1] = -(self.link * springs)[1:]
        bands[1] = springs + to_ground
        bands[1, :-1] += (self.link * springs)[1:]
        bands[1] -= omega**2 * self.building.mass
        # Only springs and dampers to the ground move a floor if the ground moves.
        load = np.where(self.link == 0.0, springs, 0.0) + to_ground
        if self.source != GROUND:
            load = self._unit_force(springs.size)
        return np.asarray(solve_banded((1, 1), bands, load))

    def _dense(self, omega: float) -> Array:
        """Return the response at a circular frequency with the complete matrix."""
        deformations, springs = self.building.deformations, self._springs(omega)
        to_ground = 1j * omega * (np.diag(self.floor_damper) + self.coupling)
        matrix = (deformations.T * springs) @ deformations + to_ground
        matrix -= omega**2 * np.diag(self.building.mass)
        if self.source != GROUND:
            return np.asarray(np.linalg.solve(matrix, self._unit_force(len(matrix))))
        # The deformations for equal displacements are 0, and 1 in springs on the ground. Modal
        # damping acts on the velocity relative to the ground.
        ones = np.ones(len(matrix))
        load = deformations.T @ (springs * (deformations @ ones)) + to_ground @ ones
        return np.asarray(np.linalg.solve(matrix, load))


def _resolved(stiffness: _DynamicStiffness) -> tuple[Array, Array]:
    """Return frequencies (Hz) that resolve the resonances, and their responses."""
    natural = stiffness.building.modes().frequency
    highest = float(stiffness.building.stiffest_modes.omega[-1]) / (2.0 * math.pi)
    frequency = np.geomspace(_FIRST * natural[0], _LAST * highest, _COUNT)
    response = stiffness.response(frequency)
    is_open = np.ones(frequency.size - 1, dtype=bool)  # intervals that are halved next
    for halving in range(_MAX_HALVINGS):
        opened = np.flatnonzero(is_open)
        if not opened.size:
            break
        centers = np.sqrt(frequency[opened] * frequency[opened + 1])
        values = stiffness.response(centers)
        chord = 0.5 * (response[opened] + response[opened + 1])
        scale = np.maximum(np.abs(values), _NEGLIGIBLE * np.max(np.abs(response), axis=0))
        is_coarse = np.any(np.abs(values - chord) > _MAX_DIFFERENCE * scale, axis=1)
        # A narrow resonance may be unnoticed inside an interval, so that intervals with natural
        # frequencies are always halved.
        if halving < _MIN_HALVINGS:
            is_coarse |= np.isin(opened, np.searchsorted(frequency, natural) - 1)
        frequency = np.insert(frequency, opened + 1, centers)
        response = np.insert(response, opened + 1, values, axis=0)
        # Both halves of a coarse interval are halved again.
        is_open = np.zeros(frequency.size - 1, dtype=bool)
        first_half = np.searchsorted(frequency, centers[is_coarse]) - 1
        is_open[first_half] = is_open[first_half + 1] = True
    return frequency, response
