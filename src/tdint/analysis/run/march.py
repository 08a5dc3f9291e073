"""One march of a case with one step, and how it ended: done, collapsed, diverged, not converged, or refused."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.run.amplification import find_instability
from tdint.analysis.run.outcome import Collapse, Energy, EnergyHistory, FailedRun, History, Response, StoryPeaks
from tdint.analysis.run.steps import HALVINGS, Steps, Workspace, compile_all, integrate, workspace
from tdint.ground_motion.record import Record
from tdint.kernels import layout
from tdint.kernels.march import observing
from tdint.methods.method import Integrator
from tdint.model.building import Building
from tdint.model.definition import Model
from tdint.model.laws import LAWS
from tdint.model.loads import force_table

Array = NDArray[np.float64]

_LARGE_IMBALANCE = 0.01
"""Energy error above which a run says so."""

_MADE = 1.0
"""Energy made by the method, over that put in, from which a drift beyond the collapse drift is the method's doing."""

_RUNAWAY = 100.0
"""Energy made by the method, over that put in, from which a run has diverged: ten times the amplitude."""

_OVERFLOW = 1e300
"""Residual from which a step that did not converge is one whose numbers ran away."""

_CURE = "use a smaller step or another method"

RESOLVED = 2.0
"""omega dt of the fastest mode up to which peaks are looked for between the steps."""


@dataclass(frozen=True)
class Case:
    """What is integrated, but for the steps. A ground motion of None is ground at rest.

    With `allow_unstable` a method is run beyond its limit, and a motion on energy that the method made is a result.
    """

    model: Model
    building: Building
    record: Record | None
    integrator: Integrator
    allow_unstable: bool = False

    def march(self, steps: Steps, history: bool = False) -> Response:
        """Integrate over the steps.

        Raises
        ------
        FailedRun
            The step is beyond the method's limit; the run diverged or did not converge.
        """
        if not self.allow_unstable:
            self._refuse_unstable(steps.h)
        compile_all(self.integrator)
        space, code, march_time = self.integrate(steps, history)
        collapse = self._collapse(steps, space, code)
        if code < 0:
            if collapse is None:
                raise self._failure(steps, space, code)
            steps = replace(steps, count=round(collapse.time / steps.h))
            space, code, march_time = self.integrate(steps, history)
        error = _energy(space.observed).error
        if not -error < _RUNAWAY and not self.allow_unstable:
            reason = f"the motion ends with {1.0 - error:.3g} times the energy that was put in"
            raise self._diverged(steps, space, reason, _runaway_story(space))
        return self._response(steps, space, march_time, collapse)

    def integrate(self, steps: Steps, history: bool = False) -> tuple[Workspace, int, float]:
        """The march alone: what it left, 0 or the code of the step that failed, and the time that it took, s."""
        # Where a step resolves all modes, the interpolant between its ends is as good as the ends are.
        resolved = self.building.fastest * steps.h <= RESOLVED
        space = workspace(self.building, self.integrator, steps.count if history else 0, between=resolved)
        space.state[layout.DISPLACEMENT, :-1] = self.model.initial.displacement
        space.state[layout.VELOCITY, :-1] = self.model.initial.velocity
        ground = np.zeros(1) if self.record is None else self.record.acceleration.copy()
        forces = force_table(self.model.excitation.forces)
        begin = time.perf_counter()
        code = integrate(self.integrator, self.building, forces, ground, steps, space)
        return space, code, time.perf_counter() - begin

    def _refuse_unstable(self, h: float) -> None:
        """Refuse a step beyond the method's limit for the building's modes in its initial state."""
        if self.integrator.stability_limit == math.inf:
            return
        modes = self.building.modes()
        damping = np.diagonal(modes.modal_damping(self.building.damping_matrix())) / (2.0 * modes.omega)
        found = find_instability(self.integrator, modes.omega, damping, h)
        if found is None:
            return
        omega = modes.omega[found.index]
        stable = found.largest_stable
        cure = f"the largest stable step is {stable:.6g} s" if stable > 0.0 else "no smaller step is stable"
        message = (
            f"{self.integrator.label} is unstable at dt {h:.6g} s: mode {found.index + 1} (omega {omega:.6g} rad/s, "
            f"omega dt {omega * h:.6g}) grows; {cure}, or use --allow-unstable"
        )
        raise FailedRun(message, "unstable-step", self.integrator, h, largest_stable_dt=stable)

    def _failure(self, steps: Steps, space: Workspace, code: int) -> FailedRun:
        residual = float(space.memo[layout.RESIDUAL])
        if code == layout.NOT_FINITE or not residual < _OVERFLOW:
            story = _runaway_story(space)
            return self._diverged(steps, space, f"the drift of story {story} ran away", story)
        reached = float(space.observed[observing.STEPS_REACHED]) * steps.h
        story = int(space.memo[layout.WORST_STORY]) + 1
        message = (
            f"{self.integrator.label} with dt {steps.h:.6g} s did not converge after {reached:.6g} s, with the step "
            f"halved {HALVINGS} times: story {story} is out of balance by {residual:.1e} of its forces; {_CURE}"
        )
        return FailedRun(
            message, "not-converged", self.integrator, steps.h, time=reached, story=story, residual=residual,
            notes=self._failure_notes(),
        )  # fmt: skip

    def _diverged(self, steps: Steps, space: Workspace, reason: str, story: int) -> FailedRun:
        reached = float(space.observed[observing.STEPS_REACHED]) * steps.h
        energy = _kinetic(self.building, space)
        size = "" if energy is None else f", kinetic energy {energy:.3g} J"
        message = (
            f"{self.integrator.label} with dt {steps.h:.6g} s diverged after {reached:.6g} s: {reason}{size}; {_CURE}"
        )
        return FailedRun(
            message, "diverged", self.integrator, steps.h, time=reached, story=story, energy=energy,
            notes=self._failure_notes(),
        )  # fmt: skip

    def _failure_notes(self) -> tuple[str, ...]:
        return (*(self.record.notes if self.record else ()), *self._stiffening_note())

    def _collapse(self, steps: Steps, space: Workspace, code: int) -> Collapse | None:
        """When the drift first exceeded the collapse drift, by bisection over marches of fewer steps: collapse is rare.

        It is the building's own if the method has made less energy by then than was put in. Else a run that came to its
        end has diverged, and of one that failed it is not said.
        """
        if not self._excess(space).any():
            return None
        low, high = -1, int(space.observed[observing.STEPS_REACHED])
        while high - low > 1:
            middle = (low + high) // 2
            if self._excess(self.integrate(replace(steps, count=middle))[0]).any():
                high = middle
            else:
                low = middle
        first, again, _ = self.integrate(replace(steps, count=high))
        story = int(np.argmax(self._excess(first))) + 1
        made = -_energy(first.observed).error
        own = again == 0 and made < _MADE and high > 0
        if own or (code == 0 and (high == 0 or self.allow_unstable)):
            return Collapse(high * steps.h, story, ended=code < 0)
        if code < 0:
            return None
        reason = f"the drift ratio of story {story} passed the collapse drift on {made:.3g} times the energy put in"
        raise self._diverged(replace(steps, count=high), first, reason, story)

    def _excess(self, space: Workspace) -> Array:
        """Drift ratio so far above the collapse drift, 0 for none."""
        ratio = space.peaks[observing.PEAK_DRIFT] / self.building.heights
        return np.asarray(np.maximum(np.nan_to_num(ratio - self.model.collapse_drift), 0.0))

    def _response(self, steps: Steps, space: Workspace, march_time: float, collapse: Collapse | None) -> Response:
        energy = _energy(space.observed)
        return Response(
            model=self.model,
            record=self.record,
            status="collapsed" if collapse else "done",
            method=self.integrator.label,
            dt=steps.h,
            steps=steps.count,
            iterations=int(space.observed[observing.ITERATIONS]),
            halvings=int(space.observed[observing.HALVINGS]),
            events=int(space.memo[layout.EVENTS]),
            march_time=march_time,
            stories=_story_peaks(self.building, space),
            energy=energy,
            history=_history(space, self.building, steps) if space.history.size else None,
            notes=self._notes(steps, energy, int(space.observed[observing.HALVINGS])),
            collapse=collapse,
        )

    def _notes(self, steps: Steps, energy: Energy, halvings: int) -> tuple[str, ...]:
        record = self.record
        notes = list(record.notes) if record else []
        if record and steps.stride > 1:
            notes.append(
                f"dt {steps.h:.6g} s is {steps.stride} sampling intervals: samples of the record in between are skipped"
            )
        if record and steps.count * steps.h > record.duration * (1.0 + 1e-9):
            notes.append(f"the record ends at {record.duration:.6g} s; the ground is at rest after it")
        if self.integrator.family.linear_only and self.model.excitation.forces:
            notes.append("exact takes harmonic forces as linear between the steps")
        notes += self._stiffening_note()
        if halvings:
            notes.append(f"steps that did not converge were halved, {halvings} times in all")
        if abs(energy.error) > _LARGE_IMBALANCE:
            change = "lost to" if energy.error > 0.0 else "made by"
            notes.append(
                f"the energy balance is off by {100.0 * abs(energy.error):.2g} % of the energy put in, {change} the "
                "method: use a smaller step or another method"
            )
        return tuple(notes)

    def _stiffening_note(self) -> tuple[str, ...]:
        if not self.integrator.family.limited_by_stiffening:
            return ()
        laws = [story.law for story in self.model.stories]
        stories = [i for i, law in enumerate(laws, start=1) if LAWS[law.name].stiffens(law.parameters)]
        if not stories:
            return ()
        return (
            f"{self.integrator.method.name} is stable only for small steps where a story becomes stiffer than at rest, "
            f"as story {stories[0]} can: check with a smaller step",
        )


def _runaway_story(space: Workspace) -> int:
    """The story with the largest drift, from 1; the first one that is no number before all others."""
    u = space.state[layout.DISPLACEMENT, :-1]
    finite = np.isfinite(u)
    if not finite.all():
        return int(np.argmin(finite)) + 1
    return int(np.argmax(np.abs(np.diff(u, prepend=0.0)))) + 1


def _kinetic(building: Building, space: Workspace) -> float | None:
    """Kinetic energy of the present motion relative to the ground, J; None if it is no finite number."""
    with np.errstate(over="ignore", invalid="ignore"):
        energy = float(0.5 * np.sum(building.mass * space.state[layout.VELOCITY, :-1] ** 2))
    return energy if math.isfinite(energy) else None


def _story_peaks(building: Building, space: Workspace) -> StoryPeaks:
    peaks = space.peaks
    drift = peaks[observing.PEAK_DRIFT]
    return StoryPeaks(
        height=building.heights,
        peak_drift=drift,
        peak_drift_ratio=drift / building.heights,
        residual_drift=space.springs[layout.DRIFT, :-1].copy(),
        peak_shear=peaks[observing.PEAK_SHEAR],
        ductility=drift / building.yield_drift,
        peak_displacement=peaks[observing.PEAK_DISPLACEMENT],
        peak_velocity=peaks[observing.PEAK_VELOCITY],
        peak_acceleration=peaks[observing.PEAK_ACCELERATION],
    )


def _energy(observed: Array) -> Energy:
    return Energy(
        start=float(observed[observing.ENERGY_START]),
        input=float(observed[observing.ENERGY_INPUT]),
        kinetic=float(observed[observing.ENERGY_KINETIC]),
        damping=float(observed[observing.ENERGY_DAMPED]),
        recoverable=float(observed[observing.ENERGY_RECOVERABLE]),
        dissipated=float(observed[observing.ENERGY_DISSIPATED]),
        largest=float(observed[observing.ENERGY_LARGEST]),
    )


def _history(space: Workspace, building: Building, steps: Steps) -> History:
    n = building.stories
    table = space.history
    displacement, velocity, acceleration, shear = (table[:, 1 + j * n : 1 + (j + 1) * n] for j in range(4))
    below = np.hstack([np.zeros((len(table), 1)), displacement[:, :-1]])
    return History(
        time=steps.h * np.arange(len(table), dtype=np.float64),
        ground_acceleration=table[:, 0],
        displacement=displacement,
        velocity=velocity,
        acceleration=acceleration,
        drift=displacement - below,
        shear=shear,
        energy=_energy_history(table[:, 1 + observing.HISTORY_FIELDS * n :], space.observed),
    )


def _energy_history(table: Array, observed: Array) -> EnergyHistory:
    given, kinetic, damping, recoverable, dissipated = table.T
    start, largest = observed[observing.ENERGY_START], observed[observing.ENERGY_LARGEST]
    imbalance = start + given - kinetic - damping - recoverable - dissipated
    error = imbalance / largest if largest > 0.0 else np.zeros_like(imbalance)
    return EnergyHistory(given, kinetic, damping, recoverable, dissipated, error)
