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
from typing import NamedTuple

import numpy as np

from tdint.arrays import Array, cached_property, immutable
from tdint.errors import ModelError, UsageError
from tdint.kernels import layout as rows
from tdint.kernels.equations import tridiagonal
from tdint.kernels.stepping import Factors
from tdint.model.building import Building, assemble
from tdint.model.definition import Model
from tdint.model.keys.fields import ROOF
from tdint.response.arguments import AnyModel, model_of
from tdint.response.matrices import check_dampers, matrices
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

_AT_ONCE = 256  # right sides that are eliminated together; 1 MB for 300 masses

_MAX_GROWTH = 1e6
"""Maximum ratio of the parts of a diagonal entry to its pivot: the elimination has no pivoting, so
that a response loses as many digits."""


class Resonance(NamedTuple):
    """Maximum amplitude of a floor: number of the floor or name of the attachment, frequency (Hz),
    and amplitude."""

    floor: int | str
    frequency: float
    amplitude: float


@immutable
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

    @cached_property
    def amplitude(self) -> Array:
        """Absolute values of the response, shape (k, n)."""
        return np.abs(self.response)

    @cached_property
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
    source : str or int, default "ground"
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
    if source != GROUND and source not in range(1, building.floors + 1):
        raise UsageError(
            f"the source of the transfer function must be {GROUND}, {ROOF} or a floor from 1 to "
            f"{building.floors} for a force on this floor, got {source!r:.40}"
        )
    check_dampers(model, building, "transfer function")
    if not building.modes().omega[0]:
        raise ModelError(
            f"{model.name}: the transfer function needs the periods, and a story has no initial "
            "stiffness; use time histories"
        )
    stiffness = _DynamicStiffness(model, building, source)
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


class _DynamicStiffness:
    """Complex dynamic stiffness of a building, and its response to a unit source."""

    def __init__(self, model: Model, building: Building, source: str | int) -> None:
        self.building, self.source, self.matrices = building, source, matrices(model)
        self.has_springs = model.matrices is None

    def response(self, frequency: Array) -> Array:
        """Return the responses of all floors and attachments at frequencies (Hz), shape (k, n)."""
        shown = self.building.floors + len(self.building.attachments)  # without further rows
        result = np.full((frequency.size, shown), np.nan, dtype=complex)
        omega = 2.0 * math.pi * frequency
        at_once = 1 + _AT_ONCE // (1 + len(self.building.modal))
        for start in range(0, frequency.size if self.has_springs else 0, at_once):
            part = slice(start, start + at_once)
            with np.errstate(all="ignore"):  # a pivot can be zero
                result[part] = self._eliminated(omega[part])
        for i in np.flatnonzero(np.isnan(result[:, 0])):
            result[i] = self._solved(omega[i])[:shown]
        return result

    def _solved(self, omega: float) -> Array:
        """Return the response at a circular frequency with the complete matrix. A unit motion of
        the ground causes the forces omega^2 M0 r in the motion relative to the ground."""
        parts = self.matrices
        drifts, brace, damper = parts.braces
        rate = 1j * omega * damper
        matrix = parts.stiffness + 1j * omega * parts.damping - omega**2 * parts.mass
        matrix += (drifts.T * (brace * rate / (brace + rate))) @ drifts
        if self.source != GROUND:
            return np.asarray(np.linalg.solve(matrix, np.eye(len(matrix))[int(self.source) - 1]))
        load = omega**2 * parts.loaded_mass @ parts.influence
        return np.asarray(np.linalg.solve(matrix, load) + parts.influence)

    def _eliminated(self, omega: Array) -> Array:
        """Return the responses at circular frequencies by the elimination of `tridiagonal`, with
        arrays over the frequencies as entries, and its formula for modal damping; nan at a small
        pivot, where a part of the building resonates without damping."""
        building, terms = self.building, self.building.linear_terms
        n, masses, modal = building.stories, building.masses, building.modal[:, : building.masses]
        brace, braced, power = terms[[rows.BRACE, rows.BRACED_DAMPER, rows.POWER_DAMPER], :-1]
        # An inerter of an attachment acts on its motion relative to the ground.
        inertance, to_ground = np.zeros(n), np.zeros(masses)
        if building.system is not None and len(building.system.inerters):
            inertance[:] = building.system.inerters.max(axis=1)
            to_ground[building.floors :] = inertance[building.floors : masses]
            inertance[building.floors : masses] = 0.0
        # Complex stiffnesses of the springs, and of the floors to the ground
        rate = 1j * omega
        dampers = building.story_dampers + np.where(brace == 0.0, power, 0.0)
        springs = building.initial_stiffness[:, None] + np.outer(dampers, rate)
        springs = springs - np.outer(inertance, omega**2)
        series, stiffness = np.outer(braced, rate), brace[:, None]
        springs += np.where(stiffness != 0.0, stiffness * series / (stiffness + series), 0.0)
        grounded = np.outer(terms[rows.FLOOR_DAMPER, :masses], rate)
        grounded = grounded - np.outer(to_ground, omega**2)
        # Right sides: the source, then the vectors of modal damping
        sides = np.zeros((n, 1 + len(modal), omega.size), dtype=complex)
        sides[:masses, 1:] = modal.T[:, :, None]
        if self.source == GROUND:
            # Only springs and dampers to the ground move a floor if the ground moves.
            sides[:masses, 0] = grounded + np.outer(modal.T @ modal.sum(axis=1), rate)
            on_ground = np.flatnonzero(terms[rows.LINK, :-1] == 0.0)
            upper = terms[rows.UPPER_FLOOR, on_ground].astype(int)
            np.add.at(sides[:, 0], upper, springs[on_ground])
        else:
            sides[int(self.source) - 1, 0] = 1.0
        # The table of the elimination has an array for each row and column.
        pivots, inertia = springs.copy(), np.outer(building.mass, omega**2)
        pivots[:masses] += grounded - inertia
        table = {
            (row, i): values[i]
            for row, values in enumerate((pivots, springs, sides))
            for i in range(n)
        }
        factors = Factors(table, 0, 1, 3, terms)  # type: ignore[arg-type]
        tridiagonal.link(terms, factors, 1, n)
        size = np.abs(pivots[:masses]) + inertia
        tridiagonal.factor(factors, n)
        tridiagonal.solve(factors, 2, n)
        result, inverse = (np.array([table[row, i] for i in range(masses)]) for row in (2, 0))
        # Woodbury formula
        amplitudes = np.tensordot(modal, result, 1).T * rate[:, None, None]
        small = np.eye(len(modal)) + np.swapaxes(amplitudes[:, 1:], 1, 2)
        amplitude = np.linalg.solve(small, amplitudes[:, 0, :, None])[..., 0]
        values = result[:, 0] - np.einsum("imk,km->ik", result[:, 1:], amplitude)
        is_large = np.all(np.abs(inverse) * size < _MAX_GROWTH, axis=0)
        return np.where(is_large[:, None], values.T, np.nan)


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
