"""Floor spectra of the runs of a campaign, for --floor-spectra."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from tdint import studies
from tdint.output import figures
from tdint.studies.campaign.plan import Plan
from tdint.studies.campaign.story_profiles import FloorSuite, floor_suites, run_floors
from tdint.studies.store.result_store import Store
from tdint.system import processors
from tdint.units import OutputUnits
from tdint_cli.options.spectra import SPECTRA, SPECTRA_MEAN, SPECTRA_PICTURE, FloorRequest

if TYPE_CHECKING:
    from tdint.files import Content


def suite_spectra(
    wanted: FloorRequest,
    plan: Plan,
    store: Store,
    jobs: int | None,
    units: OutputUnits,
    *,
    plot: bool,
) -> tuple[dict[str, Content], Sequence[FloorSuite]]:
    """Return the floor spectra of a suite, and their files; empty if no floor is requested.

    Every run of the campaign is repeated for its floor motions.

    Parameters
    ----------
    jobs : int | None
        Number of processes; None for one per processor.

    Returns
    -------
    contents : dict of str to Content
        The contents of the files by file name.

    Raises
    ------
    UsageError
        A building has no such floor.
    """
    if not wanted.floors:
        return {}, ()
    # A store contains no response histories, so the runs are repeated for the floor motions.
    oscillators = wanted.chosen_periods(), wanted.floor_damping
    floors = run_floors(plan, store, wanted.floors, *oscillators, jobs or processors())
    suites = list(floor_suites(store, floors))
    tables = studies.campaign_tables
    contents: dict[str, Content] = {
        SPECTRA: tables.run_floor_table(store, floors).in_units(units).csv(),
        SPECTRA_MEAN: tables.floor_suite_table(store, suites).in_units(units).csv(),
    }
    if plot and suites:
        periods = store.first_periods()  # marked by the figure
        draw = partial(studies.suite_figures.floor_suite_picture, suites, units, periods)
        contents[SPECTRA_PICTURE] = figures.style.picture(".png", draw)
    return contents, suites
