"""Results of the comparison with limits: sentences, the table of a report and entries of
summary.json."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from tdint.model.limits import DRIFT_RATIO, ISOLATOR, QUANTITIES, LimitCheck, by_level
from tdint.number_parsing import DIGITS, number_text, pluralize
from tdint.output.tables.table import TEXT, Cell, Table
from tdint.units import OutputUnits, suffix


class Verdict(NamedTuple):
    """Result of a comparison with limits.

    Attributes
    ----------
    met : bool | None
        True if all limits of a performance level are met. None for a demand without a limit.
    single_limit : bool
        True if only the drift has a limit. The sentence then starts with the drift, so that a
        report can write the result ("Limit met.") before the sentence.
    """

    met: bool | None
    text: str
    single_limit: bool = False


def limit_verdicts(
    checks: Sequence[LimitCheck], units: OutputUnits, *, mean: bool, lost: str, addition: str
) -> list[Verdict]:
    """Return the result of the comparison of a run, or of the means over a suite, with its limits.

    There is a result for each performance level.

    Parameters
    ----------
    mean : bool
        True for the means over a suite at a single intensity level.
    lost : str
        Clause on a collapse, or on collapsed or failed runs, which meet no limit; may be empty.
    addition : str
        Sentences about the ground motions, which follow each result; may be empty.
    """
    verdicts = []
    for level, level_checks in by_level(checks).items():
        met = all(check.within for check in level_checks)
        result, governing = "met" if met else "exceeded", level_checks[0]
        # A single drift limit without a performance level, such as of `--limit`
        has_single_limit = (
            len(level_checks) == 1 and governing.quantity == DRIFT_RATIO and not level
        )
        if has_single_limit:
            text = (
                f"{_capital(governing.statistic) + ' drift' if mean else 'Maximum drift ratio'} "
                f"{_text(governing, governing.demand, units, 3)} ({_place(governing, mean)}), "
                f"limit {_limit(governing, units)}: {result}{lost}"
            )
            text += f"; {_maximum(governing, units)}." if mean else "."
        else:
            # If a collapse is the reason, no demand governs.
            is_collapse = bool(lost) and not any(check.ratio > 1.0 for check in level_checks)
            governs = len(level_checks) > 1 and not is_collapse
            clauses = []
            for check in level_checks:
                quantity = QUANTITIES[check.quantity]
                clause = f"{check.statistic} {quantity.text}" if mean else quantity.text
                clause += f" {_text(check, check.demand, units)}"
                if not math.isnan(check.demand):
                    clause += f" ({_place(check, mean)})"
                    clause += " governs:" if check is governing and governs else ","
                    clause += f" {number_text(check.ratio, unlike=1.0)} times"
                    clause += f" the limit of {_limit(check, units)}"
                if mean and check is governing:
                    clause += f", {_maximum(check, units)}"
                clauses.append(clause)
            level_text = f" of {level}" if level else ""
            others = "; means of the other motions" if lost and mean and not governs else ""
            text = f"Limits{level_text} {result}{lost}{others}: {'; '.join(clauses)}."
        verdicts.append(Verdict(met, text + addition, has_single_limit))
    return verdicts


def _capital(text: str) -> str:
    """Return a text with a capital letter."""
    return text[0].upper() + text[1:]


def _maximum(check: LimitCheck, units: OutputUnits) -> str:
    """Return a clause with the maximum demand over all motions, its story and its motion.

    `check` compares the mean demand of a suite with a limit.
    """
    location = QUANTITIES[check.quantity].location
    value = _text(check, check.largest, units, 3)
    return f"largest {value} ({location} {check.place(check.largest_story)}, {check.motion})"


def _place(check: LimitCheck, mean: bool) -> str:
    """Return the place of the demand of a comparison, such as `story 3`, for a mean with the
    number of its motions."""
    place = f"{QUANTITIES[check.quantity].location} {check.place(check.story)}"
    return f"{place}, {pluralize(check.motions, 'motion')}" if mean else place


def _text(check: LimitCheck, value: float, units: OutputUnits, digits: int = DIGITS) -> str:
    """Return a demand with its unit as text; ratios in percent.

    It has enough digits to differ from the limit. The residual drift after a collapse is unknown.
    """
    if math.isnan(value):
        return "unknown after a collapse"
    unit = QUANTITIES[check.quantity].unit
    factor, name = (0.01, "%") if unit == "1" else (units.unit(unit)[1], units.unit(unit)[0])
    return f"{number_text(value / factor, digits, unlike=check.limit / factor)} {name}"


def _limit(check: LimitCheck, units: OutputUnits) -> str:
    """Return the limit of a comparison with its unit as text; ratios in percent."""
    unit = QUANTITIES[check.quantity].unit
    if unit == "1":
        return f"{100.0 * check.limit:g} %"
    return f"{units.of(check.limit, unit):g} {units.unit(unit)[0]}"


def governing_story(checks: Iterable[LimitCheck]) -> int | None:
    """Return the story (from 1) with the highest ratio of demand to limit; None without limits of
    stories."""
    story_checks = [check for check in checks if QUANTITIES[check.quantity].location == "story"]
    return max(story_checks, key=lambda check: check.ratio).story if story_checks else None


def isolator_sentence(check: LimitCheck | None, units: OutputUnits, *, mean: bool) -> str:
    """Return a sentence on the isolator displacement; empty without isolators.

    Parameters
    ----------
    check : LimitCheck | None
        Displacement of the isolators, as `isolator_check` of a run or a suite.
    mean : bool
        True for a suite, with its mean and its maximum.
    """
    if check is None:
        return ""
    text = f"solator displacement {_text(check, check.demand, units)} ({_place(check, mean)})"
    return f"Mean i{text}, {_maximum(check, units)}." if mean else f"I{text}."


def has_isolator_limit(checks: Iterable[LimitCheck]) -> bool:
    """Return True if a limit applies to the isolator displacement."""
    return any(check.quantity == ISOLATOR for check in checks)


def limit_table(
    checks_by_name: Mapping[str, Sequence[LimitCheck]],
    units: OutputUnits,
    *,
    mean: bool,
    reasons: Mapping[str, str],
) -> Table:
    """Return the comparisons of demands with limits as a table of a report, the governing
    comparisons first.

    Parameters
    ----------
    checks_by_name : mapping of str to sequence of LimitCheck
        Comparisons by the name of the building and the intensity level; the name is empty if there
        is one building at a single level.
    mean : bool
        True for a suite, with the columns of the maximum and its motion.
    reasons : mapping of str to str
        Reason by the same name if no limit is met because of a collapse or a missing result. It is
        part of the result if the demand is below the limit.
    """
    rows: list[dict[str, Cell]] = []
    has_names = any(checks_by_name)
    has_levels = any(check.level for checks in checks_by_name.values() for check in checks)
    for name, checks in checks_by_name.items():
        for level, level_checks in by_level(checks).items():
            for check in level_checks:
                quantity = QUANTITIES[check.quantity]
                row: dict[str, Cell] = {"building": name} if has_names else {}
                row |= {"level": level or "-"} if has_levels else {}
                row |= {
                    "quantity": quantity.text,
                    # A number is not divided from its noun in a narrow column.
                    "place": f"{quantity.location}\u00a0{check.place(check.story)}",
                    "mean demand" if mean else "demand": _text(check, check.demand, units),
                    **({"motions": str(check.motions)} if mean else {}),
                    "limit": _limit(check, units),
                    "demand/limit": ""
                    if math.isnan(check.ratio)
                    else number_text(check.ratio, unlike=1.0),
                    "result": _result(check, reasons.get(name, "")),
                }
                if mean:
                    row |= {"largest": _text(check, check.largest, units), "motion": check.motion}
                rows.append(row)
    columns = rows[0] if rows else ()
    return Table.of_units(dict.fromkeys(columns, TEXT), [tuple(row.values()) for row in rows])


def _result(check: LimitCheck, reason: str) -> str:
    """Return the result of a comparison as text, with the reason of a result that does not follow
    from the ratio of demand to limit."""
    if check.within:
        return "met"
    return "exceeded" if check.ratio > 1.0 or not reason else f"exceeded: {reason}"


def limits_summary(checks: Iterable[LimitCheck], *, mean: bool) -> list[dict[str, Any]]:
    """Return the comparisons of demands with limits for summary.json, in SI units.

    Parameters
    ----------
    mean : bool
        True for the mean demands of a suite, with the maximum and its motion.
    """
    entries = []
    for check in checks:
        quantity = QUANTITIES[check.quantity]
        unit = suffix(quantity.unit)
        place = quantity.location if quantity.of_device else "story"
        entry = {
            **({"level": check.level} if check.level else {}),
            "quantity": check.quantity,
            "met": check.within,
            f"{check.quantity}{unit}": None if math.isnan(check.demand) else check.demand,
            f"{check.quantity}_limit{unit}": check.limit,
            f"limit_{place}": check.place(check.story),
            "limit_ratio": None if math.isnan(check.ratio) else check.ratio,
        }
        if mean:
            entry |= {
                f"{check.quantity}_largest{unit}": check.largest,
                f"largest_{place}": check.place(check.largest_story),
                "motion": check.motion,
                "motions": check.motions,
            }
        entries.append(entry)
    return entries
