"""Results of a campaign over its ground motions on the command line: tables, figures, the report,
and the comparison with limits for the terminal and summary.json."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from tdint import studies
from tdint.errors import AnalysisError, TdintError
from tdint.files import Content
from tdint.ground_motion.origin import MotionOrigin, matched_clause
from tdint.model.limits import LimitCheck, chosen_limits, uniform_drift_limit
from tdint.number_parsing import abbreviate, number_text, pluralize, quoted_names
from tdint.output import figures
from tdint.output.page import PageText, page_units
from tdint.output.run_summary import LIMIT_MEANINGS
from tdint.output.spectrum_text import spectrum_text, target_text
from tdint.output.tables.table import Table
from tdint.output.verdicts import (
    Verdict,
    has_isolator_limit,
    isolator_sentence,
    limit_table,
    limit_verdicts,
    limits_summary,
)
from tdint.studies.campaign.plan import Plan, different_periods
from tdint.studies.campaign.story_profiles import (
    FloorSuite,
    Profile,
    SuiteLevel,
    SuiteRules,
    profiles,
    ratios,
)
from tdint.studies.fragility.damage_tables import check_column
from tdint.studies.store.result_store import Store
from tdint.units import OutputUnits
from tdint_cli.demand_limits import outcome_text, without_limits
from tdint_cli.drawing import emit_table
from tdint_cli.options.suite import PROFILES, SuiteRequest
from tdint_cli.terminal import note, say, warn

# Several options require the peaks of all stories; their name precedes this message.
NOT_STORED = "peaks of stories are not stored; set `outputs: {profiles: true}` in the campaign file"


_MAX_LINES = 10  # maximum number of lines about buildings with collapsed or failed runs


@dataclass(frozen=True)
class SuiteResults:
    """Results of a campaign over its ground motions, for figures, tables, the report and limits.

    The demands over the height of the buildings are computed when they are first used.
    """

    store: Store
    request: SuiteRequest

    @cached_property
    def units(self) -> OutputUnits:
        """Units of all files: the units of the command line, or the common units of the models."""
        return self.request.output_units or self.store.output_units()

    @cached_property
    def by(self) -> str | None:
        """Column of the inventory that groups the losses: of the command line, or of the last
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
        periods = self.store.first_periods(), self.store.parameters().get("period")
        found = ratios(self.profiles, self.request.baseline or "", different_periods(*periods))
        return studies.campaign_tables.ratio_table(self.store, found, stories=stories)

    def emit_runs(self) -> None:
        """Write the table of the runs to standard output."""
        emit_table(Table.of(*studies.campaign_tables.run_table(self.store)).in_units(self.units))

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
            limit=self.drift_line,
            title=self.store.meta("name"),
        )
        return figures.style.picture(file.suffix, draw)

    @cached_property
    def checks(self) -> list[tuple[Profile, Sequence[LimitCheck]]]:
        """Comparisons of each profile with the limits of the command line or of its model; empty
        without limits, so that the profiles of thousands of buildings are not in memory."""
        if self.request.limit is None and not self.store.has_limits:
            return []
        return [
            (profile, profile.limit_checks(self.request.limit, accepted=self._accepted))
            for profile in self.profiles
        ]

    @cached_property
    def _accepted(self) -> int:
        """Number of unacceptable responses that the risk category accepts (ASCE 7-16, 16.4.1.1)."""
        category = self.request.risk_category
        return int(bool(category) and category in ("I", "II") and not self._is_matched)

    @cached_property
    def _is_matched(self) -> bool:
        """True if a ground motion was matched to a spectrum."""
        origins = (MotionOrigin.of(entry["origin"]) for entry in self.store.origins().values())
        return any(origin.target for origin in origins)

    def _lost_reason(self, profile: Profile) -> str:
        """Return the reason why no limit is met, or how an unacceptable response is accepted; empty
        if all runs are completed without collapse."""
        reason = profile.lost_text
        if not reason or not self.request.risk_category:
            return reason
        if profile.counts.lost <= self._accepted:
            return (
                f"{reason}: this demand is the larger of 1.2 times the median over all motions, "
                "the unacceptable one being the largest, and the mean over the others (ASCE 7-16, "
                "16.4.1.1)"
            )
        why = ", and none if motions are matched to a spectrum" if self._is_matched else ""
        return (
            f"{reason}, and ASCE 7-16, 16.4.1.1, accepts one in the risk categories I and II{why}"
        )

    @cached_property
    def _motions_clause(self) -> str:
        """Clause on matched ground motions (`tdint.ground_motion.origin.matched_clause`) and on
        scale factors."""
        origins = [MotionOrigin.of(entry["origin"]) for entry in self.store.origins().values()]
        records = self.store.value("SELECT count(*) FROM records")
        clauses = (matched_clause(origins, records, spectrum_text), self._scaling_clause())
        return ", ".join(filter(None, clauses))

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
        text = target_text(scaling)
        target = f" to {text}" if text else f" by {scaling['file']}"
        rule = f"rule {scaling['rule']}, " if "rule" in scaling else ""
        return f"scaled{target} ({rule}{range_text})"

    def _require_profiles(self, option: str) -> None:
        """Raise AnalysisError, with the option that needs them, if no demands are stored."""
        if not self.store.has_stories:
            raise AnalysisError(f"{option}: {NOT_STORED}")

    def report(self, plan: Plan, floors: Sequence[FloorSuite] = ()) -> bytes:
        """Return the report of the suite as HTML.

        The options of the command line determine units and head of the report. By default, they are
        the units and the head of the models if these are equal in all models.
        """
        from tdint.studies.campaign.comparison import comparison_parts, pooled
        from tdint.studies.campaign.suite_report import suite_page

        request = self.request
        # A collapse is a result and belongs to the verdict; failed runs are warnings. The table of
        # several buildings contains their collapses.
        has_variants, _ = self._several
        lost_motions = [
            (profile.counts.collapsed > 0, text)
            for profile in self.profiles
            if (text := self._lost_motions_text(profile))
        ]
        # Use the units and the head of the models if they agree.
        models = {model.source: model for model in plan.models}.values()
        units = {model.page_units for model in models}
        heads = {model.page_head for model in models}
        shown_units = request.output_units or (units.pop() if len(units) == 1 else self.units)
        shown_profiles = pooled(plan, self.profiles)
        sentences, answer = comparison_parts(
            plan, self.store, shown_profiles, request.baseline, page_units(shown_units)
        )
        has_models = len({profile.building for profile in self.profiles}) > 1 and not any(
            building.label for building in plan.buildings
        )
        if has_models and request.baseline is None and not plan.own_periods:
            note("--baseline NAME compares the buildings with one of them; without it, none is")
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
                *self.page_verdicts(page_units(shown_units)),
            ],
            limits=self.limit_rows(page_units(shown_units)),
        )
        ratios = self.ratios(stories=False) if request.baseline is not None else None
        return suite_page(
            plan,
            self.store,
            shown_profiles,
            page_text,
            limit=self.drift_line,
            ratios=ratios,
            floors=floors,
            units=shown_units,
            baseline=request.baseline,
        )

    def _lost_motions_text(self, level: SuiteLevel) -> str:
        """Return a sentence about the collapsed and failed runs of a building at an intensity
        level, which the means exclude; empty without such runs."""
        if not level.lost_text:
            return ""
        if remaining := level.counts.completed:
            means = f"the means are over the remaining {pluralize(remaining, 'motion')}"
        else:
            means = "no mean can be computed"
        return f"{self.building(level) or level.building}: {level.lost_text}; {means}"

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

        rules, buildings = SuiteRules.of(self.store), self.store.buildings()
        lines = [
            text
            for number, (building, _) in (buildings.items() if self.store.has_stories else ())
            for level in rules.levels_of(self.store, number, building)
            if (text := self._lost_motions_text(level))
        ]
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
            if clause := self._motions_clause:
                say(f"Ground motions {clause}.")
            return []
        # Limits of the models are not checked if their data are missing. Without the data for
        # --limit or --require, the command fails.
        if not self.store.has_stories and limit is None and not self.request.require:
            note(f"the limits of the models are not checked: {NOT_STORED}")
            return []
        self._require_profiles("--limit" if limit is not None else "--require")
        unmet: list[str] = []
        for profile, verdict in self.verdicts(self.units):
            say(self.named(profile, verdict.text))
            # `met` is not True and not False for a sentence about isolators without a limit.
            # `building` returns an empty name if there is only a single profile.
            if verdict.met is False:
                unmet.append(self.building(profile) or profile.building)
        unmet = list(dict.fromkeys(unmet))
        # An unreadable record counts against the limit, because its motion was not run.
        for input_kind, reasons in self.store.unused().items():
            if reasons:
                unmet.append(f"{pluralize(len(reasons), input_kind)} could not be used")
        if unmet and self.request.require:
            return [AnalysisError(f"{limit_is} not met: {'; '.join(unmet)}")]
        return []

    def is_limited(self, profile: Profile) -> bool:
        """Return True if limits apply to a building."""
        return self.request.limit is not None or bool(profile.limits)

    def verdicts(self, units: OutputUnits) -> Iterator[tuple[Profile, Verdict]]:
        """Yield each profile (a building at an intensity level) with the result of each limit.

        Profiles without limits are omitted. The displacement of isolators follows as a result
        without a limit, unless it has a limit.

        Parameters
        ----------
        units : OutputUnits
            Units of the values in the sentences of the results.
        """
        for profile, checks in self.checks:
            if not self.is_limited(profile):
                continue
            lost = self._lost_reason(profile)
            lost = lost and f" ({lost})"
            addition = f" Demand of pairs: {profile.pair_demand}." if profile.pair_demand else ""
            if clause := self._motions_clause:
                addition += f" {pluralize(profile.counts.motions, 'ground motion')}, {clause}."
            verdicts = limit_verdicts(checks, units, mean=True, lost=lost, addition=addition)
            # Without a completed run there are no demands: the limit counts as exceeded.
            if not profile.counts.completed:
                limit = self.request.limit
                limit_text = f", limit {100.0 * limit:g} %" if isinstance(limit, float) else ""
                verdicts = [
                    Verdict(
                        False,
                        f"No mean demand ({profile.lost_text}){limit_text}: exceeded",
                        single_limit=True,
                    )
                ]
            for verdict in verdicts:
                yield profile, verdict
            # The displacement of isolators is a result that a drift limit does not cover.
            if not has_isolator_limit(checks) and (
                text := isolator_sentence(profile.isolator_check, units, mean=True)
            ):
                yield profile, Verdict(None, text)

    @property
    def drift_line(self) -> float | None:
        """Limit of the drift ratio in the figure; `None` for a figure without a limit.

        A requested number (`limit`) has priority. Otherwise it is the limit of the buildings, if
        all stories with a limit have the same value. The figure has no limit if the buildings have
        no limits, or different limits.
        """
        limit = self.request.limit
        if isinstance(limit, float):
            return limit
        return uniform_drift_limit(
            chosen
            for profile in self.profiles
            if profile.limits
            for chosen in chosen_limits(
                profile.limits, limit, profile.completed.peaks["peak_drift_ratio"], profile.building
            )
        )

    def limit_rows(self, units: OutputUnits) -> Table | None:
        """Return the comparisons with the limits as a table of the report; None without limits."""
        listed = {self.building(profile): checks for profile, checks in self.checks if checks}
        reasons = {self.building(profile): profile.counts.text for profile in self.profiles}
        return limit_table(listed, units, mean=True, reasons=reasons) if listed else None

    def limit_summary(self) -> dict[str, Any]:
        """Return the comparisons for summary.json; empty without limits.

        The key `limits` is a list with an entry for each building, intensity level and limit;
        `meanings` contains the meaning and the unit of each key of the entries.
        """
        if not self.checks:
            return {}
        entries = [
            {
                "building": profile.building,
                **({"intensity": profile.level_text} if profile.level_text else {}),
                **entry,
            }
            for profile, checks in self.checks
            for entry in limits_summary(checks, mean=True)
        ]
        keys = dict.fromkeys(key for entry in entries for key in entry if key in LIMIT_MEANINGS)
        meanings = {
            key: {"meaning": LIMIT_MEANINGS[key][1], "unit": LIMIT_MEANINGS[key][0]} for key in keys
        }
        return {"limits": entries, "meanings": meanings}

    def page_verdicts(self, units: OutputUnits) -> Iterator[tuple[bool | None, str]]:
        """Yield the headlines of a report: results of the limits, then isolators without limits.

        Each item contains True if the limit is met, False if it is exceeded; None for a result
        without a limit; and the sentence, with values in `units`. For several buildings, one
        sentence lists the buildings; the table of limits contains the values.
        """
        if self._several[0]:
            outcomes: dict[str, bool] = {}
            for profile, verdict in self.verdicts(units):
                if verdict.met is not None:
                    (name,) = quoted_names([self.building(profile)])
                    outcomes[name] = outcomes.get(name, True) and verdict.met
            lists = [
                f"{text} {abbreviate([name for name, met in outcomes.items() if met is wanted], 8)}"
                for text, wanted in (("met by", True), ("exceeded by", False))
                if wanted in outcomes.values()
            ]
            if lists:
                yield all(outcomes.values()), f"Limits {'; '.join(lists)}."
            return
        for profile, verdict in self.verdicts(units):
            outcome = outcome_text(bool(verdict.met)) if verdict.single_limit else ""
            yield verdict.met, outcome + self.named(profile, verdict.text)
        for profile in self.profiles:
            text = isolator_sentence(profile.isolator_check, units, mean=True)
            if text and not self.is_limited(profile):
                yield None, self.named(profile, text)

    def building(self, level: SuiteLevel) -> str:
        """Return the name of a building at a level, without the part that all have in common."""
        several_buildings, several_levels = self._several
        parts = level.building * several_buildings, level.level_text * several_levels
        return ", ".join(filter(None, parts))

    @cached_property
    def _several(self) -> tuple[bool, bool]:
        """True if the campaign has several buildings; True if it has several levels."""
        query = "SELECT count(DISTINCT building), count(DISTINCT level) FROM run_rows"
        buildings, levels = self.store.connection.execute(query).fetchone()
        return buildings > 1, levels > 1

    def named(self, profile: Profile, text: str) -> str:
        """Return a sentence that begins with the name of the profile, if the name is not empty."""
        name = self.building(profile)
        return f"{name}: {text[0].lower()}{text[1:]}" if name else text


def unfinished(store: Store) -> str:
    """Return the number of finished runs as text, or an empty text if all runs are done."""
    run_count, done = int(store.meta("runs")), sum(store.statuses().values())
    return f"{done} of {pluralize(run_count, 'run')} are done" if done < run_count else ""
