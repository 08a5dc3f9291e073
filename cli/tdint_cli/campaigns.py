"""Campaigns on the command line: the directory, the progress, the files at the end, and the
messages."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdint.errors import AnalysisError, ModelError, RecordError, TdintError, UsageError
from tdint.files import check_outputs, is_there, protect_input, refuse_protected, write_files
from tdint.number_parsing import pluralize
from tdint.output import figures, tables
from tdint.units import OutputUnits
from tdint_cli import options
from tdint_cli.drawing import emit_table
from tdint_cli.maps import MapRequest, check_map, has_losses
from tdint_cli.options.spectra import SPECTRA, SPECTRA_MEAN, SPECTRA_PICTURE
from tdint_cli.options.suite import (
    PICTURE,
    PROFILES,
    RATIOS,
    SuiteRequest,
    check_limit_options,
    without_limits,
)
from tdint_cli.terminal import Failures, current, note, progress_bar, say, warn

if TYPE_CHECKING:
    from tdint.campaign.execute import Advance, Engine, Shard
    from tdint.campaign.plan import Plan
    from tdint.campaign.profiles import FloorSuite, Profile
    from tdint.campaign.store import Store
    from tdint.files import Content, Writer
    from tdint.output.tables.table import Table
    from tdint_cli.suite_limits import SuiteLimits


# ---- This part contains results over a suite: profiles.csv and its figure, the drift limit, and
# the comparison of buildings.

_NOT_KEPT = "peaks of stories are not stored; set `outputs: {profiles: true}` in the campaign file"


def set_looks(style: tuple[str, str], source: str, *, drawn: bool) -> None:
    """Apply the figure style of a campaign; settings of the command line have priority.

    Parameters
    ----------
    style : tuple of (str, str)
        The text of the style, and the directory for relative paths of a style sheet.
    source : str
        The campaign file, for error messages.
    drawn : bool
        Whether a figure is requested; the font and the style sheet are checked only in this case.

    Raises
    ------
    ModelError
        The style is invalid, or its font or style sheet is missing on this machine.
    """
    from tdint.output.printed import PRINTED, parse_style

    # Without a style of the campaign, only the style of the command line applies.
    text, folder = style
    if not text:
        return
    try:
        looks = parse_style(text, "style:")
        looks = PRINTED.get().over(
            replace(looks, style=looks.style and str(Path(folder, looks.style)))
        )
        if drawn:
            figures.style.check_print(looks)
    except UsageError as error:
        raise ModelError(f"{source}: {error}") from None
    # A style sheet is an input, which the command must not replace.
    if drawn and looks.style:
        protect_input(looks.style)
    PRINTED.set(looks)


_MOST_TOLD = 10  # maximum number of lines about buildings with collapsed or failed runs


@dataclass(frozen=True)
class Profiles:
    """Demands over the height of the buildings of a store, computed one time for the figures, the
    tables and the drift limit."""

    store: Store
    request: SuiteRequest

    @cached_property
    def units(self) -> OutputUnits:
        """Units of all files: the units of the command line, or the common units of the models."""
        return self.request.output_units or self.store.output_units()

    @cached_property
    def found(self) -> list[Profile]:
        """Profiles of each building and intensity level."""
        from tdint.campaign.profiles import profiles

        return list(profiles(self.store))

    def ratios(self, *, stories: bool) -> Table:
        """Return the table of ratios of the buildings to the baseline.

        Parameters
        ----------
        stories : bool
            True to include the ratios of each story; otherwise only the ratios of the maxima over
            the stories.

        Raises
        ------
        UsageError
            The baseline is not a building of the campaign.
        """
        from tdint.campaign.profiles import ratios

        self._need("--baseline")
        return tables.campaign.ratio_table(
            self.store, ratios(self.found, self.request.baseline or ""), stories=stories
        )

    def draw(self, file: Path) -> Content:
        """Return the figure of the profiles.

        Parameters
        ----------
        file : Path
            File of the figure. Its suffix selects the format.

        Raises
        ------
        AnalysisError
            The peaks of stories are not stored.
        """
        self._need("--plot")
        draw = partial(
            figures.suites.profile_picture,
            self.found,
            self.units,
            limit=self.limits.drift_line,
            title=self.store.meta("name"),
        )
        return figures.style.picture(file.suffix, draw)

    @cached_property
    def limits(self) -> SuiteLimits:
        """Comparison of the demands with the limits."""
        from tdint_cli.suite_limits import SuiteLimits

        return SuiteLimits(self.found, self.request.limit)

    def _need(self, option: str) -> None:
        if not self.found:
            raise AnalysisError(f"{option}: {_NOT_KEPT}")

    def report(self, plan: Plan, floors: Sequence[FloorSuite] = ()) -> bytes:
        """Return the report of the suite with the requested floor spectra. Units and head are
        those of the models if all models agree.

        Parameters
        ----------
        plan : Plan
            Buildings, motions and settings of the campaign.
        floors : sequence of FloorSuite
            Floor spectra of the suite; empty by default.
        """
        from tdint.output.page import Told, page_units
        from tdint.output.report import suite_page
        from tdint.output.summary import files_read

        request = self.request
        # A collapse is part of the verdict; failed runs are warnings.
        lost = [
            (profile.collapsed, text) for profile in self.found if (text := self._lost(profile))
        ]
        # Use the units and the head of the models if they agree.
        models = {profile.source: profile for profile in plan.models}.values()
        units, heads = (
            {profile.page_units for profile in models},
            {profile.page_head for profile in models},
        )
        shown = request.output_units or (units.pop() if len(units) == 1 else self.units)
        told = Told(
            warnings=[
                *(str(error) for error in plan.failures),
                *(text for collapsed, text in lost if not collapsed),
            ],
            head=request.report_head or (heads.pop() if len(heads) == 1 else ()),
            inputs=files_read(),
            verdict=[
                *((False, text) for collapsed, text in lost if collapsed),
                *self.limits.page_verdicts(page_units(shown)),
            ],
            limits=self.limits.table(page_units(shown)),
        )
        ratios = self.ratios(stories=False) if request.baseline is not None else None
        return suite_page(
            plan,
            self.store,
            self.found,
            told,
            limit=self.limits.drift_line,
            ratios=ratios,
            floors=floors,
            units=shown,
        )

    def _lost(self, profile: Profile) -> str:
        """Return a sentence about the motions that the means of a building exclude.

        The text is empty if no run collapsed or failed.

        Parameters
        ----------
        profile : Profile
            Results of one building under the suite at one intensity level.
        """
        lost = {"collapsed": profile.collapsed, "failed": profile.failed}
        told = " and ".join(f"{count} {kind}" for kind, count in lost.items() if count)
        if not told:
            return ""
        left = len(profile.motions)
        others = pluralize(left, "motion")
        means = f"the means are over the remaining {others}" if left else "no mean can be computed"
        name = self.limits.building(profile) or profile.building
        return f"{name}: of {pluralize(profile.runs, 'ground motion')}, {told}; {means}"

    def tell(self) -> list[TdintError]:
        """Report the motions that the means exclude, and compare the mean drifts with the limit.

        Both are reported only after all runs are done, because a mean over some of the motions
        could be mistaken for the mean over all motions.

        Returns
        -------
        list of TdintError
            With --require: an error if the limit is exceeded or cannot be checked yet.
        """
        limit, limited = self.request.limit, self.store.has_limits
        if self.request.require and limit is None and not limited:
            raise without_limits()
        named = (
            f"the drift limit of {100.0 * limit:g} % is"
            if isinstance(limit, float)
            else f"the limits of {limit} are"
            if limit
            else "the limits of the models are"
        )
        # Some of the motions are not sufficient for the check, because the building may exceed the
        # limit or collapse under the other motions.
        if left := unfinished(self.store):
            if limit is None and not self.request.require:
                note(
                    f"{left}; results over all ground motions (means, figures, reports) are "
                    "written when all runs are done"
                )
                return []
            text = f"{named} not checked: {left}"
            if self.request.require:
                return [AnalysisError(text)]
            warn(text)
            return []
        lost = [text for profile in self.found if (text := self._lost(profile))]
        if (more := len(lost) - _MOST_TOLD) > 0:
            lost[_MOST_TOLD:] = [
                f"{pluralize(more, 'more building')} or intensity levels with collapsed or "
                f"failed runs: see the columns collapsed and failed of {PROFILES}"
            ]
        # In a region, collapses of some buildings are a result, not a warning.
        (warn if more <= 0 else note)(*lost)
        if limit is None and not limited:
            return []
        # Limits of the models are checked if this is possible; a request must be fulfilled.
        if not self.found and limit is None and not self.request.require:
            note(f"the limits of the models are not checked: {_NOT_KEPT}")
            return []
        self._need("--limit" if limit is not None else "--require")
        unmet: list[str] = []
        for profile, verdict in self.limits.verdicts(self.units):
            say(self.limits.named(profile, verdict.text))
            if verdict.met is False:
                unmet.append(self.limits.building(profile) or profile.building)
        unmet = list(dict.fromkeys(unmet))
        # An unreadable record counts against the limit, because its motion was not run.
        for kind, reasons in self.store.unused().items():
            unmet += [f"{pluralize(len(reasons), kind)} could not be used"] if reasons else []
        if unmet and self.request.require:
            return [AnalysisError(f"{named} not met: {'; '.join(unmet)}")]
        return []


# ---- Campaigns

RUNS, STORIES, SHOCKS, SUMMARY = "runs.csv", "stories.csv", "shocks.csv", "summary.json"
DAMAGE, TYPES, LOSSES, EXCEEDANCE = "damage.csv", "damage-types.csv", "losses.csv", "exceedance.csv"
PARQUET = ("runs.parquet", "stories.parquet", "damage.parquet")
SIMCENTER, GEOJSON, DISTRICTS = "simcenter.csv", "buildings.geojson", "districts.geojson"
"""Names of the files that are written from a store; each file is written completely."""

MEASURES = "measures.csv"
"""Name of the table of the intensity measures of the runs, for `tdint fragility`."""

OF_FLOORS = (SPECTRA, SPECTRA_MEAN, SPECTRA_PICTURE)


def carry_out(
    plan: Plan,
    engine: Engine,
    request: SuiteRequest,
    *,
    shard: Shard | None = None,
    max_runs: int | None = None,
    show: bool = False,
) -> None:
    """Execute the remaining runs of a campaign and write all requested files.

    The output directory is the directory of -o. With --overwrite, another campaign in this
    directory and tables of other commands are replaced.

    Parameters
    ----------
    plan : Plan
        Buildings, motions and settings of the campaign.
    engine : Engine
        Executes the runs.
    request : SuiteRequest
        Common options of the command line.
    shard : Shard, optional
        Part of the campaign to execute. By default, the complete campaign.
    max_runs : int, optional
        Maximum number of runs of this call. By default, all remaining runs.
    show : bool
        Print the table of the runs to standard output, too. The default is False.

    Raises
    ------
    UsageError
        The directory contains another campaign.
    OutputError
        The directory cannot be written, contains tables of another command, or is in use by another
        process.
    Failures
        Some records could not be read, a building is too far from any site, or the drift limit is
        not met. Raised after all other work is done.
    """
    from tdint.campaign.profiles import check_baseline
    from tdint.campaign.store import FILE, open_store, remove, remove_store
    from tdint.campaign.store_schema import UntrustedStoreError, locked, refuse_network

    report_pairs(plan, request)
    check_limit_options(request.limit, request.require, plan.models)
    for option, asked in (
        ("--plot", request.plot),
        ("--baseline", request.baseline),
        ("--limit", request.limit),
        ("--require", request.require or None),
    ):
        if asked is not None and not plan.settings.keeps_stories:
            raise AnalysisError(f"{option}: {_NOT_KEPT}")
    if request.baseline is not None:
        check_baseline(request.baseline, (building.name for building in plan.buildings))
    folder, overwrite = Path(request.output or ""), request.overwrite
    refuse_network(folder)
    kept = None if shard is None else plan.buildings_of(shard.chunks(plan))
    with locked(folder):
        named = check_names(folder, request)
        refuse_foreign(folder, plan.settings.stories, plan.settings.profiles, overwrite=overwrite)
        try:
            store, remarks = open_store(folder, plan, kept)
        except (UntrustedStoreError, UsageError):
            if not overwrite:
                raise
            # Remove another campaign, or an unusable store, together with the tables that were
            # written from it.
            made = (
                RUNS,
                STORIES,
                SHOCKS,
                PROFILES,
                RATIOS,
                DAMAGE,
                TYPES,
                LOSSES,
                EXCEEDANCE,
                PICTURE,
                MEASURES,
            )
            names = (*made, *OF_FLOORS, *PARQUET, SIMCENTER, GEOJSON, DISTRICTS, SUMMARY)
            refuse_protected(folder / name for name in names)
            remove_store(folder / FILE)
            for name in names:
                remove(folder / name)
            store, remarks = open_store(folder, plan, kept)
        warn_of_plan(plan)
        note(*plan.notes, *remarks)
        with store:
            if not overwrite:
                store.refuse_foreign(named)
            advance = advance_with_bar(plan, store, engine, shard=shard, max_runs=max_runs)
            profiles = Profiles(store, request)
            finish(profiles, folder, plan)
            if show:
                emit_table(tables.campaign.runs_table(store).in_units(profiles.units))
            if request.baseline is not None and is_complete(store):
                emit_table(profiles.ratios(stories=False))
            # Report the number of runs, and the runs that the user must check.
            new = advance.done - advance.before
            if new:
                before = f", {advance.before} before" if advance.before else ""
                say(
                    f"{pluralize(new, 'run')} in {advance.seconds:.3g} s "
                    f"({_rate(advance)}){before}."
                )
            else:
                say(f"All runs ({advance.done}) were completed by an earlier call; nothing to do.")
            tell_outcomes(store)
            unmet = profiles.tell()
    # A building without a motion is omitted and reported in the same way as an unreadable record.
    far: list[TdintError] = []
    if too_far := plan.too_far_from_sites:
        many = (
            f"{pluralize(len(too_far), 'building')} skipped: farther from every site than "
            "max_distance of the records"
        )
        far = [RecordError(f"{many}, such as {too_far[0]}")]
    if plan.failures or unmet or far:
        raise Failures([*plan.failures, *far, *unmet])


def report_pairs(plan: Plan, request: SuiteRequest) -> None:
    """Report the default treatment of component pairs, unless the user has selected a treatment.

    Parameters
    ----------
    plan : Plan
        Buildings, motions and settings of the campaign.
    request : SuiteRequest
        Common options of the command line.

    Raises
    ------
    UsageError
        --pair-demand is specified, but the records contain no pairs.
    RecordError
        Two records are a pair by their names, but differ in sampling interval, length or event.
    """
    from tdint.campaign.pairs import PairRule, check_pairs

    rule = PairRule.of_motions(plan.motions, plan.pair_demand)
    check_pairs(plan.motions, rule)
    if request.pair_demand is not None and not rule.pairs:
        raise UsageError(
            f"--pair-demand {request.pair_demand}: the records contain no pairs of horizontal "
            "components; omit --pair-demand"
        )
    if plan.pair_demand is None and rule.pairs:
        note(rule.note())


def warn_of_plan(plan: Plan) -> None:
    """Warn of unusual values of the buildings first, then of assumptions on the motions.

    Parameters
    ----------
    plan : Plan
        Buildings, motions and settings of the campaign.
    """
    warn(*plan.warnings)
    warn(*options.record.warnings_of_suite([motion.record for motion in plan.motions]))


def check_names(folder: Path | None, request: SuiteRequest) -> list[Path]:
    """Return the additional output files of a call, such as the figure and the report.

    The check takes place before the runs. If the campaign has already begun, existing files pass
    this check; the store knows which files an earlier call has written.

    Parameters
    ----------
    folder : Path or None
        Output directory; None without -o.
    request : SuiteRequest
        Common options of the command line.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    from tdint.campaign.store import FILE

    replaced = request.overwrite or (folder is not None and is_there(folder / FILE))
    pages = [
        file
        for file in (request.picture(folder), Path(request.report) if request.report else None)
        if file
    ]
    asked_of = {RATIOS: request.baseline, MEASURES: request.im, SPECTRA: request.of_floors.floors}
    named = pages + ([folder / name for name, asked in asked_of.items() if asked] if folder else [])
    check_outputs(named, overwrite=replaced)
    return named


def unfinished(store: Store) -> str:
    """Return the number of finished runs as text, or an empty text if all runs are done.

    Parameters
    ----------
    store : Store
        Store of the campaign.
    """
    every, done = int(store.meta("runs")), sum(store.statuses().values())
    return f"{done} of {pluralize(every, 'run')} are done" if done < every else ""


def warn_unfinished(store: Store) -> None:
    """Warn that the following results use only the finished runs, unless all runs are done.

    Parameters
    ----------
    store : Store
        Store of the campaign.
    """
    if left := unfinished(store):
        warn(f"{store.name}: {left}; the following results use only these runs")


def is_complete(store: Store) -> bool:
    """Return True if all runs of a campaign are done.

    A mean over some of the motions could be mistaken for the mean over all motions.

    Parameters
    ----------
    store : Store
        Store of the campaign.
    """
    return not unfinished(store)


def refuse_foreign(folder: Path, stories: bool, profiles: bool, *, overwrite: bool) -> None:
    """Refuse existing tables in a directory without a campaign, because another command wrote them.

    Parameters
    ----------
    folder : Path
        Output directory.
    stories, profiles : bool
        True if the campaign writes stories.csv and profiles.csv, respectively.
    overwrite : bool
        Allow the replacement of existing tables.

    Raises
    ------
    OutputError
        A table exists and must not be replaced.
    """
    from tdint.campaign.store import FILE, foreign_file_error

    if not is_there(folder / FILE) and not overwrite:
        for name in (RUNS, *(STORIES,) * stories, *(PROFILES,) * profiles, SUMMARY):
            if is_there(folder / name):
                raise foreign_file_error(folder / name)


def advance_with_bar(
    plan: Plan,
    store: Store,
    engine: Engine,
    *,
    shard: Shard | None = None,
    max_runs: int | None = None,
) -> Advance:
    """Execute the remaining runs with a progress bar that shows the rate.

    Parameters
    ----------
    plan : Plan
        Buildings, motions and settings of the campaign.
    store : Store
        Store of the results.
    engine : Engine
        Executes the runs.
    shard : Shard, optional
        Part of the campaign to execute. By default, the complete campaign.
    max_runs : int, optional
        Maximum number of runs. By default, all remaining runs.
    """
    from tdint.campaign.execute import execute_plan

    with progress_bar(to_terminal=False) as progress:

        def tell(advance: Advance) -> None:
            progress(
                f"{advance.done}/{advance.runs} runs, {_rate(advance)}", advance.done / advance.runs
            )

        return execute_plan(plan, store, engine, shard=shard, max_runs=max_runs, on_chunk=tell)


def _rate(advance: Advance) -> str:
    return f"{3600.0 * advance.rate:.3g} per hour"


def finish(profiles: Profiles, folder: Path, plan: Plan | None = None) -> None:
    """Write the files of a store: the selected tables, the requested results over all motions, and
    summary.json; update the files that were exported from an earlier state of the store.

    Parameters
    ----------
    profiles : Profiles
        Store of the campaign, with the options of the command line.
    folder : Path
        Output directory.
    plan : Plan, optional
        Buildings, motions and settings of the campaign. Floor spectra, the report and intensity
        measures are written only with a plan.
    """
    from tdint.kernels.building.compilable import time_loops
    from tdint.output.summary import files_read

    optional = (*PARQUET, SIMCENTER, GEOJSON, DISTRICTS)
    ours = [name for name in optional if profiles.store.is_ours(folder / name)]
    again = _exports(profiles, ours)
    written = {name: writer for name, writer in again.items() if writer}
    contents = {**_of_suite(profiles, folder, plan), **written}
    made = {"arguments": current().arguments, "time_loops": time_loops()}
    _write(profiles, folder, contents, files_read(), made)
    for name, writer in again.items():
        if writer:
            note(f"{folder / name}: updated to the current state of the campaign")
        else:
            (folder / name).unlink(missing_ok=True)
            note(
                f"{folder / name}: removed, because it was outdated and this call cannot update "
                "it; run `tdint campaign export` to write it again"
            )


def _of_suite(profiles: Profiles, folder: Path, plan: Plan | None = None) -> dict[str, Content]:
    """Return the requested results over all motions, or no results until all runs are done.

    The results are the figure of the profiles and the ratios to the baseline. With a plan, they
    include the floor spectra, the report and the intensity measures of the runs.

    Parameters
    ----------
    profiles : Profiles
        Store of the campaign, with the options of the command line.
    folder : Path
        Output directory.
    plan : Plan, optional
        Buildings, motions and settings of the campaign.
    """
    request, store = profiles.request, profiles.store
    picture = request.picture(folder)
    # Means, figures and reports over some of the motions could be mistaken for complete results.
    if not is_complete(store):
        return {}
    contents: dict[str, Content] = (
        {str(picture.absolute()): profiles.draw(picture)} if picture else {}
    )
    if request.baseline is not None:
        contents[RATIOS] = profiles.ratios(stories=True).csv()
    if plan is None:
        return contents
    of_floors, floors = request.of_floors.of_suite(
        plan, store, request.jobs, profiles.units, plot=request.plot is not None
    )
    contents |= of_floors
    if request.report is not None:
        contents[str(Path(request.report).absolute())] = profiles.report(plan, floors)
    if request.im:
        from tdint.campaign.fragility.measures import measured, run_measure

        measures = [run_measure(name) for name in request.im]
        table = tables.campaign.measures_table(measures, measured(plan, store, measures))
        contents[MEASURES] = table.in_units(profiles.units).csv()
    return contents


def export(profiles: Profiles, folder: Path, *, simcenter: bool, maps: MapRequest) -> None:
    """Rewrite all tables of a store, and write Parquet files if pyarrow is installed.

    Parquet files and the SimCenter file use SI units.

    Parameters
    ----------
    profiles : Profiles
        Store and options of the command line.
    folder : Path
        Output directory.
    simcenter : bool
        Write the SimCenter file.
    maps : MapRequest
        Maps to write.

    Raises
    ------
    UsageError
        A map is requested, but the buildings have no coordinates, not all runs are done, an event
        or a column is unknown, or there are no losses for a map of districts.
    """
    from tdint.output.summary import files_read, merged_inputs, told_of

    store, by = profiles.store, profiles.request.by
    if maps.asked:
        check_map(store, maps, by, complete=is_complete(store))
    districts = maps.asked and by is not None
    asked = {SIMCENTER: simcenter, GEOJSON: maps.asked, DISTRICTS: districts}
    exported = {
        *PARQUET,
        *(name for name, is_asked in asked.items() if is_asked or store.is_ours(folder / name)),
    }
    writers = _exports(profiles, exported, maps)
    others = {name: writer for name, writer in writers.items() if writer}
    # A map of districts that this call does not write again would be of an earlier state.
    if DISTRICTS in exported and DISTRICTS not in others:
        (folder / DISTRICTS).unlink(missing_ok=True)
        note(
            f"{folder / DISTRICTS}: removed, because it was outdated; add --geojson --by COLUMN "
            "to write it again"
        )
    # The summary keeps the provenance of the runs that the last call of the campaign has recorded.
    before = told_of(folder / SUMMARY)
    made = {
        "arguments": before.get("arguments", []),
        "time_loops": before.get("time_loops"),
        "export": list(current().arguments),
    }
    _write(
        profiles,
        folder,
        {**_of_suite(profiles, folder), **others},
        merged_inputs(before.get("inputs", ()), files_read()),
        made,
    )


def _exports(
    profiles: Profiles, names: Collection[str], maps: MapRequest | None = None
) -> dict[str, Writer | None]:
    """Return the writer of each named optional file, or None if the file cannot be written here.

    Parameters
    ----------
    profiles : Profiles
        Store and options of the command line.
    names : collection of str
        Names of the files.
    maps : MapRequest, optional
        Options of maps; by default the maps contain all events, and districts have no polygons.
    """
    if not names:
        return {}
    from tdint.output.tables import exports
    from tdint.output.tables import maps as of_maps

    maps, by = maps or MapRequest(), profiles.request.by
    store, has_pyarrow = profiles.store, find_spec("pyarrow") is not None
    # Each entry states whether the file can be written here, and contains its writer.
    runs, stories, damage = PARQUET
    writers: dict[str, tuple[bool, Writer | None]] = {
        runs: (has_pyarrow, partial(exports.write_runs_parquet, store)),
        stories: (
            has_pyarrow and store.parameters()["stories"],
            partial(exports.write_stories_parquet, store),
        ),
        damage: (
            has_pyarrow and bool(store.damage()),
            partial(exports.write_damage_parquet, store),
        ),
        SIMCENTER: (True, partial(exports.write_simcenter, store)),
        GEOJSON: (
            is_complete(store) and of_maps.is_mapped(store),
            partial(of_maps.write_geojson, store, units=profiles.units, events=maps.events),
        ),
        DISTRICTS: (
            is_complete(store) and of_maps.is_mapped(store),
            maps.districts(store, by) if by is not None else None,
        ),
    }
    return {
        name: writer if can else None for name, (can, writer) in writers.items() if name in names
    }


def _write(
    profiles: Profiles,
    folder: Path,
    contents: Mapping[str, Content],
    read: Iterable[Mapping[str, str]],
    made: Mapping[str, Any],
) -> None:
    """Write the tables of a store, additional files and, last, the summary.

    Parameters
    ----------
    profiles : Profiles
        Store and options of the command line.
    folder : Path
        Output directory.
    contents : mapping
        Content of each additional file.
    read : iterable of mapping
        Input files that the summary lists.
    made : mapping
        Provenance for the summary: command lines of the runs and of the export, and the execution
        of the time loops.
    """
    from tdint.output.run_summary import LIMIT_MEANINGS
    from tdint.output.summary import campaign_summary, in_units, json_bytes, merged_inputs

    request, store, units = profiles.request, profiles.store, profiles.units
    # Write runs.csv, unless the campaign selects only other tables.
    files: dict[str, Content] = {}
    if store.is_requested("runs"):
        files[RUNS] = lambda stream: tables.campaign.write_runs(store, stream, units)
    files |= contents
    settings = store.parameters()
    if settings["stories"]:
        files[STORIES] = lambda stream: tables.campaign.write_stories(store, stream, units)
    if next(store.shocks(), None) is not None:
        files[SHOCKS] = lambda stream: tables.campaign.write_shocks(store, stream, units)
    if settings["profiles"] and is_complete(store):
        files[PROFILES] = lambda stream: tables.campaign.write_profiles(store, stream, units)
    files |= _damage(store, units, request.by)
    told = campaign_summary(store) | (profiles.limits.summary() if is_complete(store) else {})
    told["inputs"] = merged_inputs(told["inputs"], read)
    keys = {key: unit for key, (unit, _) in LIMIT_MEANINGS.items()}
    files[SUMMARY] = json_bytes({**in_units(told, units, keys), **made})
    here = {folder / name: content for name, content in files.items()}
    if not request.overwrite:
        store.refuse_foreign(here)
    write_files(here, overwrite=True, on_written=store.record_written)


def _damage(store: Store, units: OutputUnits, by: str | None) -> dict[str, Content]:
    """Return the damage tables if the campaign computes damage.

    Means over the motions are included only after all runs are done.

    Parameters
    ----------
    store : Store
        Store of the campaign.
    units : OutputUnits
        Units of the table of damage.
    by : str or None
        Column of the inventory. The tables of losses and of their exceedance have additional rows
        for the buildings with each value of this column.
    """
    if not store.damage():
        return {}
    from tdint.output.tables.damage_states import (
        write_damage,
        write_exceedance,
        write_losses,
        write_types,
    )

    writers: dict[str, Content] = {}
    if store.is_requested("damage"):
        writers[DAMAGE] = lambda stream: write_damage(store, stream, units)
    if is_complete(store) and store.is_requested("damage"):
        writers[TYPES] = lambda stream: write_types(store, stream)
    # Losses require a damage state with a loss ratio. Their exceedance rates also require rates of
    # the events.
    if has_losses(store) and is_complete(store) and store.is_requested("losses"):
        writers[LOSSES] = lambda stream: write_losses(store, stream, by)
        if store.rates():
            writers[EXCEEDANCE] = lambda stream: write_exceedance(store, stream, by)
    return writers


def tell_outcomes(store: Store) -> None:
    """Report the numbers of runs that failed, collapsed, were repeated, have no error estimate, or
    did not come to rest.

    Parameters
    ----------
    store : Store
        Store of the campaign.
    """
    from tdint.analysis.run.outcome import FAILED
    from tdint.model.damage_states import FALLEN
    from tdint.output.summary import without_error

    statuses = store.statuses()
    failed = {name: statuses[name] for name in FAILED if name in statuses}
    # Missing results require a warning. A collapse is a result and is reported as a plain line.
    if failed:
        listed = ", ".join(f"{count} {name}" for name, count in failed.items())
        warn(
            f"{pluralize(sum(failed.values()), 'run')} without a result ({listed}); the cells of "
            "these runs are empty"
        )
    fell = {name: statuses[name] for name in FALLEN if name in statuses}
    if fell:
        say(", ".join(f"{pluralize(count, 'run')} {name}" for name, count in fell.items()) + ".")
    if repeated := store.count("repeats > 0"):
        note(f"{pluralize(repeated, 'run')} repeated with smaller time steps (column dt_s)")
    if unknown := without_error(store):
        note(
            f"{pluralize(unknown, 'run')} without error estimates, because the second run failed "
            "or collapsed earlier; these cells are empty"
        )
    if moving := store.count("at_rest = 0"):
        warn(
            f"{pluralize(moving, 'run')} still in motion at the end of the analysis; the "
            "residual drifts of these runs are not final values"
        )
