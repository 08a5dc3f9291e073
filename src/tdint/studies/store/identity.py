"""Complete input of the runs in a store, which identifies the store, and metadata of the runs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from tdint.arrays import cached_property
from tdint.files import digest_of
from tdint.ground_motion.reading.suites import SuiteMotion
from tdint.response.runs.load_case import LoadCase
from tdint.studies.campaign.buildings import (
    Buildings,
    RowBuildings,
    digests_of,
    limits_text,
    model_files,
    output_units,
    plugin_files,
)
from tdint.studies.campaign.plan import Plan
from tdint.studies.fragility.type_states import Damage
from tdint.studies.motions.pairs import LARGER
from tdint.units import SI, OutputUnits


@dataclass(frozen=True)
class Identity:
    """Complete input of the runs in a store, and metadata of the runs.

    Attributes
    ----------
    study_type : str
        Type of study for messages, such as `campaign`.
    settings : dict
        Settings that apply to all runs: JSON texts by name.
    buildings, motions : sequence
        Buildings and ground motions. Their indices are their numbers in the tables of the store.
    chunks, runs : int
        Number of chunks and of runs; 0 runs if the number depends on results.
    size : callable
        Function that returns the number of runs of a chunk; None if the number depends on results.
    unused : sequence of (str, str)
        Inputs that could not be used: the category (`record` or `building`), and the reason.
    units : OutputUnits
        Output units that the models request.
    files : mapping of str to str
        SHA-256 of the model files, or of the files of the inventory, by name.
    rates : mapping of str to float
        Annual rate of each event, 1/year, if specified.
    style : str
        Style of the figures.
    pair_demand : str | None
        Rule that combines the demands of the two components of a pair; None: the default.
    building_numbers : sequence of int | None
        Numbers of the buildings that are written to the store, that is, of a shard; None: all.
    scaling : mapping
        File of the scale factors with rule and target; empty without such a file.
    """

    name: str
    study_type: str
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
    outputs: Sequence[str] | None = None
    rates: Mapping[str, float] = field(default_factory=dict)
    style: str = ""
    pair_demand: str | None = None
    building_numbers: Sequence[int] | None = None
    scaling: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, plan: Plan, building_numbers: Sequence[int] | None) -> Identity:
        """Return the identity of the store of a campaign."""
        # Attributes that have the same name and meaning in `Plan` and `Identity`.
        attributes = {
            item.name: getattr(plan, item.name) for item in fields(cls) if hasattr(plan, item.name)
        }
        attributes |= {
            "study_type": "campaign",
            "settings": as_json(
                asdict(plan.settings) | plan.levels.description() | plan.assignment.description()
            ),
            "units": output_units(plan.buildings),
            "building_numbers": building_numbers,
            "files": model_files(plan.buildings)
            | {
                entry.file: entry.sha256
                for motion in plan.motions
                if isinstance(motion.record, LoadCase)
                for entry in motion.record.inputs
            }
            | {file: digest_of(Path(file)) for file in plan.inventory},
        }
        return cls(**attributes)

    @cached_property
    def code(self) -> dict[str, str]:
        """SHA-256 of the files of plug-ins that the runs depend on, by name."""
        return plugin_files(self.buildings)

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the settings, the files of plug-ins if there are any, and the digests of all
        buildings and records in order. Stores with the same fingerprint contain the same runs."""
        hasher = hashlib.sha256(json.dumps(self.settings, sort_keys=True).encode())
        if self.code:
            hasher.update(json.dumps(["plug-ins", self.code]).encode())
        records = [motion.record.digest for motion in self.motions]
        for table, digests in (("buildings", digests_of(self.buildings)), ("records", records)):
            hasher.update(table.encode())
            for digest in digests:
                hasher.update(digest.encode())
        return hasher.hexdigest()

    @property
    def compared_values(self) -> ComparedValues:
        """Settings, and SHA-256 of buildings, records and plug-in files, by name.
        `all_differences` compares these values with the values of a store."""
        buildings = {stored_text(building.name): building.digest for building in self.buildings}
        records: dict[str, str] = {}
        # Motions with the same name and component, such as the samples of a grid, are
        # distinguished by their numbers, which are added to all names except the first.
        for number, motion in enumerate(self.motions, start=1):
            name = stored_text(f"{motion.name} {motion.component}")
            records[name if name not in records else f"{name} ({number})"] = motion.record.digest
        return self.settings, buildings, records, self.code


def as_json(settings: dict[str, Any]) -> dict[str, str]:
    """Return a dictionary from the name of each setting to its value as JSON text, the form in
    which a store contains settings."""
    return {name: json.dumps(value, sort_keys=True) for name, value in sorted(settings.items())}


def metadata_of(identity: Identity) -> dict[str, str]:
    """Return the metadata of a campaign or study (`identity`) that do not affect the results of
    runs, as texts by their keys in the table `meta`."""
    buildings = identity.buildings
    rows = buildings.rows if isinstance(buildings, RowBuildings) else None
    # The SHA-256 includes the cells of the columns that are copied to tables.
    columns, inventory_digest = (rows.titles, rows.digest(carried=True)) if rows else ((), "")
    # An inventory has no limits, and its periods are stored with the building types.
    periods = [] if inventory_digest else [building.subject().period for building in buildings]
    return {
        "inventory": json.dumps({"columns": columns, "sha256": inventory_digest}),
        "output_units": str(identity.units),
        "damage": identity.damage.description() if identity.damage else "",
        "files": json.dumps(dict(identity.files)),
        "outputs": json.dumps(identity.outputs),
        "rates": json.dumps(dict(identity.rates)),
        "style": json.dumps(identity.style),
        "pair_demand": identity.pair_demand or LARGER,
        "limits": "" if inventory_digest else limits_text(buildings),
        "periods": json.dumps(periods),
    }


def stored_text(name: str) -> str:
    """Return a name as text that SQLite can store. A file name can contain bytes that are not
    UTF-8, which Python represents by surrogates; they become escape sequences such as \\xff."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


_MAX_LISTED_DIFFERENCES = 8
"""Maximum number of differences in a message, for each type of entry, so that the message is
readable."""


def differences(
    stored: Mapping[str, str], compared: Mapping[str, str], entry_type: str, labels: tuple[str, str]
) -> list[str]:
    """Describe the differences between two mappings by at most eight lines, followed by a line
    with the number of further differences if there are more.

    Parameters
    ----------
    stored, compared : mapping of str to str
        The mappings: values, or SHA-256, by name.
    entry_type : str
        Type of the entries: `setting`, `building`, `record` or `plug-in`. Only the values of
        settings are shown.
    labels : tuple of str
        Labels of `stored` and `compared` in the lines, for example `the store`.
    """
    lines = []
    stored_label, compared_label = labels
    # All names of both mappings without duplicates, in the order of `stored`
    for name in dict.fromkeys([*stored, *compared]):
        if name not in compared:
            lines.append(f"{entry_type} {name}: only in {stored_label}")
        elif name not in stored:
            lines.append(f"{entry_type} {name}: only in {compared_label}")
        elif stored[name] != compared[name]:
            difference = "differs"
            if entry_type == "setting":
                difference = (
                    f"{stored[name]} in {stored_label}, {compared[name]} in {compared_label}"
                )
            lines.append(f"{entry_type} {name}: {difference}")
    if len(lines) > _MAX_LISTED_DIFFERENCES:
        lines[_MAX_LISTED_DIFFERENCES:] = [
            f"and {len(lines) - _MAX_LISTED_DIFFERENCES} more differences of type {entry_type}"
        ]
    return lines


ComparedValues = Sequence[Mapping[str, str]]
"""Four mappings by name: values of the settings, and SHA-256 of the buildings, the records and the
files of plug-ins."""


INVENTORY_CHANGED = (
    "buildings: the inventory has changed between the calls for the shards; call `tdint campaign` "
    "for every shard with the same inventory"
)
"""Difference between two shards of a campaign."""


def all_differences(
    stored: ComparedValues,
    compared: ComparedValues,
    labels: tuple[str, str],
    *,
    are_shards: bool = False,
    has_new_inventory: bool = False,
) -> str:
    """Return a text that describes the differences between two stores or campaigns, one per line.

    Parameters
    ----------
    are_shards : bool
        True if `stored` or `compared` is a shard. A shard contains only some of the buildings, so
        only buildings that both contain are compared.
    has_new_inventory : bool
        True if the files of the inventory differ.
    """
    entry_types = ("setting", "building", "record", "plug-in")
    lines = [INVENTORY_CHANGED] if are_shards and has_new_inventory else []
    for entry_type, first, second in zip(entry_types, stored, compared, strict=True):
        if are_shards and entry_type == "building":
            common_names = first.keys() & second.keys()
            first = {name: first[name] for name in first if name in common_names}
            second = {name: second[name] for name in second if name in common_names}
        lines += differences(first, second, entry_type, labels)
    # This function is called if the fingerprints differ. If all compared values are equal, the
    # reason is the inventory from which the shards are derived, or the order of the entries.
    remaining_reason = (
        INVENTORY_CHANGED if are_shards else "the order of buildings or records differs"
    )
    return "\n".join(lines or [remaining_reason])
