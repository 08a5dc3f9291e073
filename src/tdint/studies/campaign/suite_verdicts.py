"""Results of the comparison of suites with limits, as sentences."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from tdint.model.limits import LimitCheck, by_level
from tdint.number_parsing import pluralize
from tdint.units import OutputUnits

if TYPE_CHECKING:
    from tdint.studies.campaign.story_profiles import Profile
from tdint.output.verdicts import Verdict, _demand, _is_drift_alone, _limit, _maximum, _sentence


class LostMotions(NamedTuple):
    """Number of ground motions that the means of a suite exclude.

    Attributes
    ----------
    lost : int
        Number of motions with collapse or without a result.
    motions : int
        Number of all motions.
    """

    lost: int
    motions: int

    @classmethod
    def of(cls, profile: Profile) -> LostMotions:
        """Return the numbers of motions of a building at an intensity level."""
        return cls(profile.lost, profile.runs)

    @property
    def reason(self) -> str:
        """Reason why no limit is met; empty if all runs are completed without collapse."""
        if not self.lost:
            return ""
        return f"{self.lost} of {pluralize(self.motions, 'motion')} collapsed or failed"

    @property
    def text(self) -> str:
        """Clause for the end of a result; empty if all runs are completed without collapse."""
        return self.reason and f", because {self.reason}"


def suite_verdicts(
    checks: Sequence[LimitCheck],
    lost: LostMotions,
    pair_demand: str,
    units: OutputUnits,
    matched: str = "",
) -> list[Verdict]:
    """Return the result of the comparison of a suite with its limits at a single intensity level.

    There is a result for each performance level.

    Parameters
    ----------
    pair_demand : str
        Rule that combines the components of pairs; empty without pairs.
    matched : str
        Clause on matched ground motions (`matched_text`) and on scale factors; empty for recorded
        motions.
    """
    verdicts = []
    pair_text = f" Demand of pairs: {pair_demand}." if pair_demand else ""
    if matched:
        pair_text += f" {pluralize(lost.motions, 'ground motion')}, {matched}."
    for level, level_checks in by_level(checks).items():
        met = all(check.within for check in level_checks)
        has_single_limit = _is_drift_alone(level_checks)
        if has_single_limit:
            check = level_checks[0]
            text = (
                f"Mean drift {_demand(check, units, 3)} (story {check.story}), limit "
                f"{_limit(check, units)}: {'met' if met else 'exceeded'}{lost.text}; "
                f"{_maximum(check, units)}."
            )
        else:
            text = _sentence(level, level_checks, units, met=met, lost=lost.text, mean=True)
        verdicts.append(Verdict(met, text + pair_text, has_single_limit))
    return verdicts
