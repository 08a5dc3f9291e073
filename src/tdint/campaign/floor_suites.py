"""Response spectra of floors under a suite: of every run, and their mean and envelope over the motions."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from tdint.analysis.run.run import Subject, run_case
from tdint.analysis.spectra.floors import FloorSpectrum, floor_numbers, floor_spectra
from tdint.arrays import Array
from tdint.campaign.engine.runs import Run
from tdint.campaign.plan import Plan
from tdint.campaign.profiles import suite_levels
from tdint.campaign.store.store import Store
from tdint.system import on_threads


@dataclass(frozen=True)
class FloorChoice:
    """Floors by their names (numbers, or roof), periods (s) and damping ratios of their spectra."""

    floors: tuple[str, ...]
    periods: Array
    damping: tuple[float, ...]


@dataclass(frozen=True)
class RunFloors:
    """The spectra of the floors of a run.

    Attributes
    ----------
    building : int
        Its number in the store.
    run : Run
        The run.
    spectra : tuple of FloorSpectrum
        By floor, then damping.
    """

    building: int
    run: Run
    spectra: tuple[FloorSpectrum, ...]


@dataclass(frozen=True)
class FloorSuite:
    """Pseudo-accelerations of a floor of a building under a suite at one level.

    Attributes
    ----------
    building : str
        Its name.
    scale, level : float
        As in `tdint.campaign.profiles.Profile`.
    floor : int
        From 1 at the bottom.
    damping : float
        Of the oscillators on it.
    periods : ndarray, shape (k,)
        Natural periods, s.
    psa : ndarray, shape (motions, k)
        Of each motion that came to its end, m/s^2; of a pair the larger component at each period.
    runs, collapsed, failed : int
        Motions, and those that are in no number.
    measure : tuple of str
        As in `Profile`.
    """

    building: str
    scale: float
    level: float
    floor: int
    damping: float
    periods: Array
    psa: Array
    runs: int
    collapsed: int
    failed: int
    measure: tuple[str, str]

    @property
    def mean(self) -> Array:
        """Over the motions."""
        return np.asarray(np.mean(self.psa, axis=0))

    @property
    def envelope(self) -> Array:
        """The largest of any motion."""
        return np.asarray(np.max(self.psa, axis=0))


def run_floors(plan: Plan, store: Store, choice: FloorChoice, jobs: int) -> list[RunFloors]:
    """The spectra of the floors of all runs of a campaign that came to their end: each run is done once more, with its
    history, over the steps that the store tells.

    Raises
    ------
    UsageError
        A building has no such floor.
    """
    done = store.connection.execute(
        "SELECT building, record, scale, sample, dt_s FROM run_rows WHERE status = 'done' ORDER BY 1, 2, 3, 4"
    ).fetchall()
    found: list[RunFloors] = []
    buildings: dict[int, list[tuple[Run, float]]] = defaultdict(list)
    for building, record, scale, sample, dt in done:
        buildings[building].append((Run(record, scale, sample), dt))
    for building, runs in buildings.items():
        subject = plan.buildings[building].subject()
        floor_numbers(choice.floors, plan.buildings[building].stories)
        found += on_threads(partial(_spectra, plan, building, subject, choice), runs, jobs)
    return sorted(found, key=lambda one: (one.building, one.run))


def _spectra(plan: Plan, building: int, subject: Subject, choice: FloorChoice, run: tuple[Run, float]) -> RunFloors:
    key, dt = run
    settings = plan.settings
    response = run_case(
        subject.case(plan.motions[key.motion].record, key.scale),
        dt=dt,
        duration=settings.duration,
        history=True,
        until_rest=settings.until_rest,
    )
    return RunFloors(building, key, floor_spectra(response, choice.floors, choice.periods, choice.damping))


def floor_suites(store: Store, found: Sequence[RunFloors]) -> Iterator[FloorSuite]:
    """The spectra over the motions of each building, level, floor and damping ratio; none where no motion came to its
    end."""
    of_buildings: dict[int, dict[Run, tuple[FloorSpectrum, ...]]] = defaultdict(dict)
    for one in found:
        of_buildings[one.building][one.run] = one.spectra
    names = store.buildings()
    for number, spectra in of_buildings.items():
        for level in suite_levels(store, number):
            if not level.stood:
                continue
            runs = len(level.stood) + level.collapsed + level.failed
            for i, shown in enumerate(spectra[level.stood[0][0]]):
                psa = [np.max([spectra[run][i].spectrum.psa for run in motion], axis=0) for motion in level.stood]
                yield FloorSuite(
                    building=names[number][0],
                    scale=level.scale,
                    level=level.value,
                    floor=shown.floor,
                    damping=shown.spectrum.damping,
                    periods=shown.spectrum.periods,
                    psa=np.array(psa),
                    runs=runs,
                    collapsed=level.collapsed,
                    failed=level.failed,
                    measure=level.measure,
                )
