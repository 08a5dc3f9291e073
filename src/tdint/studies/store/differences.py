"""Differences between the inputs of two stores, or of a store and a campaign, as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

_MAX_LISTED_DIFFERENCES = 8
"""Maximum number of differences in a message, for each type of entry, so that the message is
readable."""


def differences(
    stored: dict[str, str],
    compared: dict[str, str],
    *,
    entry_type: str,
    stored_label: str,
    compared_label: str,
) -> list[str]:
    """Describe the differences between two mappings by at most eight lines, followed by a line
    with the number of further differences if there are more.

    Parameters
    ----------
    stored, compared : dict of str to str
        The mappings: values, or SHA-256, by name.
    entry_type : str
        Type of the entries: `setting`, `building`, `record` or `plug-in`. Only the values of
        settings are shown.
    stored_label, compared_label : str
        Labels of `stored` and `compared` in the lines, for example `the store`.
    """
    lines = []
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
    *,
    stored_label: str = "the store",
    compared_label: str,
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
    for entry_type, stored_entries, compared_entries in zip(
        entry_types, stored, compared, strict=True
    ):
        first, second = dict(stored_entries), dict(compared_entries)
        if are_shards and entry_type == "building":
            common_names = first.keys() & second.keys()
            first = {name: first[name] for name in first if name in common_names}
            second = {name: second[name] for name in second if name in common_names}
        lines += differences(
            first,
            second,
            entry_type=entry_type,
            stored_label=stored_label,
            compared_label=compared_label,
        )
    # This function is called if the fingerprints differ. If all compared values are equal, the
    # reason is the inventory from which the shards are derived, or the order of the entries.
    remaining_reason = (
        INVENTORY_CHANGED if are_shards else "the order of buildings or records differs"
    )
    return "\n".join(lines or [remaining_reason])
