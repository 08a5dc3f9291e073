"""What the rows of a store depend on: two campaigns of one fingerprint have the same rows."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict

from tdint.campaign.plan import Plan

_MOST = 8


def settings_of(plan: Plan) -> dict[str, str]:
    """What is the same for all runs, by its name."""
    parts = asdict(plan.settings) | plan.levels.description() | plan.assignment.description()
    return {name: json.dumps(value, sort_keys=True) for name, value in sorted(parts.items())}


def fingerprint(settings: dict[str, str], buildings: Iterable[str], records: Iterable[str]) -> str:
    """SHA-256 over the settings and the SHA-256 of all buildings and records in order."""
    whole = hashlib.sha256(json.dumps(settings, sort_keys=True).encode())
    for kind, digests in (("buildings", buildings), ("records", records)):
        whole.update(kind.encode())
        for digest in digests:
            whole.update(digest.encode())
    return whole.hexdigest()


def differences(
    before: dict[str, str], now: dict[str, str], *, kind: str, known: str = "the store", given: str = "this campaign"
) -> list[str]:
    """What differs between two sides, one sentence each: from names to values, or to SHA-256 (kind `building`)."""
    found = []
    for name in dict.fromkeys([*before, *now]):
        if name not in now:
            found.append(f"{kind} {name}: in {known} alone")
        elif name not in before:
            found.append(f"{kind} {name}: in {given} alone")
        elif before[name] != now[name]:
            what = "differs" if kind != "setting" else f"{before[name]} in {known}, {now[name]} in {given}"
            found.append(f"{kind} {name}: {what}")
    if len(found) > _MOST:
        found[_MOST:] = [f"and {len(found) - _MOST} more of kind {kind}"]
    return found
