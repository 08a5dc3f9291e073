"""What a store is of: all that its runs depend on, and in words how two of them differ."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from tdint.campaign.buildings import Buildings, model_files, output_units
from tdint.campaign.fragility.type_states import Damage
from tdint.campaign.plan import Plan
from tdint.files import digest_of
from tdint.ground_motion.reading.suites import SuiteMotion
from tdint.output_units import SI, OutputUnits

_MOST_DIFFERENCES = 8


@dataclass(frozen=True)
class Identity:
    """What is kept in a store.

    Attributes
    ----------
    name : str
        Of the campaign or the study.
    kind : str
        What it is called in messages.
    settings : dict
        What is the same for all runs, JSON by name.
    buildings, motions : sequence
        By their numbers.
    chunks, runs : int
        How many there are; 0 runs where their number follows from what comes out.
    size : callable
        How many runs a chunk has; None where that follows from what comes out.
    unused : sequence of tuple
        Inputs that could not be used: `record` or `building`, and why.
    units : OutputUnits
        The units in which the models want their results.
    damage : Damage or None
        How damage is told.
    files : mapping of str to str
        SHA-256 of the model files or of those of the inventory, by name.
    """

    name: str
    kind: str
    settings: dict[str, str]
    buildings: Buildings
    motions: Sequence[SuiteMotion]
    chunks: int
    runs: int = 0
    size: Callable[[int], int | None] = lambda chunk: None
    unused: Sequence[tuple[str, str]] = ()
    units: OutputUnits = SI
    damage: Damage | None = None
    files: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, plan: Plan) -> Identity:
        """What the store of a campaign is of."""
        parts = asdict(plan.settings) | plan.levels.description() | plan.assignment.description()
        return cls(
            name=plan.name,
            kind="campaign",
            settings=as_json(parts),
            buildings=plan.buildings,
            motions=plan.motions,
            chunks=plan.chunks,
            runs=plan.runs,
            size=plan.size,
            unused=plan.unused,
            units=output_units(plan.buildings),
            damage=plan.damage,
            files=model_files(plan.buildings) | {file: digest_of(Path(file)) for file in plan.inventory},
        )

    @cached_property
    def digests(self) -> list[str]:
        """SHA-256 of the buildings."""
        return [one.digest for one in self.buildings]

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 over the settings and the SHA-256 of all buildings and records in order."""
        whole = hashlib.sha256(json.dumps(self.settings, sort_keys=True).encode())
        for kind, digests in (
            ("buildings", self.digests),
            ("records", [one.record.digest for one in self.motions]),
        ):
            whole.update(kind.encode())
            for digest in digests:
                whole.update(digest.encode())
        return whole.hexdigest()

    def building_digests(self) -> dict[str, str]:
        """SHA-256 of the buildings by their names."""
        return dict(zip((one.name for one in self.buildings), self.digests, strict=True))

    def record_digests(self) -> dict[str, str]:
        """SHA-256 of the records by their names and components."""
        digests: dict[str, str] = {}
        for number, one in enumerate(self.motions, start=1):
            name = f"{one.name} {one.component}"
            digests[name if name not in digests else f"{name} ({number})"] = one.record.digest
        return digests


def as_json(settings: dict[str, Any]) -> dict[str, str]:
    """Settings as a store has them."""
    return {name: json.dumps(value, sort_keys=True) for name, value in sorted(settings.items())}


def differences(before: dict[str, str], now: dict[str, str], *, kind: str, known: str, given: str) -> list[str]:
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
    if len(found) > _MOST_DIFFERENCES:
        found[_MOST_DIFFERENCES:] = [f"and {len(found) - _MOST_DIFFERENCES} more of kind {kind}"]
    return found


def all_differences(
    before: Iterable[dict[str, str]], now: Iterable[dict[str, str]], *, known: str = "the store", given: str
) -> str:
    """What differs of settings, buildings and records, each side's three in this order; a line each."""
    kinds = ("setting", "building", "record")
    found = [
        line
        for kind, one, other in zip(kinds, before, now, strict=True)
        for line in differences(one, other, kind=kind, known=known, given=given)
    ]
    return "\n".join(found or ["the order of buildings or records: differs"])
