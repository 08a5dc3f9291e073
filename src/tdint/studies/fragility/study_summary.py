"""JSON summary of a study that a table of demands belongs to."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tdint.output.summary import stored_summary

_SUMMARIES = ("ida.json", "summary.json")
"""Names of the summaries in the directory of a study and of a campaign."""

_TABLES = ("capacities.csv", "ida.csv", "runs.csv")
"""Tables of studies that contain observations."""


def study_summary(source: Path) -> dict[str, Any]:
    """Return the JSON summary of the study that wrote a table; empty for a table from elsewhere.

    Parameters
    ----------
    source : Path
        Table with observations, or the directory of a study.
    """
    folder = source if source.is_dir() else source.parent
    if not source.is_dir() and source.name not in _TABLES:
        return {}
    summaries = (stored_summary(folder / name) for name in _SUMMARIES)
    content: dict[str, Any] = next(filter(None, summaries), {})
    return content if content.get("records") else {}
