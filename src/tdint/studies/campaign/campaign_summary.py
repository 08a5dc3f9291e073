"""JSON summary of a campaign."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tdint.output.summary import schema, versions
from tdint.output.tables.table import describe
from tdint.studies.campaign.campaign_tables import PROFILE_ERRORS, PROFILES, run_table
from tdint.studies.fragility.damage_tables import damage_summary
from tdint.studies.store.result_store import Store


def campaign_summary(store: Store) -> dict[str, Any]:
    """Return the content of summary.json of a campaign: settings, progress, inputs, and the columns
    of its tables."""
    statuses, unused = store.statuses(), store.unused()
    # The store is used instead of the files, because these may have been deleted or changed.
    records = store.connection.execute(
        "SELECT name, component, direction, dt_s, samples, pga_m_s2, pgv_m_s, sha256 FROM records "
        "ORDER BY id"
    )
    origins = store.origins()
    buildings = store.value("SELECT count(*) FROM buildings")
    return {
        "schema": schema("campaign"),
        "name": store.meta("name"),
        "fingerprint": store.meta("fingerprint"),
        "settings": store.parameters(),
        **({"scaling": scaling} if (scaling := store.scaling()) else {}),
        "buildings": buildings,
        "inputs": [{"file": file, "sha256": digest} for file, digest in store.files().items()],
        "records": [
            {**_record_entry(row), **origins.get(str(number), {})}
            for number, row in enumerate(records)
        ],
        "runs": {
            "all": int(store.meta("runs")),
            "done": sum(statuses.values()),
            "by_status": statuses,
        },
        "not_used": {
            f"{category}s": {"count": len(reasons), "reasons": reasons}
            for category, reasons in unused.items()
        },
        "repeated_with_finer_steps": store.count("repeats > 0"),
        "not_at_rest_at_their_end": store.count("at_rest = 0"),
        "processor_time_s": store.seconds(),
        "without_an_error": without_error(store),
        "columns": describe(run_table(store).columns),
        "profiles": {"columns": describe([*PROFILES, *(PROFILE_ERRORS if store.checked else ())])},
        **({"damage": damage_summary(store)} if store.damage() else {}),
        "versions": {**versions(), **({"plugins": code} if (code := store.code()) else {})},
    }


def _record_entry(row: Sequence[Any]) -> dict[str, Any]:
    """Return the entry of a ground motion or a load case, a row of the table `records` of a store.
    A load case has no samples, and no values of a ground motion."""
    keys = ("file", "component", "direction", "dt_s", "samples", "pga_m_s2", "pgv_m_s", "sha256")
    entry = dict(zip(keys, row, strict=True))
    if entry["samples"]:
        return entry
    return {"file": entry["file"], "sha256": entry["sha256"]}


def without_error(store: Store) -> int | None:
    """Return the number of runs of a campaign that have a result but no error estimate; None if no
    estimates were requested."""
    if not store.checked:
        return None
    return store.count("peak_drift_m IS NOT NULL AND peak_drift_m_error IS NULL")
