"""Pushover: the base shear of a building that is pushed slowly, over the displacement of its roof.

The forces on the floors keep one pattern and grow and fall together, by one factor. In a chain the shears of all
stories follow from that factor; so a building is led along by the drift of one story, the softest at the time, and each
other story takes the drift at which it carries its share: forwards while the factor grows, backwards while it falls.
That goes through peaks and down falling branches, and needs no matrix.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from tdint.analysis.given import drift_of
from tdint.analysis.static.cyclic import follow_path
from tdint.arrays import Array
from tdint.errors import AnalysisError, UsageError
from tdint.kernels import layout as at
from tdint.model.building import Building, assemble
from tdint.model.config.model_file import model_of
from tdint.model.definition import Model
from tdint.tabular import Tabular
from tdint.units import DriftSize

MOST_POINTS = 100_000
_CLOSE = 1e-11  # of a force over the story's largest one so far: it carries its share
_ITERATIONS = 60
_PARTS = 8  # steps of the leading story in a step of the roof
_MOST_PARTS = 4000


@dataclass(frozen=True, repr=False)
class Pushover(Tabular):
    """Result of a pushover; row 0 is the start at rest.

    Attributes
    ----------
    model : Model
        The building.
    pattern : str
        Name of the pattern of forces.
    forces : ndarray, shape (n,)
        The pattern, with sum 1.
    drift : ndarray, shape (rows, n)
        Drifts of the stories, m.
    base_shear : ndarray, shape (rows,)
        Sum of the forces, N.
    largest_base_shear : float
        The largest of the whole path, between the rows, too, N.
    drift_at_largest : ndarray, shape (n,)
        Drifts of the stories there, m.
    """

    model: Model
    pattern: str
    forces: Array
    drift: Array
    base_shear: Array
    largest_base_shear: float
    drift_at_largest: Array

    def _headline(self) -> str:
        return f"of {self.model.name!r}, {self.pattern} pattern, largest base shear {self.largest_base_shear:.4g} N"

    @property
    def roof_displacement(self) -> Array:
        """Displacement of the roof relative to the ground, m, shape (rows,)."""
        return np.asarray(self.drift.sum(axis=1))

    @property
    def height(self) -> float:
        """Height of the building, m; nan where a story has none."""
        return math.fsum(story.drift_height or (0.0 if story.isolator else math.nan) for story in self.model.stories)

    @property
    def roof_drift_ratio(self) -> Array:
        """Roof displacement over the height; nan without heights."""
        return self.roof_displacement / self.height

    @property
    def falls(self) -> bool:
        """Whether the base shear falls to zero before the end."""
        return bool(self.base_shear[-1] <= 0.0)

    @property
    def roof_at_largest(self) -> float:
        """Displacement of the roof at the largest base shear, m."""
        return float(self.drift_at_largest.sum())


def _triangular(building: Building) -> Array:
    if np.isnan(building.rises).any():
        raise UsageError("the triangular pattern needs the height of every story; give heights or another --pattern")
    return building.mass * np.cumsum(building.rises)


PATTERNS: Mapping[str, Callable[[Building], Array]] = {
    "first-mode": lambda building: building.mass * building.modes().shapes[:, 0],
    "uniform": lambda building: building.mass.copy(),
    "triangular": _triangular,
}
"""Forces on the floors, up to a factor: the masses times first mode, 1, or height above the ground."""


def pushover(
    model: Model, size: DriftSize | str | float, *, pattern: str = "first-mode", points: int = 200
) -> Pushover:
    """Push a building until its roof has moved by a displacement.

    Parameters
    ----------
    size : DriftSize, str or float
        Displacement of the roof, as a length or, also as a number, over the building's height.
    pattern : str
        A key of `PATTERNS`.
    points : int
        Rows after the start, at equal steps of the roof displacement; they end where the base shear has fallen to zero:
        beyond, the building would fall by itself.

    Raises
    ------
    UsageError
        A drift ratio or the triangular pattern without heights; a multiple of a yield drift; an unknown pattern.
    AnalysisError
        No equilibrium is found on the way.
    """
    if pattern not in PATTERNS:
        raise UsageError(f"unknown pattern {pattern!r}; known: {', '.join(PATTERNS)}")
    if not 1 <= points <= MOST_POINTS:
        raise UsageError(f"points must be from 1 to {MOST_POINTS}, got {points}")
    model = model_of(model)
    building = assemble(replace(model, damping=None))
    target = _target(drift_of(size), building)
    forces = PATTERNS[pattern](building)
    forces /= forces.sum()
    chain = _Chain(building, forces)
    drifts = [np.zeros(building.stories)]
    shears = [0.0]
    for row in range(1, points + 1):
        chain.push(target * row / points, target / points)
        drifts.append(chain.drift.copy())
        shears.append(chain.factor)
        if chain.factor <= 0.0:
            break
    return Pushover(model, pattern, forces, np.array(drifts), np.array(shears), *chain.largest)


def _target(size: DriftSize, building: Building) -> float:
    scales = {"length": 1.0, "ratio": float(building.rises.sum())}
    if size.kind not in scales:
        raise UsageError(f"drift {size.text}: the roof has no yield drift; give a drift ratio or a length")
    if math.isnan(scales[size.kind]):
        raise UsageError(f"drift {size.text} is a drift ratio, and a story has no height; give a length, such as 200mm")
    return size.value * scales[size.kind]


class _Chain:
    """The stories on their way.

    Attributes
    ----------
    drift : ndarray, shape (n,)
        Present drifts, m.
    factor : float
        Present base shear, N.
    largest : tuple of (float, ndarray)
        The largest base shear of the way so far, N, and the drifts there.
    """

    def __init__(self, building: Building, forces: Array) -> None:
        self.share = np.cumsum(forces[::-1])[::-1]
        self.stories = [_Story(building, i) for i in range(building.stories)]
        self.drift = np.zeros(building.stories)
        self.factor = 0.0
        self.largest = (0.0, self.drift)

    def push(self, displacement: float, step: float) -> None:
        """On to the next state at which the roof has moved that far; `step` is about how far it moves."""
        lead = self._softest()
        size = step / _PARTS
        for _ in range(_MOST_PARTS):
            lead, drift, factor = self._advance(lead, size)
            if drift.sum() >= displacement:
                break
            self._keep(lead, drift, factor)
            lead = self._softest()
        else:
            raise AnalysisError(
                f"the pushover found no way on to a roof displacement of {displacement:.6g} m: the other stories move "
                f"back as story {lead + 1} goes on; give more --points or a smaller --drift"
            )
        self._keep(lead, *self._meet(displacement, lead, size, drift, factor))

    def _meet(self, displacement: float, lead: int, size: float, drift: Array, factor: float) -> tuple[Array, float]:
        """Between here and a step of the leading story with these results, the state with a roof displacement: by the
        Illinois algorithm (Dowell and Jarratt 1971)."""
        low, high = 0.0, size
        below, above = self.drift.sum() - displacement, drift.sum() - displacement
        for _ in range(_ITERATIONS):
            if abs(drift.sum() - displacement) <= _CLOSE * displacement:
                break
            middle = low + (high - low) * below / (below - above)
            trial = self._trial(lead, middle)
            if trial is None or not low < middle < high:
                break
            drift, factor = trial
            left = drift.sum() - displacement
            if left > 0.0:
                high, above, below = middle, left, 0.5 * below
            else:
                low, below, above = middle, left, 0.5 * above
        return drift, factor

    def _softest(self) -> int:
        """The story that moves most as the factor changes; one that falls before all others."""
        return int(np.argmin([story.tangent / share for story, share in zip(self.stories, self.share, strict=True)]))

    def _advance(self, lead: int, size: float) -> tuple[int, Array, float]:
        """A step of the leading story; of another one where that cannot carry its share."""
        order = [lead, *(i for i in range(len(self.stories)) if i != lead)]
        for story in order:
            trial = self._trial(story, size)
            if trial is not None:
                return story, *trial
        raise AnalysisError(f"the pushover found no equilibrium after a roof displacement of {self.drift.sum():.6g} m")

    def _trial(self, lead: int, size: float) -> tuple[Array, float] | None:
        """Drifts and factor after a step of one story; None if another story cannot carry its share."""
        force, _ = self.stories[lead].at(self.drift[lead] + size)
        factor = force / self.share[lead]
        drift = self.drift.copy()
        drift[lead] += size
        for i, story in enumerate(self.stories):
            if i != lead:
                found = story.carrying(factor * self.share[i])
                if found is None:
                    return None
                drift[i] = found
        return drift, factor

    def _note_largest(self, lead: int, drift: Array, factor: float) -> None:
        """Note the largest base shear on the way to these drifts: at its end, or where the leading story stops to rise.

        The factor follows from the force of that story alone.
        """
        story, low, high = self.stories[lead], 0.0, float(drift[lead] - self.drift[lead])
        if story.tangent > 0.0 and story.at(float(drift[lead]))[1] <= 0.0:
            for _ in range(_ITERATIONS):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if story.at(self.drift[lead] + middle)[1] > 0.0 else (low, middle)
            if top := self._trial(lead, high):
                drift, factor = max((top, (drift, factor)), key=lambda state: state[1])
        self.largest = max(self.largest, (factor, drift), key=lambda state: state[0])

    def _keep(self, lead: int, drift: Array, factor: float) -> None:
        self._note_largest(lead, drift, factor)
        for story, new in zip(self.stories, drift, strict=True):
            story.go(float(new))
        self.drift, self.factor = drift, factor


class _Story:
    """One story with P-delta, from rest over the turns of its way to where it stands."""

    def __init__(self, building: Building, i: int) -> None:
        self._building, self._number = building, i + 1
        self._geometric = float(building.linear_terms[at.GEOMETRIC, i])
        self._turns: list[float] = [0.0]
        self.drift = 0.0
        self.force = 0.0
        self.initial = self.tangent = float(building.initial_stiffness[i])
        self._largest = 0.0

    def at(self, drift: float) -> tuple[float, float]:
        """Force and tangent at a drift, reached straight from here."""
        path = follow_path(self._building, self._number, np.array([*self._turns, self.drift, drift]))
        return float(path.shear[-1]) + self._geometric * drift, float(path.tangent[-1]) + self._geometric

    def go(self, drift: float) -> None:
        """Go to a drift."""
        if drift == self.drift:
            return
        self.force, self.tangent = self.at(drift)
        self._largest = max(self._largest, abs(self.force))
        if (drift - self.drift) * (self.drift - self._turns[-1]) < 0.0:
            self._turns.append(self.drift)
        self.drift = drift

    def carrying(self, force: float) -> float | None:
        """The next drift with this force: forwards for more than now, backwards for less; None if there is none."""
        missing = force - self.force
        close = _CLOSE * max(self._largest, abs(force))
        if abs(missing) <= close:
            return self.drift
        forwards = missing > 0.0
        near, far = self.drift, None
        stiffness = self.tangent if self.tangent > 0.0 and forwards else self.initial
        drift = near + missing / stiffness
        for _ in range(_ITERATIONS):
            here, tangent = self.at(drift)
            left = force - here
            if abs(left) <= close:
                return drift
            if (left > 0.0) == forwards:
                if tangent <= 0.0:
                    return None
                near = drift
            else:
                far = drift
            new = drift + left / tangent if tangent > 0.0 else near
            if far is not None and not min(near, far) < new < max(near, far):
                new = 0.5 * (near + far)
            if new == drift:
                return drift
            drift = new
        return None
