"""Execution of campaigns by commands: output directory, progress, written files and messages."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdint import studies
from tdint.errors import AnalysisError, ModelError, RecordError, TdintError, UsageError
from tdint.files import check_outputs, is_there, refuse_protected, write_files
from tdint.ground_motion.origin import MotionOrigin, matched_clause
from tdint.model.status import FALLEN
from tdint.number_parsing import number_text, pluralize
from tdint.output import figures
from tdint.output.page import PageText, page_units
from tdint.output.printed import PRINTED, parse_style
from tdint.output.run_summary import LIMIT_MEANINGS
from tdint.output.spectrum_text import spectrum_text
from tdint.output.summary import files_read, in_units, json_bytes, merged_inputs, stored_summary
from tdint.output.tables.table import Table
from tdint.response.runs.outcome import FAILED
from tdint.studies.campaign.campaign_summary import campaign_summary, without_error
from tdint.studies.campaign.execute import Advance, Engine, Shard, execute_plan
from tdint.studies.campaign.plan import Plan
from tdint.studies.campaign.reuse import reuse_results
from tdint.studies.campaign.story_profiles import (
    FloorSuite,
    Profile,
    floor_suites,
    profiles,
    run_floors,
)
from tdint.studies.campaign.variant_report import comparison_parts
from tdint.studies.campaign.variants import check_baseline, comparisons, ratios
from tdint.studies.fragility.building_damage import has_losses
from tdint.studies.fragility.damage_tables import check_column
from tdint.studies.fragility.measures import measured, run_measure
from tdint.studies.motions.pairs import PairRule, check_pairs
from tdint.studies.regions import maps as map_tables
from tdint.studies.store import schema
from tdint.studies.store.identity import Identity
from tdint.studies.store.opening import open_replacement, open_store, write_from_store
from tdint.studies.store.result_store import FILE, Store, foreign_file_error
from tdint.studies.store.schema import AnotherStudyError, UntrustedStoreError
from tdint.system import processors
from tdint.units import OutputUnits
from tdint_cli import options
from tdint_cli.demand_limits import check_limit_options, without_limits
from tdint_cli.drawing import emit_table
from tdint_cli.options.spectra import SPECTRA, SPECTRA_MEAN, SPECTRA_PICTURE
from tdint_cli.options.suite import PICTURE, PROFILES, RATIOS, SuiteRequest
from tdint_cli.studies.suite_limits import SuiteLimits
from tdint_cli.terminal import (
    Failures,
    current,
    is_debug,
    note,
    note_of_runs,
    progress_bar,
    say,
    warn,
)

if TYPE_CHECKING:
    from tdint.files import Content, Writer


# ---- This part contains results over a suite: profiles.csv and its figure, the drift limit, and
# the comparison of buildings.

# Several options require the peaks of all stories; their name precedes this message.
_NOT_STORED = (
    "peaks of stories are not stored; set `outputs: {profiles: true}` in the campaign file"
)


def apply_style(style: str, source: str) -> None:
    """Apply the figure style of a campaign; settings of the command line have priority.

    `style` is the text of the key `style` of the campaign, empty without a style. ModelError is
    raised if it is invalid.
    """
    if style:
        try:
            PRINTED.set(PRINTED.get().over(parse_style(style, "style:")))
        except UsageError as error:
            raise ModelError(f"{source}: {error}") from None


_MAX_LINES = 10  # maximum number of lines about buildings with collapsed or failed runs


@dataclass(frozen=True)
class Profiles:
    """Demands over the height of the buildings of a campaign, for figures, tables and drift limits.

    The demands are computed when they are first used.
    """

    store: Store
    request: SuiteRequest

    @cached_property
    def units(self) -> OutputUnits:
        """Units of all files: the units of the command line, or the common units of the models."""
        return self.request.output_units or self.store.output_units()

    @cached_property
    def by(self) -> str | None:
        """Column of the inventory by which losses are grouped: of the command line, or of the last
        call with the option --by."""
        if self.request.by is not None and self.store.damage():
            check_column(self.store, self.request.by)
            self.store.group_by(self.request.by)
        return self.request.by or self.store.grouped_by()

    @cached_property
    def profiles(self) -> list[Profile]:
        """Profiles of each building and intensity level."""
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
        self._require_profiles("--baseline")
        return studies.campaign_tables.ratio_table(
            self.store, ratios(self.profiles, self.request.baseline or ""), stories=stories
        )

    def emit_runs(self) -> None:
        """Write the table of the runs to standard output."""
        table = Table.of(*studies.campaign_tables.run_table(self.store))
        emit_table(table.in_units(self.units))

    def draw(self, file: Path) -> Content:
        """Return the figure of the demands over the height of the buildings.

        Parameters
        ----------
        file : Path
            File of the figure. Its suffix selects the format.

        Raises
        ------
        AnalysisError
            The peaks of stories are not stored.
        """
        self._require_profiles("--plot")
        draw = partial(
            studies.suite_figures.profile_picture,
            self.profiles,
            self.units,
            limit=self.limits.drift_line,
            title=self.store.meta("name"),
        )
        return figures.style.picture(file.suffix, draw)

    @cached_property
    def limits(self) -> SuiteLimits:
        """Comparison of the demands with the limits."""
        origins = [MotionOrigin.of(entry["origin"]) for entry in self.store.origins().values()]
        records = self.store.connection.execute("SELECT count(*) FROM records").fetchone()[0]
        clauses = (matched_clause(origins, records, spectrum_text), self._scaling_clause())
        return SuiteLimits(self.profiles, self.request.limit, ", ".join(filter(None, clauses)))

    def _scaling_clause(self) -> str:
        """Return a clause on the scale factors from a file, for example `scaled to ec8:... (rule
        record, factors 0.42 to 4.7)`; empty without such a file."""
        scaling = self.store.scaling()
        if not scaling:
            return ""
        lists = self.store.parameters()["factors"].values()
        factors = [factor for values in lists for factor in values]
        low, high = (number_text(factor, 3) for factor in (min(factors), max(factors)))
        range_text = f"factor {low}" if low == high else f"factors {low} to {high}"
        if "target" in scaling:
            target = f" to {spectrum_text(scaling['target'])}"
        elif "measure" in scaling:
            value = f"{scaling['value']:.4g} {scaling.get('unit', '')}".rstrip()
            target = f" to {scaling['measure']} = {value}"
        else:
            target = f" by {scaling['file']}"
        rule = f"rule {scaling['rule']}, " if "rule" in scaling else ""
        return f"scaled{target} ({rule}{range_text})"

    def _require_profiles(self, option: str) -> None:
        """Raise AnalysisError, with the option that needs them, if no demands are stored."""
        if not self.profiles:
            raise AnalysisError(f"{option}: {_NOT_STORED}")

    def report(self, plan: Plan, floors: Sequence[FloorSuite] = ()) -> bytes:
        """Return the report of the suite as HTML.

        The options of the command line determine units and head of the report. By default, they are
        the units and the head of the models if these are equal in all models.
        """
        from tdint.studies.campaign.suite_report import suite_page

        request = self.request
        # A collapse is a result and belongs to the verdict; failed runs are warnings. The table of
        # several buildings contains their collapses.
        lost_motions = []
        has_variants = len({profile.building for profile in self.profiles}) > 1
        for profile in self.profiles:
            if text := self._lost_motions_text(profile):
                lost_motions.append((profile.collapsed > 0, text))
        # Use the units and the head of the models if they agree.
        models = {model.source: model for model in plan.models}.values()
        units = {model.page_units for model in models}
        heads = {model.page_head for model in models}
        shown_units = request.output_units or (units.pop() if len(units) == 1 else self.units)
        sentences, answer = comparison_parts(
            plan, self.store, self.profiles, request.baseline, page_units(shown_units)
        )
        page_text = PageText(
            answer=answer,
            warnings=[
                *(str(error) for error in plan.failures),
                *(text for collapsed, text in lost_motions if not collapsed),
            ],
            head=request.report_head or (heads.pop() if len(heads) == 1 else ()),
            verdict=[
                *((None, text) for text in sentences),
                *(
                    (False, text)
                    for collapsed, text in lost_motions
                    if collapsed and not has_variants
                ),
                *self.limits.page_verdicts(page_units(shown_units)),
            ],
            limits=self.limits.table(page_units(shown_units)),
        )
        ratios = self.ratios(stories=False) if request.baseline is not None else None
        return suite_page(
            plan,
            self.store,
            self.profiles,
            page_text,
            limit=self.limits.drift_line,
            ratios=ratios,
            floors=floors,
            units=shown_units,
        )

    def _lost_motions_text(self, profile: Profile) -> str:
        """Return a sentence about the collapsed and failed runs, which the means exclude.

        The text is empty if no run collapsed or failed.

        `profile` contains the results of one building under the suite at a single intensity level.
        """
        counts_text = profile.lost_text
        if not counts_text:
            return ""
        if remaining := len(profile.motions):
            means = f"the means are over the remaining {pluralize(remaining, 'motion')}"
        else:
            means = "no mean can be computed"
        name = self.limits.building(profile) or profile.building
        return f"{name}: of {pluralize(profile.runs, 'ground motion')}, {counts_text}; {means}"

    def report_results(self) -> list[TdintError]:
        """Report collapsed and failed runs, and compare the mean demands with the limits.

        Means over the motions exclude collapsed and failed runs. Results are reported only
        after all runs are completed, because a mean over some of the motions could be mistaken for
        the mean over all motions.

        Returns
        -------
        list of TdintError
            With --require: an error if the limit is exceeded or cannot be checked yet. Otherwise
            the list is empty.

        Raises
        ------
        UsageError
            --require has no limit.
        AnalysisError
            The peaks of the stories, which --limit or --require needs, are not stored.
        """
        limit, models_have_limits = self.request.limit, self.store.has_limits
        if self.request.require and limit is None and not models_have_limits:
            raise without_limits()
        limit_is = (
            f"the drift limit of {100.0 * limit:g} % is"
            if isinstance(limit, float)
            else f"the limits of {limit} are"
            if limit
            else "the limits of the models are"
        )
        # The limit cannot be checked before all runs are completed, because the building may exceed
        # it or collapse under the remaining motions.
        if progress := unfinished(self.store):
            if limit is None and not self.request.require:
                note(
                    f"{progress}; results over all ground motions (means, figures, reports) are "
                    "written when all runs are done"
                )
                return []
            text = f"{limit_is} not checked: {progress}"
            if self.request.require:
                return [AnalysisError(text)]
            warn(text)
            return []

        lines = [text for profile in self.profiles if (text := self._lost_motions_text(profile))]
        if self.request.baseline is not None:
            lines = [text for level in comparisons(self.profiles) if (text := level.note)] or lines
        # A campaign with the buildings of a region can have collapses in many buildings, which are
        # results of the study. Then only the first lines are shown, as notes and not as warnings.
        omitted = len(lines) - _MAX_LINES
        if omitted > 0:
            lines[_MAX_LINES:] = [
                f"{pluralize(omitted, 'more building')} or intensity levels with collapsed or "
                f"failed runs: see the columns collapsed and failed of {PROFILES}"
            ]
            note(*lines)
        else:
            warn(*lines)
        if limit is None and not models_have_limits:
            return []
        # Limits of the models are not checked if their data are missing. Without the data for
        # --limit or --require, the command fails.
        if not self.profiles and limit is None and not self.request.require:
            note(f"the limits of the models are not checked: {_NOT_STORED}")
            return []
        self._require_profiles("--limit" if limit is not None else "--require")
        unmet: list[str] = []
        for profile, verdict in self.limits.verdicts(self.units):
            say(self.limits.named(profile, verdict.text))
            # `met` is not True and not False for a sentence about isolators without a limit.
            # `limits.building` returns an empty name if there is only a single profile.
            if verdict.met is False:
                unmet.append(self.limits.building(profile) or profile.building)
        unmet = list(dict.fromkeys(unmet))
        # An unreadable record counts against the limit, because its motion was not run.
        for input_kind, reasons in self.store.unused().items():
            if reasons:
                unmet.append(f"{pluralize(len(reasons), input_kind)} could not be used")
        if unmet and self.request.require:
            return [AnalysisError(f"{limit_is} not met: {'; '.join(unmet)}")]
        return []


# ---- Campaigns

RUNS, STORIES = "runs.csv", "stories.csv"
SUMMARY = "summary.json"
DAMAGE, TYPES, LOSSES, EXCEEDANCE = "damage.csv", "damage-types.csv", "losses.csv", "exceedance.csv"
PARQUET = ("runs.parquet", "stories.parquet", "damage.parquet", "losses.parquet")
SIMCENTER, GEOJSON, DISTRICTS = "simcenter.csv", "buildings.geojson", "districts.geojson"
"""Names of the files that are written from a store; each file is written completely."""

MEASURES = "measures.csv"
"""Name of the table of the intensity measures of the runs, for `tdint fragility`."""

_WRITTEN_FILES = (
    *(RUNS, *schema.PART_TABLES, PROFILES, RATIOS, DAMAGE, TYPES, LOSSES, EXCEEDANCE, PICTURE),
    *(MEASURES, SPECTRA, SPECTRA_MEAN, SPECTRA_PICTURE, *PARQUET, SIMCENTER, GEOJSON, DISTRICTS),
    SUMMARY,
)
"""Names of all files that a campaign can write; a campaign that replaces another one removes
them."""


def execute_campaign(
    plan: Plan,
    engine: Engine,
    request: SuiteRequest,
    *,
    shard: Shard | None = None,
    max_runs: int | None = None,
    show: bool = False,
) -> None:
    """Execute the remaining runs of a campaign, or of a shard, and write all requested files.

    The output directory is the directory of -o. With --overwrite, another campaign in this
    directory and tables of other commands are replaced. `max_runs` limits the runs of the call.
    With `show`, the table of the runs is also printed to standard output.

    Raises
    ------
    OutputError
        The directory contains another campaign or tables of another command, cannot be written,
        or is in use by another process.
    Failures
        Some records could not be read, a building is too far from any site, or the drift limit is
        not met. Raised after all other work is completed.
    """
    report_pairs(plan, request)
    _check_result_options(plan, request)
    folder, overwrite = Path(request.output or ""), request.overwrite
    schema.refuse_network(folder)
    shard_buildings = None if shard is None else plan.buildings_of(shard.chunks(plan))
    with schema.locked(folder):
        extra_files = check_names(folder, request)
        # Refuse tables of other commands in a directory that contains no campaign.
        refuse_foreign(folder, plan.settings.stories, plan.settings.profiles, overwrite=overwrite)
        reuse_note = ""
        if request.changed:
            reuse_note = reuse_results(folder, plan)
        store, store_notes = _open_store(
            folder, plan, shard_buildings, replaces=overwrite or request.changed
        )
        warn_of_plan(plan)
        note_of_runs(*plan.notes, *store_notes, *filter(None, [reuse_note]))
        with store:
            # Refuse files with the names of results that were not written from this store.
            if not overwrite:
                store.refuse_foreign(extra_files)
            advance = advance_with_bar(plan, store, engine, shard=shard, max_runs=max_runs)
            profiles = Profiles(store, request)
            finish(profiles, folder, plan)  # write all tables, figures and the summary
            if show:
                profiles.emit_runs()
            unmet_limits = _report(profiles, advance)
    _raise_failures(plan, unmet_limits)


def execute_in_memory(plan: Plan, engine: Engine, request: SuiteRequest) -> None:
    """Execute a campaign without -o: print the table of the runs, and write the figure and the
    report.

    Failures is raised as by `execute_campaign`.
    """
    report_pairs(plan, request)
    _check_result_options(plan, request)
    store, _ = open_store(None, plan)
    warn_of_plan(plan)
    note_of_runs(*plan.notes)
    with store:
        profiles = Profiles(store, request)
        advance = advance_with_bar(plan, store, engine)
        profiles.emit_runs()
        contents = _suite_contents(profiles, None, plan)
        write_files(
            {Path(file): content for file, content in contents.items()},
            overwrite=request.overwrite,
        )
        unmet_limits = _report(profiles, advance)
    _raise_failures(plan, unmet_limits)


def _report(profiles: Profiles, advance: Advance) -> list[TdintError]:
    """Print the results of a call, and return the errors of `Profiles.report_results`.

    The first line is the number of runs that the call has completed, with --debug their duration
    and rate, and the number of runs of earlier calls.
    """
    store = profiles.store
    if profiles.request.baseline is not None and is_complete(store):
        emit_table(profiles.ratios(stories=False))
    new_runs = advance.done - advance.before
    if new_runs:
        before = f", {advance.before} before" if advance.before else ""
        duration = f" in {advance.seconds:.3g} s ({_rate(advance)})" if is_debug() else ""
        say(f"{pluralize(new_runs, 'run')}{duration}{before}.")
    else:
        say(f"All runs ({advance.done}) were completed by an earlier call; nothing to do.")
    report_outcomes(store)
    return profiles.report_results()


def _raise_failures(plan: Plan, unmet_limits: Sequence[TdintError]) -> None:
    """Raise Failures if inputs of a campaign could not be used, or limits are not met."""
    # A building without a motion is omitted and reported in the same way as an unreadable record.
    without_motion: list[TdintError] = []
    if too_far := plan.too_far_from_sites:
        text = (
            f"{pluralize(len(too_far), 'building')} skipped: farther from every site than "
            f"max_distance of the records, such as {too_far[0]}"
        )
        without_motion = [RecordError(text)]
    if plan.failures or unmet_limits or without_motion:
        raise Failures([*plan.failures, *without_motion, *unmet_limits])


def _check_result_options(plan: Plan, request: SuiteRequest) -> None:
    """Check the options for limits, figures and ratios before any run.

    UsageError is raised if --limit or --require cannot be applied, or the baseline is not a
    building of the campaign; AnalysisError, if an option requires the peaks of all stories, which
    the campaign does not store.
    """
    check_limit_options(request.limit, request.require, plan.models)
    needs_stories = {
        "--plot": request.plot is not None,
        "--baseline": request.baseline is not None,
        "--limit": request.limit is not None,
        "--require": request.require,
    }
    for option, is_requested in needs_stories.items():
        if is_requested and not plan.settings.keeps_stories:
            raise AnalysisError(f"{option}: {_NOT_STORED}")
    if request.baseline is not None:
        check_baseline(request.baseline, (building.name for building in plan.buildings))


def _open_store(
    folder: Path, plan: Plan, buildings: Sequence[int] | None, *, replaces: bool
) -> tuple[Store, list[str]]:
    """Open the store of a campaign (for a shard, of some buildings), or create it, and return it
    with notes for the user.

    With `replaces`, the store of another campaign, or a store that cannot be used, remains with
    its tables until the new campaign is complete. Otherwise another campaign is an
    AnotherStudyError.
    """
    try:
        return open_store(folder, plan, buildings)
    except (UntrustedStoreError, AnotherStudyError):
        if not replaces:
            raise
        refuse_protected(folder / name for name in (*_WRITTEN_FILES, FILE))
        return open_replacement(folder / FILE, Identity.of(plan, buildings))


def report_pairs(plan: Plan, request: SuiteRequest) -> None:
    """Report the pairs of components and their treatment.

    Raises
    ------
    UsageError
        --pair-demand is specified, but the records contain no pairs.
    RecordError
        Two records are a pair by their names, but differ in sampling interval, length or event.
    """
    rule = PairRule.from_motions(plan.motions, plan.pair_demand)
    check_pairs(plan.motions, rule)
    if request.pair_demand is not None and not rule.pairs:
        raise UsageError(
            f"--pair-demand {request.pair_demand}: the records contain no pairs of horizontal "
            "components; omit --pair-demand"
        )
    if rule.pairs:
        files = [motion.name for motion in plan.motions]
        note(rule.note(files, is_default=plan.pair_demand is None))


def warn_of_plan(plan: Plan) -> None:
    """Warn of unusual values of the buildings first, then of assumptions on the motions."""
    warn(*plan.warnings)
    warn(*options.record.warnings_of_suite([motion.record for motion in plan.motions]))


def check_names(folder: Path | None, request: SuiteRequest) -> list[Path]:
    """Check that the additional output files of a call can be written, and return their paths.

    These are files such as the figure and the report. The check is made before the runs. If the
    directory contains a campaign, existing files are accepted here, because the store will check
    later whether an earlier call has written them.

    Parameters
    ----------
    folder : Path | None
        Output directory; None without -o.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    may_replace = request.overwrite or (folder is not None and is_there(folder / FILE))
    page_files = [
        file
        for file in (request.picture(folder), Path(request.report) if request.report else None)
        if file
    ]
    options_of_files = {
        RATIOS: request.baseline,
        MEASURES: request.im,
        SPECTRA: request.floor_request.floors,
    }
    files = page_files + (
        [folder / name for name, option in options_of_files.items() if option] if folder else []
    )
    check_outputs(files, overwrite=may_replace)
    return files


def unfinished(store: Store) -> str:
    """Return the number of finished runs as text, or an empty text if all runs are done."""
    run_count, done = int(store.meta("runs")), sum(store.statuses().values())
    return f"{done} of {pluralize(run_count, 'run')} are done" if done < run_count else ""


def warn_unfinished(store: Store) -> None:
    """Warn that the following results use only the finished runs, unless all runs are done."""
    if progress := unfinished(store):
        warn(f"{store.name}: {progress}; the following results use only these runs")


def is_complete(store: Store) -> bool:
    """Return True if all runs of a campaign are done.

    A mean over some of the motions could be mistaken for the mean over all motions.
    """
    return not unfinished(store)


def refuse_foreign(folder: Path, stories: bool, profiles: bool, *, overwrite: bool) -> None:
    """Refuse existing tables in a directory without a campaign, because another command wrote them.

    Parameters
    ----------
    stories, profiles : bool
        True if the campaign writes stories.csv and profiles.csv, respectively.

    Raises
    ------
    OutputError
        A table exists and must not be replaced.
    """
    if not is_there(folder / FILE) and not overwrite:
        # A tuple multiplied by False is empty.
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
    shard : Shard, optional
        Part of the campaign to execute. By default, the complete campaign.
    max_runs : int, optional
        Maximum number of runs. By default, all remaining runs.
    """
    with progress_bar(to_terminal=False) as progress:

        def show_progress(advance: Advance) -> None:
            """Show the numbers of completed and of all runs, and the rate."""
            progress(
                f"{advance.done}/{advance.runs} runs, {_rate(advance)}", advance.done / advance.runs
            )

        return execute_plan(
            plan, store, engine, shard=shard, max_runs=max_runs, on_chunk=show_progress
        )


def _rate(advance: Advance) -> str:
    """Return the number of runs per hour as text."""
    return f"{3600.0 * advance.rate:.3g} per hour"


def finish(profiles: Profiles, folder: Path, plan: Plan | None = None) -> None:
    """Write the files of a campaign from its store, and update earlier exports.

    The files are the tables that the campaign selects, the requested results over all motions, and
    summary.json. Files that `tdint campaign export` wrote from an earlier state of the store are
    written again, or removed if this is not possible.

    Parameters
    ----------
    plan : Plan, optional
        Buildings, motions and settings of the campaign. Floor spectra, the report and intensity
        measures are written only with a plan.
    """
    is_replacement = Path(profiles.store.name) != folder / FILE
    if is_replacement and not is_complete(profiles.store):
        note(
            f"{folder}: the earlier campaign remains until all runs of the new one are done; "
            "continue with --overwrite"
        )
        return
    # Update only exports that an earlier call has written to this directory.
    optional = (*PARQUET, SIMCENTER, GEOJSON, DISTRICTS)
    existing_exports = [name for name in optional if profiles.store.is_ours(folder / name)]
    export_writers = _exports(profiles, existing_exports)
    provenance = {**options.output.command_line(), "time_loops": profiles.store.time_loops()}
    inputs = files_read()
    _write(profiles, folder, plan, export_writers, inputs=inputs, provenance=provenance)
    for name, writer in export_writers.items():
        if writer:
            note(f"{folder / name}: updated to the current state of the campaign")
        else:
            (folder / name).unlink(missing_ok=True)
            note(
                f"{folder / name}: removed, because it was outdated and this call cannot update "
                "it; run `tdint campaign export` to write it again"
            )


def _suite_contents(
    profiles: Profiles, folder: Path | None, plan: Plan | None = None
) -> dict[str, Content]:
    """Return the name and the content of each requested file with results over all motions: the
    figure of the profiles and the ratios to the baseline; with a plan, the floor spectra, the
    report and the intensity measures of the runs. The dictionary is empty until all runs are
    completed.
    """
    request, store = profiles.request, profiles.store
    picture = request.picture(folder)
    # These files are written only after all runs are completed, because results over some of the
    # motions could be mistaken for results over all motions.
    if not is_complete(store):
        return {}
    contents: dict[str, Content] = (
        {str(picture.absolute()): profiles.draw(picture)} if picture else {}
    )
    if request.baseline is not None:
        contents[RATIOS] = profiles.ratios(stories=True).csv()
    if plan is None:
        return contents
    suites = _add_floor_spectra(contents, profiles, plan)
    if request.report is not None:
        contents[str(Path(request.report).absolute())] = profiles.report(plan, suites)
    if request.im:
        measures = [run_measure(name) for name in request.im]
        columns = studies.campaign_tables.measure_columns(measures)
        table = Table.of(columns, measured(plan, store, measures))
        contents[MEASURES] = table.in_units(profiles.units).csv()
    return contents


def _add_floor_spectra(
    contents: dict[str, Content], profiles: Profiles, plan: Plan
) -> list[FloorSuite]:
    """Add the files of the floor spectra to the contents by their names, and return the spectra
    under the suite; empty if no floor is requested. UsageError is raised if a building has no such
    floor."""
    request, store, units = profiles.request, profiles.store, profiles.units
    wanted, tables = request.floor_request, studies.campaign_tables
    if not wanted.floors:
        return []
    # A store contains no response histories, so the runs are repeated for the floor motions.
    oscillators = wanted.chosen_periods(), wanted.floor_damping
    floors = run_floors(plan, store, wanted.floors, *oscillators, request.jobs or processors())
    suites = list(floor_suites(store, floors))
    contents[SPECTRA] = tables.run_floor_table(store, floors).in_units(units).csv()
    contents[SPECTRA_MEAN] = tables.floor_suite_table(store, suites).in_units(units).csv()
    if request.plot is not None and suites:
        periods = store.first_periods()  # marked by the figure
        draw = partial(studies.suite_figures.floor_suite_picture, suites, units, periods)
        contents[SPECTRA_PICTURE] = figures.style.picture(".png", draw)
    return suites


def write_exports(profiles: Profiles, folder: Path, *, simcenter: bool) -> None:
    """Write all tables of a campaign again from its store (`tdint campaign export`).

    Parquet files are written also if pyarrow is installed. They and the SimCenter file use SI
    units.

    Raises
    ------
    UsageError
        A map is requested, but the buildings have no coordinates, not all runs are completed, an
        event or a column is unknown, or there are no losses for a map of districts.
    """
    store, by, has_map = profiles.store, profiles.by, profiles.request.geojson
    if has_map:
        map_tables.check_map(store, profiles.request.event or (), by, complete=is_complete(store))
    optional = {SIMCENTER: simcenter, GEOJSON: has_map, DISTRICTS: has_map and by is not None}
    # Files that an earlier call has written are updated also, because outdated files could be
    # mistaken for the current state.
    exported = {*PARQUET}
    for name, is_requested in optional.items():
        if is_requested or store.is_ours(folder / name):
            exported.add(name)
    writers = _exports(profiles, exported)
    # A map of districts that this call does not write again would show an earlier state of the
    # campaign, so that it is removed.
    if DISTRICTS in exported and not writers[DISTRICTS]:
        (folder / DISTRICTS).unlink(missing_ok=True)
        note(
            f"{folder / DISTRICTS}: removed, because it was outdated; add --geojson --by COLUMN "
            "to write it again"
        )
    # The summary keeps the provenance of the runs that the last call of the campaign has recorded.
    last_summary = stored_summary(folder / SUMMARY)
    provenance: dict[str, Any] = {
        **{key: last_summary[key] for key in ("arguments", "command") if key in last_summary},
        "time_loops": store.time_loops(),
        "export": list(current().arguments),
    }
    inputs = merged_inputs(last_summary.get("inputs", ()), files_read())
    _write(profiles, folder, None, writers, inputs=inputs, provenance=provenance)


def _exports(profiles: Profiles, names: Collection[str]) -> dict[str, Writer | None]:
    """Return the writer of each named optional file; None if this call cannot write the file."""
    if not names:
        return {}
    from tdint.studies.campaign import exports

    tables, damages = studies.campaign_tables, studies.damage_tables
    by, events = profiles.by, profiles.request.event or ()
    store, has_pyarrow = profiles.store, find_spec("pyarrow") is not None
    write_parquet = partial(exports.write_parquet, store)
    can_map = is_complete(store) and map_tables.is_mapped(store)
    districts: Writer | None = None
    if by is not None and DISTRICTS in names:
        file = profiles.request.polygons
        polygons = None if file is None else map_tables.read_polygons(store, file, by)
        features = map_tables.district_features(store, by, polygons, events)
        districts = partial(map_tables.write_geojson, features)
    buildings = map_tables.building_features(store, profiles.units, events)
    # Each entry contains True if this call can write the file, and the function that writes it.
    runs, stories, damage, losses = PARQUET
    writers: dict[str, tuple[bool, Writer | None]] = {
        runs: (
            has_pyarrow,
            lambda stream: write_parquet(tables.run_table(store), stream, has_inventory=True),
        ),
        stories: (
            has_pyarrow and store.parameters()["stories"],
            lambda stream: write_parquet(tables.part_table(store, schema.STORIES), stream),
        ),
        damage: (
            has_pyarrow and bool(store.damage()),
            lambda stream: write_parquet(damages.damage_table(store), stream, has_inventory=True),
        ),
        losses: (
            has_pyarrow and has_losses(store) and is_complete(store),
            lambda stream: write_parquet(damages.loss_table(store, by), stream),
        ),
        SIMCENTER: (True, partial(exports.write_simcenter, store)),
        GEOJSON: (can_map, partial(map_tables.write_geojson, buildings)),
        DISTRICTS: (can_map, districts),
    }
    return {
        name: writer if can_write else None
        for name, (can_write, writer) in writers.items()
        if name in names
    }


def _write(
    profiles: Profiles,
    folder: Path,
    plan: Plan | None,
    exports: Mapping[str, Writer | None],
    *,
    inputs: Iterable[Mapping[str, str]],
    provenance: Mapping[str, Any],
) -> None:
    """Write the tables of a store, additional files and, last, the summary.

    `provenance` is the provenance for the summary: command lines of the runs and of the export, and
    the execution of the time loops.
    """
    request, store, units = profiles.request, profiles.store, profiles.units
    tables = studies.campaign_tables
    # Write runs.csv, unless the campaign selects only other tables.
    files: dict[str, Content] = {}
    if store.is_requested("runs"):
        files[RUNS] = lambda stream: tables.run_table(store).write(stream, units)
    files |= _suite_contents(profiles, folder, plan)
    files |= {name: writer for name, writer in exports.items() if writer}
    settings = store.parameters()
    for name, table in schema.PART_TABLES.items():
        # Rows of stories are also stored for profiles.csv. Elements, attachments, links and events
        # have rows only if the buildings or the motions have them.
        is_written = settings["stories"] if name == STORIES else any(store.parts(table))
        if is_written:
            files[name] = partial(tables.part_table(store, table).write, units=units)
    if settings["profiles"] and is_complete(store):
        files[PROFILES] = tables.profiles_table(store, units).write
    files |= _damage(store, units, profiles.by)
    summary = campaign_summary(store) | (profiles.limits.summary() if is_complete(store) else {})
    summary["inputs"] = merged_inputs(summary["inputs"], inputs)
    unit_of_key = {key: unit for key, (unit, _) in LIMIT_MEANINGS.items()}
    files[SUMMARY] = json_bytes({**in_units(summary, units, unit_of_key), **provenance})
    contents_of_paths = {folder / name: content for name, content in files.items()}
    if not request.overwrite:
        store.refuse_foreign(contents_of_paths)
    stale = {folder / name: "" for name in _WRITTEN_FILES}
    write_from_store(store, contents_of_paths, folder / FILE, stale)


def _damage(store: Store, units: OutputUnits, by: str | None) -> dict[str, Content]:
    """Return the damage tables as file name and writer; empty if the campaign computes no damage.

    The tables of building types, of losses and of their exceedance contain means over the motions.
    They are included only after all runs are completed. Losses and their exceedance have additional
    rows for each value of the column `by` of the inventory.
    """
    if not store.damage():
        return {}

    tables = studies.damage_tables
    writers: dict[str, Content] = {}
    if store.is_requested("damage"):
        writers[DAMAGE] = lambda stream: tables.damage_table(store).write(stream, units)
    if is_complete(store) and store.is_requested("damage"):
        writers[TYPES] = tables.type_table(store).write
    # Losses require a damage state with a loss ratio. Their exceedance rates also require rates of
    # the events.
    if has_losses(store) and is_complete(store) and store.is_requested("losses"):
        writers[LOSSES] = tables.loss_table(store, by).write
        if store.rates():
            writers[EXCEEDANCE] = tables.exceedance_table(store, by).write
    return writers


def report_outcomes(store: Store) -> None:
    """Report the numbers of runs that failed, collapsed, were repeated, have no error estimate, or
    did not come to rest.
    """
    statuses = store.statuses()
    failed = {name: statuses[name] for name in FAILED if name in statuses}
    # Missing results require a warning. A collapse is a result and is reported as a plain line.
    if failed:
        listed = ", ".join(f"{count} {name}" for name, count in failed.items())
        warn(
            f"{pluralize(sum(failed.values()), 'run')} without a result ({listed}); the cells of "
            "these runs are empty"
        )
    collapsed = {name: statuses[name] for name in FALLEN if name in statuses}
    if collapsed:
        listed = ", ".join(f"{pluralize(count, 'run')} {name}" for name, count in collapsed.items())
        say(f"{listed}.")
    if repeated := store.count("repeats > 0"):
        note(f"{pluralize(repeated, 'run')} repeated with smaller time steps (column dt_s)")
    if without_estimate := without_error(store):
        note(
            f"{pluralize(without_estimate, 'run')} without error estimates, because the additional "
            "run for the estimate failed, or collapsed before the end of the run; the cells of "
            "these errors are empty"
        )
    if moving := store.count("at_rest = 0"):
        warn(
            f"{pluralize(moving, 'run')} still in motion at the end of the analysis; the "
            "residual drifts of these runs are not final values; omit them from evaluations "
            f"(at_rest = 0 in {FILE})"
        )
