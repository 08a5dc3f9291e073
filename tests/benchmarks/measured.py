"""Day, commit and digest of the kernels of stored measurements.

`measured.csv` has a row for each section of `tests/MEASUREMENTS.md` whose numbers no test computes
again. Programs that store their numbers write their row with `store`. Other rows have a commit that
is known, or the last one of their last day, and the digest of its sources.
"""

import csv
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

from tdint.kernels.building.sources import digest_of_all

HERE = Path(__file__).parent
MEASURED = HERE / "measured.csv"
RELIABILITY = HERE / "reliability.csv"


def rows(file: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file as texts by column."""
    with file.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def write(file: Path, found: Sequence[Mapping[str, object]]) -> None:
    """Write a CSV file with a header and rows."""
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, list(found[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(found)


def commit() -> str:
    """Return the short name of the present commit; empty outside of a checkout."""
    command = ["git", "rev-parse", "--short=8", "HEAD"]
    done = subprocess.run(command, cwd=HERE, capture_output=True, text=True, check=False)
    return done.stdout.strip()


def store(section: str) -> None:
    """Write the row of a measurement that has just been made."""
    row = {
        "section": section,
        "first_day": (day := f"{datetime.now(UTC):%Y-%m-%d}"),
        "last_day": day,
        "commit": commit(),
        "kernels": digest_of_all(),
    }
    write(MEASURED, [row if old["section"] == section else old for old in rows(MEASURED)])


def state(row: Mapping[str, str]) -> str:
    """Return whether kernels or methods have changed since a measurement."""
    return "no" if row["kernels"] == digest_of_all() else "yes"


def measured_table() -> str:
    """Return the table of measurements with the state of their kernels."""
    lines = ["| section | measured | commit | kernels changed since |", "|---|---|---|---|"]
    for row in rows(MEASURED):
        days = " to ".join(dict.fromkeys((row["first_day"], row["last_day"])))
        anchor = row["section"].lower().replace(" ", "-").replace(",", "")
        lines.append(f"| [{row['section']}](#{anchor}) | {days} | {row['commit']} | {state(row)} |")
    return "\n".join(lines) + "\n"


SHORT, LONG = "0.5, 1, 2", "5, 10"
"""Time steps of the two groups of errors, sampling intervals."""
HEADS = {
    "peak_drift": "drift",
    "peak_absolute_acceleration": "acceleration",
    "peak_total_shear": "total shear",
    "peak_damper_force": "damper force",
    "residual_drift": "residual",
    "peak_shear": "story shear",
}
"""Titles of the columns of the tables by quantity."""


def share(found: Iterable[Mapping[str, str]]) -> str:
    """Return the share of errors beyond twice the estimate / of estimates more than ten times too
    large, %, of rows of reliability.csv; empty without errors."""
    counted = [[int(row[key]) for key in ("errors", "too_small", "too_large")] for row in found]
    errors, small, large = map(sum, zip(*counted, strict=True)) if counted else (0, 0, 0)
    return f"{100 * small / errors:.2f}/{100 * large / errors:.1f}" if errors else ""


def reliability_table(table: str) -> str:
    """Return the table `reliability` or `separate-solver` of MEASUREMENTS.md from its file."""
    found = [row for row in rows(RELIABILITY) if row["table"] == table]
    names = [name for name in HEADS if any(row["quantity"] == name for row in found)]
    heads = " | ".join(HEADS[name] for name in names)
    lines = [f"| steps of {SHORT} samples | {heads} | all |", "|---" * (len(names) + 2) + "|"]
    methods = list(dict.fromkeys(row["method"] for row in found))
    groups = [(f"`{method}`", [method], SHORT) for method in methods]
    groups += [("all methods", methods, SHORT), ("all methods, 5 and 10 samples", methods, LONG)]
    for title, chosen, steps in groups:
        of_line = [row for row in found if row["method"] in chosen and row["samples"] == steps]
        cells = [share(row for row in of_line if row["quantity"] == name) for name in names]
        lines.append(f"| {title} | {' | '.join([*cells, share(of_line)])} |")
    cases = next(iter(found))
    lines.append(
        f"\n{cases['confirmed']} of {cases['cases']} buildings have a confirmed true value; "
        f"{sum(int(row['errors']) for row in found)} errors were judged."
    )
    return "\n".join(lines) + "\n"


def without_record_table() -> str:
    """Return the table of buildings without a record of MEASUREMENTS.md."""
    found = [row for row in rows(RELIABILITY) if row["table"] == "no-record"]
    heads = sorted({(row["quantity"], row["samples"]) for row in found}, key=_order)
    titles = " | ".join(f"{case}, {part.split()[0]}" for case, part in heads)
    lines = [f"| method | {titles} |", "|---" * (len(heads) + 1) + "|"]
    for method in dict.fromkeys(row["method"] for row in found):
        cells = [
            share(row for row in found if (row["method"], row["quantity"], row["samples"]) == key)
            for key in ((method, *head) for head in heads)
        ]
        lines.append(f"| `{method}` | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _order(head: tuple[str, str]) -> tuple[bool, int]:
    """Return the order of a column: free vibration first, then by the divisor of the period."""
    case, part = head
    return case != "free", -int(part.split()[0].removeprefix("1/"))
