"""Limits of suites on the command line: the options --limit and --require, and the results of the
comparison for the terminal, the report and summary.json."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import click

from tdint.errors import UsageError
from tdint_cli import options
from tdint_cli.options.grammar import Ratio

if TYPE_CHECKING:
    from tdint.campaign.profiles import Profile
    from tdint.model.definition import Model
    from tdint.model.limits import LimitCheck
    from tdint.output.tables.table import Table
    from tdint.units import OutputUnits


class _DriftLimit(Ratio):
    """A drift ratio below 1, or the name of a performance level of the model. An integer is refused
    with a message for old scripts in which `--limit` of a campaign was the number of runs."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        # Names of levels start with a letter; nan and inf are numbers.
        if isinstance(value, str) and value[:1].isalpha() and value.lower() not in _NOT_LEVELS:
            return value
        if isinstance(value, str) and value.isdecimal() and ctx and ctx.command.name == "campaign":
            self.fail(
                f"it is the drift limit, such as 2%; the number of runs is --max-runs {value}",
                param,
                ctx,
            )
        return super().convert(value, param, ctx)


_NOT_LEVELS = ("nan", "inf", "infinity")

LIMIT = options.analysis.option(
    type=_DriftLimit(0.0, 1.0, min_open=True, max_open=True),
    metavar="2%",
    help="Drift limit: check that the mean over the ground motions of the maximum drift ratio does "
    "not exceed it in any story; the figure shows it as a line. It is used instead of the `limits` "
    "of the model; the name of a performance level selects its limits.",
)
"""The option --limit."""


REQUIRE = options.analysis.option(
    is_flag=True,
    help="Exit with code 5 if --limit or a limit of the model is exceeded, a run is missing, or a "
    "run collapsed.",
)
"""The option --require, which requires --limit or `limits` in the model."""


def check_limit_options(limit: float | str | None, require: bool, models: Sequence[Model]) -> None:
    """Check that there is a limit for --require, and that the models have the requested level.

    Raises
    ------
    UsageError
        No limit is specified, or a model does not have the performance level.
    """
    from tdint.model.limits import check_level

    if require and limit is None and not any(model.limits for model in models):
        raise without_limits()
    if isinstance(limit, str):
        for model in models:
            check_level(model.limits, limit, model.name)
        if not models:
            raise UsageError(
                f"--limit {limit}: buildings of an inventory have no performance levels; "
                "give a drift limit, such as 2%"
            )


def without_limits() -> UsageError:
    """Return the error for --require without a limit."""
    return UsageError(
        "--require has no effect without --limit or `limits` in the model; add --limit 2%, or omit "
        "--require"
    )


@dataclass(frozen=True)
class SuiteLimits:
    """Comparison of the demands of a suite with limits, computed one time for all outputs.

    Attributes
    ----------
    profiles : list of Profile
        Demands of each building and intensity level.
    limit : float, str or None
        Drift limit or performance level of the command line; None for the limits of the models.
    """

    profiles: list[Profile]
    limit: float | str | None

    @cached_property
    def checks(self) -> list[tuple[Profile, Sequence[LimitCheck]]]:
        """Comparisons of each profile with the limits of the command line or of its model."""
        return [(profile, profile.limit_checks(self.limit)) for profile in self.profiles]

    def is_limited(self, profile: Profile) -> bool:
        """Return True if limits apply to a building."""
        return self.limit is not None or bool(profile.limits)

    def verdicts(self, units: OutputUnits) -> Iterator[tuple[Profile, bool, str]]:
        """Yield each profile with the results of its comparisons, in units of a report or of the
        terminal. Results that are not met have the value False."""
        from tdint.output.verdicts import (
            LostMotions,
            Verdict,
            has_isolator_limit,
            isolator_sentence,
            suite_verdicts,
        )

        for profile, checks in self.checks:
            if not self.is_limited(profile):
                continue
            lost = LostMotions(profile.collapsed + profile.failed, profile.runs)
            found = suite_verdicts(checks, lost, profile.pair_demand, units)
            if not profile.motions:
                limit = self.limit
                shown = f", limit {100.0 * limit:g} %" if isinstance(limit, float) else ""
                found = [
                    Verdict(False, f"No motion of {profile.runs} came to its end{shown}: beyond")
                ]
            for met, text in found:
                yield profile, met, text
            # The displacement of isolators is a result that a drift limit does not cover.
            if not has_isolator_limit(checks) and (
                text := isolator_sentence(profile.isolator_check, units, mean=True)
            ):
                yield profile, True, text

    @property
    def drift_line(self) -> float | None:
        """Drift limit of the figure: the limit that all stories of all buildings have."""
        from tdint.model.limits import chosen_limits, uniform_drift_limit

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
        """Return the comparisons with several limits as a table of the report, or None."""
        from tdint.output.verdicts import limit_table

        listed = {
            profile_name(profile, self.profiles): checks
            for profile, checks in self.checks
            if checks
        }
        return limit_table(listed, units, mean=True) if _several(listed.values()) else None

    def summary(self) -> dict[str, Any]:
        """Return the comparisons for summary.json; empty without limits."""
        from tdint.output.verdicts import LIMIT_MEANINGS, limits_summary

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
        """Yield the headlines of a report: results with limits; isolators without limits."""
        from tdint.output.verdicts import isolator_sentence

        for profile, met, text in self.verdicts(units):
            told = self.named(profile, text)
            if text.startswith(_PLAIN):
                told = kept_words(met) + told
            yield (None if text.startswith(_ISOLATOR) else met), told
        for profile in self.profiles:
            text = isolator_sentence(profile.isolator_check, units, mean=True)
            if text and not self.is_limited(profile):
                yield None, self.named(profile, text)

    def named(self, profile: Profile, text: str) -> str:
        """Return a sentence with the building and the level, if they are needed."""
        name = profile_name(profile, self.profiles)
        return f"{name}: {text[0].lower()}{text[1:]}" if name else text


_PLAIN, _ISOLATOR = ("Mean drift", "No motion"), "Mean isolator"
"""First words of sentences on a drift limit alone, and of a sentence without a limit."""


def _several(checks: Iterable[Sequence[LimitCheck]]) -> bool:
    """Return True if a building has more than one limit; a single one is in the verdict."""
    return any(len(of_building) > 1 for of_building in checks)


def kept_words(kept: bool) -> str:
    """Return the first words of the result of the drift check."""
    return f"Limit {'kept' if kept else 'NOT kept'}. "


def profile_name(profile: Profile, among: list[Profile]) -> str:
    """Return the building and the level, if they are needed to identify the profile."""
    parts = [profile.building] if len({other.building for other in among}) > 1 else []
    levels = {(repr(other.scale), repr(other.level)) for other in among}
    if len(levels) > 1:
        parts.append(profile.level_text)
    return ", ".join(parts)
