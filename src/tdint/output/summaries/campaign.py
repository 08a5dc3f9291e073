"""Summary of a campaign."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from tdint.output.summaries.summary import schema, versions
from tdint.output.tables.columns.campaign import RUNS
from tdint.output.tables.table import describe

if TYPE_CHECKING:
    from tdint.campaign.store.store import Store


def campaign_summary(store: Store) -> dict[str, Any]:
    """What a campaign is, how far it has come, and what the columns of runs.csv mean."""
    statuses, unused = store.statuses(), store.unused()
    records = store.connection.execute(
        "SELECT name, component, direction, dt_s, samples, pga_m_s2, pgv_m_s, sha256 FROM records ORDER BY id"
    )
    keys = ("file", "component", "direction", "dt_s", "samples", "pga_m_s2", "pgv_m_s", "sha256")
    buildings = store.connection.execute("SELECT count(*) FROM buildings").fetchone()[0]
    return {
        "schema": schema("campaign"),
        "name": store.meta("name"),
        "fingerprint": store.meta("fingerprint"),
        "settings": {name: json.loads(value) for name, value in store.settings().items()},
        "buildings": buildings,
        "records": [dict(zip(keys, row, strict=True)) for row in records],
        "runs": {"all": int(store.meta("runs")), "done": sum(statuses.values()), "by_status": statuses},
        "not_used": {f"{kind}s": {"count": len(reasons), "reasons": reasons} for kind, reasons in unused.items()},
        "repeated_with_finer_steps": store.count("repeats > 0"),
        "not_at_rest_at_their_end": store.count("at_rest = 0"),
        "processor_time_s": store.seconds(),
        "columns": describe(RUNS),
        "versions": versions(),
    }
