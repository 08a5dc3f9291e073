"""Limits of suites on the command line: results of the comparison for the terminal, the report and
summary.json."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from tdint.model.limits import LimitCheck, chosen_limits, uniform_drift_limit
from tdint.number_parsing import abbreviate, pluralize
from tdint.output.run_summary import LIMIT_MEANINGS
from tdint.output.tables.table import Table
from tdint.output.verdicts import (
    Verdict,
    has_isolator_limit,
    isolator_sentence,
    limit_table,
    limit_verdicts,
    limits_summary,
)
from tdint.studies.campaign.story_profiles import Profile
from tdint.studies.campaign.variants import at_levels
from tdint.units import OutputUnits
from tdint_cli.demand_limits import outcome_text


@dataclass(frozen=True)
class SuiteLimits:
    """Comparison of the demands of a suite with limits, computed one time for all outputs.

    Attributes
    ----------
    limit : float, str or None
        Drift limit or performance level of the command line; None for the limits of the models.
    matched : str
        Clause on matched ground motions (`tdint.ground_motion.origin.matched_clause`) and on scale
        factors.
    """

    profiles: list[Profile]
    limit: float | str | None
    matched: str = ""

    @cached_property
    def checks(self) -> list[tuple[Profile, Sequence[LimitCheck]]]:
        """Comparisons of each profile with the limits of the command line or of its model."""
        return [(profile, profile.limit_checks(self.limit)) for profile in self.profiles]

    def is_limited(self, profile: Profile) -> bool:
        """Return True if limits apply to a building."""
        return self.limit is not None or bool(profile.limits)

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
            lost = profile.lost_reason and f", because {profile.lost_reason}"
            addition = f" Demand of pairs: {profile.pair_demand}." if profile.pair_demand else ""
            if self.matched:
                addition += f" {pluralize(profile.runs, 'ground motion')}, {self.matched}."
            verdicts = limit_verdicts(checks, units, mean=True, lost=lost, addition=addition)
            # Without a completed run there are no demands: the limit counts as exceeded.
            if not profile.motions:
                limit = self.limit
                limit_text = f", limit {100.0 * limit:g} %" if isinstance(limit, float) else ""
                verdicts = [
                    Verdict(
                        False,
                        f"None of {profile.runs} ground motions was completed{limit_text}: "
                        "exceeded",
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
        limit = self.limit
        if isinstance(limit, float):
            return limit
        return uniform_drift_limit(
            chosen
            for profile in self.profiles
            if profile.limits
            for chosen in chosen_limits(
                profile.limits, limit, profile.peaks["peak_drift_ratio"], profile.building
            )
        )

    def table(self, units: OutputUnits) -> Table | None:
        """Return the comparisons with the limits as a table of the report; None without limits."""
        listed = {self.building(profile): checks for profile, checks in self.checks if checks}
        reasons = {self.building(profile): profile.lost_reason for profile in self.profiles}
        return limit_table(listed, units, mean=True, reasons=reasons) if listed else None

    def summary(self) -> dict[str, Any]:
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
        if len({profile.building for profile in self.profiles}) > 1:
            yield from self._common_verdict(units)
            return
        for profile, verdict in self.verdicts(units):
            outcome = outcome_text(bool(verdict.met)) if verdict.single_limit else ""
            yield verdict.met, outcome + self.named(profile, verdict.text)
        for profile in self.profiles:
            text = isolator_sentence(profile.isolator_check, units, mean=True)
            if text and not self.is_limited(profile):
                yield None, self.named(profile, text)

    def _common_verdict(self, units: OutputUnits) -> Iterator[tuple[bool, str]]:
        """Yield the sentence on the buildings that meet their limits and that do not."""
        outcomes: dict[str, bool] = {}
        for profile, verdict in self.verdicts(units):
            if verdict.met is not None:
                name = self.building(profile)
                outcomes[name] = outcomes.get(name, True) and verdict.met
        lists = [
            f"{text} {abbreviate([name for name, met in outcomes.items() if met is wanted], 8)}"
            for text, wanted in (("met by", True), ("exceeded by", False))
            if wanted in outcomes.values()
        ]
        if lists:
            yield all(outcomes.values()), f"Limits {'; '.join(lists)}."

    def building(self, profile: Profile) -> str:
        """Return the name of a profile, which is empty if there is only a single profile."""
        several = len({other.building for other in self.profiles}) > 1
        level = profile.level_text if len(at_levels(self.profiles)) > 1 else ""
        return ", ".join(filter(None, [profile.building if several else "", level]))

    def named(self, profile: Profile, text: str) -> str:
        """Return a sentence that begins with the name of the profile, if the name is not empty."""
        name = self.building(profile)
        return f"{name}: {text[0].lower()}{text[1:]}" if name else text
