"""What a store is of: all that its runs depend on, and in words how two of them differ."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

from tdint.campaign.fragility.type_states import Damage
from tdint.campaign.plan import Plan
from tdint.ground_motion.record import Record
from tdint.output_units import SI, OutputUnits

_MOST_DIFFERENCES = 8


class StoredBuilding(NamedTuple):
    """Name, method, number of stories and SHA-256 of a building."""

    name: str
    method: str
    stories: int
    digest: str


class StoredMotion(NamedTuple):
    """A record under the name that it has here; direction 1 or 2 of a pair."""

    name: str
    component: str
    direction: int
    record: Record


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
    varied : sequence of mapping
        What a sweep changed in each building.
    columns, cells : sequence of str
        Columns of an inventory that are carried along, and of each building what stands there, a JSON list.
    damage : Damage or None
        How damage is told.
    files : mapping of str to str
        SHA-256 of the model files, by name.
    """

    name: str
    kind: str
    settings: dict[str, str]
    buildings: Sequence[StoredBuilding]
    motions: Sequence[StoredMotion]
    chunks: int
    runs: int = 0
    size: Callable[[int], int | None] = lambda chunk: None
    unused: Sequence[tuple[str, str]] = ()
    units: OutputUnits = SI
    varied: Sequence[Mapping[str, float]] = ()
    columns: Sequence[str] = ()
    cells: Sequence[str] = ()
    damage: Damage | None = None
    files: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, plan: Plan) -> Identity:
        """What the store of a campaign is of."""
        parts = asdict(plan.settings) | plan.levels.description() | plan.assignment.description()
        buildings = plan.buildings
        return cls(
            name=plan.name,
            kind="campaign",
            settings=as_json(parts),
            buildings=[
                StoredBuilding(buildings.name(i), buildings.method(i), buildings.stories(i), buildings.digest(i))
                for i in range(len(buildings))
            ],
            motions=[StoredMotion(one.name, one.component, one.direction, one.record) for one in plan.motions],
            chunks=plan.chunks,
            runs=plan.runs,
            size=plan.size,
            unused=plan.unused,
            units=buildings.output_units,
            varied=[buildings.varied(i) for i in range(len(buildings))],
            columns=buildings.columns,
            cells=[buildings.cells(i) for i in range(len(buildings))] if buildings.columns else (),
            damage=plan.damage,
            files=buildings.files,
        )

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 over the settings and the SHA-256 of all buildings and records in order."""
        whole = hashlib.sha256(json.dumps(self.settings, sort_keys=True).encode())
        for kind, digests in (
            ("buildings", [one.digest for one in self.buildings]),
            ("records", [one.record.digest for one in self.motions]),
        ):
            whole.update(kind.encode())
            for digest in digests:
                whole.update(digest.encode())
        return whole.hexdigest()

    def building_digests(self) -> dict[str, str]:
        """SHA-256 of the buildings by their names."""
        return {one.name: one.digest for one in self.buildings}

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
