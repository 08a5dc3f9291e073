"""A campaign on the command line: its folder, its progress, what is written at its end and said of it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from tdint.errors import UsageError
from tdint.files import write_files
from tdint.output import tables
from tdint.output_units import SI, OutputUnits
from tdint.written_numbers import how_many
from tdint_cli.batch.profiles import PICTURE, PROFILES, RATIOS, Profiles, SuiteRequest
from tdint_cli.drawing import emit_table
from tdint_cli.errors import Failures
from tdint_cli.options.spectra import SPECTRA, SPECTRA_MEAN, SPECTRA_PICTURE
from tdint_cli.terminal import note, progress_bar, say, warn

if TYPE_CHECKING:
    from tdint.campaign.carry_out import Advance, Engine, Shard
    from tdint.campaign.plan import Plan
    from tdint.campaign.store.store import Store
    from tdint.files import Content, Writer

RUNS, STORIES, SHOCKS, SUMMARY = "runs.csv", "stories.csv", "shocks.csv", "summary.json"
DAMAGE, TYPES, LOSSES = "damage.csv", "damage-types.csv", "losses.csv"
PARQUET = ("runs.parquet", "stories.parquet", "damage.parquet")
SIMCENTER, GEOJSON = "simcenter.csv", "buildings.geojson"
"""What is made of a store, each file whole."""

MEASURES = "measures.csv"
"""Of the intensities of runs, for `tdint fragility`."""

OF_FLOORS = (SPECTRA, SPECTRA_MEAN, SPECTRA_PICTURE)

_FAILED = ("diverged", "not-converged", "unstable-step", "not-within-tolerance")


def carry_out(
    plan: Plan,
    engine: Engine,
    request: SuiteRequest,
    *,
    shard: Shard | None = None,
    limit: int | None = None,
    show: bool = False,
) -> None:
    """Do what is left of a campaign in the folder of -o and write its tables, and what more is asked of the suite;
    `show` the runs on standard output, too. --overwrite replaces another campaign, and tables that this one did not
    write.

    Raises
    ------
    UsageError
        The folder holds another campaign.
    OutputError
        It cannot be written, holds tables of another command, or another process is at it.
    Failures
        Records that could not be read, when all else is done.
    """
    from tdint.campaign.store.connection import locked, refuse_network

    folder, overwrite = Path(request.output or ""), request.overwrite
    refuse_network(folder)
    with locked(folder):
        refuse_foreign(folder, plan.settings.stories, plan.settings.profiles, overwrite=overwrite)
        store, remarks = _opened(folder, plan, overwrite)
        note(*plan.notes, *remarks)
        with store:
            units = request.output_units or store.output_units()
            advance = advance_with_bar(plan, store, engine, shard=shard, limit=limit)
            profiles = Profiles(store, request, units)
            finish(store, folder, units, overwrite=overwrite, profiles=profiles, plan=plan)
            if show:
                emit_table(tables.campaign.runs_table(store).in_units(units))
            if request.baseline is not None and is_complete(store):
                emit_table(profiles.ratios(stories=False))
            _say(store, advance)
            unmet = profiles.tell() if is_complete(store) else []
    if plan.failures or unmet:
        raise Failures([*plan.failures, *unmet])


def _opened(folder: Path, plan: Plan, overwrite: bool) -> tuple[Store, list[str]]:
    """The store in a folder and what to say of it; with `overwrite` a new one in place of one that cannot be used."""
    from tdint.campaign.store.connection import UntrustedStoreError
    from tdint.campaign.store.store import open_store

    try:
        return open_store(folder, plan)
    except (UntrustedStoreError, UsageError):
        if not overwrite:
            raise
    _forget(folder)
    return open_store(folder, plan)


def is_complete(store: Store) -> bool:
    """Whether all runs of a campaign are done: a mean over some of the motions would be taken for that of all."""
    return sum(store.statuses().values()) == int(store.meta("runs"))


def refuse_foreign(folder: Path, stories: bool, profiles: bool, *, overwrite: bool) -> None:
    """Refuse tables where no campaign has begun: another command wrote them.

    Raises
    ------
    OutputError
        There is one, and it may not be replaced.
    """
    from tdint.campaign.store.store import FILE, foreign

    if not (folder / FILE).exists() and not overwrite:
        for name in (RUNS, *(STORIES,) * stories, *(PROFILES,) * profiles, SUMMARY):
            if (folder / name).exists():
                raise foreign(folder / name)


def _forget(folder: Path) -> None:
    """Remove a campaign from a folder that is locked, with the tables that were made of it."""
    from tdint.campaign.store.store import FILE, forget, remove

    forget(folder / FILE)
    tables = (RUNS, STORIES, SHOCKS, PROFILES, RATIOS, DAMAGE, TYPES, LOSSES)
    for name in (*tables, PICTURE, MEASURES, *OF_FLOORS, *PARQUET, SIMCENTER, GEOJSON, SUMMARY):
        remove(folder / name)


def advance_with_bar(
    plan: Plan, store: Store, engine: Engine, *, shard: Shard | None = None, limit: int | None = None
) -> Advance:
    """Do what is left, with a bar that tells the rate."""
    from tdint.campaign.carry_out import carry_out

    with progress_bar(to_terminal=False) as progress:

        def tell(advance: Advance) -> None:
            progress(f"{advance.done}/{advance.runs} runs, {_rate(advance)}", advance.done / advance.runs)

        return carry_out(plan, store, engine, shard=shard, limit=limit, tell=tell)


def _rate(advance: Advance) -> str:
    return f"{3600.0 * advance.rate:.3g} an hour"


def finish(
    store: Store,
    folder: Path,
    units: OutputUnits = SI,
    *,
    overwrite: bool = False,
    profiles: Profiles | None = None,
    plan: Plan | None = None,
) -> None:
    """Write what stands beside a store: runs.csv, stories.csv and profiles.csv if they are wanted, what is asked for
    over all motions, summary.json; and what was exported of an earlier state anew."""
    writers = {RUNS: _runs(store, units), **_of_suite(folder, profiles, plan)}
    ours = [name for name in (*PARQUET, SIMCENTER, GEOJSON) if store.is_ours(folder / name)]
    again = _exports(store, units, ours)
    written = {name: writer for name, writer in again.items() if writer}
    _write(folder, store, {**writers, **written}, units, overwrite=overwrite)
    for name, writer in again.items():
        if writer:
            note(f"{folder / name}: written anew, as the campaign is now")
        else:
            (folder / name).unlink(missing_ok=True)
            note(f"{folder / name}: removed, for it was of an earlier state and cannot be written here")


def _of_suite(folder: Path, profiles: Profiles | None, plan: Plan | None = None) -> dict[str, Content]:
    """What is asked for over all motions, once all runs are done: the picture of the profiles and the buildings over a
    baseline; of a plan also spectra of floors, the page, and intensities of the runs."""
    if not profiles:
        return {}
    request, store = profiles.request, profiles.store
    picture = request.picture(folder)
    if not is_complete(store):
        return {}
    found: dict[str, Content] = {str(picture.absolute()): profiles.draw(picture)} if picture else {}
    if request.baseline is not None:
        found[RATIOS] = profiles.ratios(stories=True).csv()
    if plan is None:
        return found
    found |= request.of_floors.of_suite(plan, store, request.jobs, profiles.units, plot=request.plot is not None)
    if request.report is not None:
        found[str(Path(request.report).absolute())] = profiles.report(plan)
    if request.im:
        from tdint.campaign.fragility.run_measures import measured, run_measure

        measures = [run_measure(name) for name in request.im]
        table = tables.campaign.measures_table(measures, measured(plan, store, measures))
        found[MEASURES] = table.in_units(profiles.units).csv()
    return found


def export(
    store: Store,
    folder: Path,
    *,
    simcenter: bool,
    geojson: bool = False,
    units: OutputUnits = SI,
    overwrite: bool = False,
    profiles: Profiles | None = None,
) -> None:
    """Write all tables of a store anew; Parquet files if pyarrow is there: these and SimCenter's have SI units.

    Raises
    ------
    UsageError
        A map is asked for and there are no places, or runs are left.
    """
    if geojson:
        check_map(store)
    asked = (SIMCENTER,) * simcenter + (GEOJSON,) * geojson
    wanted = {*PARQUET, *asked, *(name for name in (SIMCENTER, GEOJSON) if store.is_ours(folder / name))}
    others = {name: writer for name, writer in _exports(store, units, wanted).items() if writer}
    writers: dict[str, Content] = {RUNS: _runs(store, units), **_of_suite(folder, profiles), **others}
    _write(folder, store, writers, units, overwrite=overwrite)


def _exports(store: Store, units: OutputUnits, names: Collection[str]) -> dict[str, Writer | None]:
    """What is written on request alone, of these names; None for what cannot be written here."""
    if not names:
        return {}
    from tdint.output.tables.exports import (
        damage_parquet,
        is_mapped,
        runs_parquet,
        stories_parquet,
        write_geojson,
        write_simcenter,
    )

    runs, stories, damage = PARQUET
    makers: dict[str, Callable[[], Writer | None]] = {
        runs: lambda: runs_parquet(store),
        stories: lambda: stories_parquet(store) if store.meta("setting stories") == "true" else None,
        damage: lambda: damage_parquet(store) if store.damage() else None,
        SIMCENTER: lambda: lambda stream: write_simcenter(store, stream),
        GEOJSON: lambda: (
            (lambda stream: write_geojson(store, stream, units)) if is_complete(store) and is_mapped(store) else None
        ),
    }
    return {name: makers[name]() for name in makers if name in names}


def check_map(store: Store) -> None:
    """Raise UsageError where a map has no places, or runs are left."""
    from tdint.output.tables.exports import is_mapped

    if not is_mapped(store):
        raise UsageError(f"{store.name}: a map needs an inventory with the columns Latitude and Longitude")
    if not is_complete(store):
        raise UsageError(
            f"{store.name}: not all runs are done; a map tells what the buildings do under all motions: call `tdint "
            "campaign` again first"
        )


def _runs(store: Store, units: OutputUnits) -> Writer:
    return lambda stream: tables.campaign.write_runs(store, stream, units)


def _write(folder: Path, store: Store, contents: Mapping[str, Content], units: OutputUnits, *, overwrite: bool) -> None:
    from tdint.output.summary import campaign_summary, in_units, json_bytes

    files: dict[str, Content] = dict(contents)
    if store.meta("setting stories") == "true":
        files[STORIES] = lambda stream: tables.campaign.write_stories(store, stream, units)
    if next(store.shocks(), None) is not None:
        files[SHOCKS] = lambda stream: tables.campaign.write_shocks(store, stream, units)
    if store.settings().get("profiles") == "true" and is_complete(store):
        files[PROFILES] = lambda stream: tables.campaign.write_profiles(store, stream, units)
    files |= _damage(store, units)
    files[SUMMARY] = json_bytes(in_units(campaign_summary(store), units))
    here = {folder / name: content for name, content in files.items()}
    if not overwrite:
        store.refuse_foreign(here)
    write_files(here, overwrite=True, tell=store.will_write)


def _damage(store: Store, units: OutputUnits) -> dict[str, Content]:
    """What is written of damage, where the campaign tells it; means over the motions once all runs are done."""
    if not store.damage():
        return {}
    from tdint.campaign.fragility.run_damage import stored_states
    from tdint.output.tables.damage_states import write_damage, write_losses, write_types

    writers: dict[str, Content] = {DAMAGE: lambda stream: write_damage(store, stream, units)}
    if is_complete(store):
        writers[TYPES] = lambda stream: write_types(store, stream)
        if any(states.losses for states in stored_states(store).values()):
            writers[LOSSES] = lambda stream: write_losses(store, stream)
    return writers


def _say(store: Store, advance: Advance) -> None:
    """What was done, and what of it a person must look at."""
    new = advance.done - advance.before
    if not new:
        say(f"{how_many(advance.done, 'run')} done before: nothing to do.")
    else:
        before = f", {advance.before} before" if advance.before else ""
        say(f"{how_many(new, 'run')} in {advance.seconds:.3g} s ({_rate(advance)}){before}.")
    tell_outcomes(store)


def tell_outcomes(store: Store) -> None:
    """How many runs failed, collapsed, were repeated or are not at rest."""
    from tdint.model.damage_states import FALLEN
    from tdint.output.summary import without_error

    statuses = store.statuses()
    failed = {name: statuses[name] for name in _FAILED if name in statuses}
    if failed:
        listed = ", ".join(f"{count} {name}" for name, count in failed.items())
        warn(f"no result of {how_many(sum(failed.values()), 'run')}: {listed}; their rows have empty cells")
    fell = {name: statuses[name] for name in FALLEN if name in statuses}
    if fell:
        say(", ".join(f"{how_many(count, 'run')} {name}" for name, count in fell.items()) + ".")
    if repeated := store.count("repeats > 0"):
        note(f"{how_many(repeated, 'run')} repeated with finer steps (column dt_s)")
    if unknown := without_error(store):
        note(f"no estimated error of {how_many(unknown, 'run')}: repetitions failed or fell earlier; empty cells")
    if corrected := store.count("corrected_peak_drift_m IS NOT NULL"):
        note(f"columns `corrected_` of the CSV: demands of {how_many(corrected, 'run')}, corrected by their errors")
    if moving := store.count("at_rest = 0"):
        warn(f"{how_many(moving, 'run')} still moving when the time was over: residual drifts are not at rest")
