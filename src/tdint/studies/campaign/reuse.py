"""Continuation of a campaign after a change of its records or buildings.

The results of the runs with unchanged record and building are copied from the earlier store,
so that only the other runs are integrated. A run does not depend on the other runs of the campaign,
therefore the tables equal the tables of a new campaign to the last byte.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, cast

from tdint.files import is_there
from tdint.number_parsing import pluralize
from tdint.studies.campaign.chunks import ChunkResult, Rows, Run
from tdint.studies.campaign.plan import Plan
from tdint.studies.store import schema
from tdint.studies.store.identity import Identity, stored_text
from tdint.studies.store.opening import obstacle_to_reuse, open_replacement, open_written
from tdint.studies.store.result_store import FILE, Store, is_empty


def reuse_results(folder: Path, plan: Plan) -> str:
    """Create the store of a changed campaign that will replace the store in a directory
    (`open_replacement`), with the results of the unchanged runs. The caller has locked the
    directory.

    Rows of chunks with some unchanged runs are kept in `plan.kept`, until the other runs of the
    chunk are integrated.

    Parameters
    ----------
    folder : Path
        Directory of the campaign. Without a store, or with a store of the same campaign, the
        function has no effect.

    Returns
    -------
    str
        Note with the number of runs with kept results; empty if the function has no effect.

    Raises
    ------
    AnotherStudyError
        Differences other than records and buildings prevent the use of the results.
    OutputError
        The store cannot be used or written.
    """
    file = folder / FILE
    if not is_there(file):
        return ""
    identity = Identity.of(plan, None)
    with open_written(file) as old:
        if is_empty(old) or identity.fingerprint == old.meta("fingerprint"):
            return ""
        if obstacle := obstacle_to_reuse(old, identity):
            raise schema.AnotherStudyError(
                f"{old.name}: --changed cannot keep results: {obstacle}; specify another directory "
                "with -o, or --overwrite to start again"
            )
        old.remove_invalid_chunks()
        new, _ = open_replacement(file, identity)
        with new:
            kept = _copy_results(old, new, plan, identity)
            written = sorted(old.written())
            with schema.transaction(new.connection, new.name):
                new.connection.executemany("INSERT OR IGNORE INTO written VALUES(?, ?)", written)
    return (
        f"{file}: the results of {kept} of {pluralize(plan.runs, 'run')} are kept, because their "
        "record and building are unchanged"
    )


def _copy_results(old: Store, new: Store, plan: Plan, identity: Identity) -> int:
    """Copy the rows of unchanged runs to the new store (complete chunks) or to `plan.kept` (parts
    of chunks), and return the number of these runs.
    """
    buildings = _common_numbers(
        old.connection.execute("SELECT id, name, sha256 FROM buildings"),
        ((stored_text(building.name), building.digest) for building in identity.buildings),
    )
    motions = _common_numbers(
        old.connection.execute("SELECT id, name, component, sha256 FROM records"),
        (
            (stored_text(motion.name), stored_text(motion.component), motion.record.digest)
            for motion in identity.motions
        ),
    )
    # An interrupted call can have completed further chunks.
    count, completed = 0, new.completed_chunks()
    for number in range(plan.chunks):
        rows = Rows()
        for part in plan.chunk(number).buildings:
            for run in part.runs:
                if part.number in buildings and run.motion in motions:
                    old_key = (buildings[part.number], motions[run.motion], run.scale, run.sample)
                    rows.extend(_rows_of(old, old_key, part.number, run))
        count += len(rows.runs)
        if number in completed:
            continue
        if len(rows.runs) == plan.size(number):
            new.add(ChunkResult(number, rows, 0.0))
        elif rows.runs:
            plan.kept[number] = rows
    return count


def _common_numbers(
    stored: Iterable[tuple[Any, ...]], entries: Iterable[tuple[str, ...]]
) -> dict[int, int]:
    """Return the number in the earlier store of each entry that is unchanged, by its new number.

    `stored` has the number of an entry, its names and its SHA-256; `entries` the names and the
    SHA-256 in the order of the new numbers.
    """
    old_numbers = {identity: number for number, *names in stored for identity in [tuple(names)]}
    return {
        number: old_numbers[entry] for number, entry in enumerate(entries) if entry in old_numbers
    }


def _rows_of(old: Store, old_key: tuple[Any, ...], building: int, run: Run) -> Rows:
    """Return the stored rows of a run with its new numbers; without rows if the run is not stored.

    The rows are flat tuples, which the store accepts like the named tuples of new results.
    """
    where = "WHERE building = ? AND record = ? AND scale = ? AND sample = ?"
    new_key = (building, run.motion, run.scale, run.sample)
    tables = [
        [
            new_key + row[len(new_key) :]
            for row in old.connection.execute(table.select(where=where), old_key)
        ]
        for table in schema.ROW_TABLES
    ]
    return Rows(*cast("Any", tables))
