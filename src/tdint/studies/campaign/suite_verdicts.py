"""Results of the comparison of suites with limits, as sentences."""

from __future__ import annotations

from collections.abc import Sequence

from tdint.model.limits import LimitCheck, by_level
from tdint.number_parsing import pluralize
from tdint.output.verdicts import Verdict, _demand, _is_drift_alone, _limit, _maximum, _sentence
from tdint.studies.campaign.story_profiles import Profile
from tdint.units import OutputUnits


def suite_verdicts(
    checks: Sequence[LimitCheck],
    profile: Profile,
    units: OutputUnits,
    matched: str,
) -> list[Verdict]:
    """Return the result of the comparison of a suite with its limits at a single intensity level.

    There is a result for each performance level.

    Parameters
    ----------
    matched : str
        Clause on matched ground motions (`matched_text`) and on scale factors; empty for recorded
        motions.
    """
    verdicts = []
    lost = profile.lost_reason and f", because {profile.lost_reason}"
    pair_text = f" Demand of pairs: {profile.pair_demand}." if profile.pair_demand else ""
    if matched:
        pair_text += f" {pluralize(profile.runs, 'ground motion')}, {matched}."
    for level, level_checks in by_level(checks).items():
        met = all(check.within for check in level_checks)
        has_single_limit = _is_drift_alone(level_checks)
        if has_single_limit:
            check = level_checks[0]
            text = (
                f"Mean drift {_demand(check, units, 3)} (story {check.story}), limit "
                f"{_limit(check, units)}: {'met' if met else 'exceeded'}{lost}; "
                f"{_maximum(check, units)}."
            )
        else:
            text = _sentence(level, level_checks, units, met=met, lost=lost, mean=True)
        verdicts.append(Verdict(met, text + pair_text, has_single_limit))
    return verdicts
