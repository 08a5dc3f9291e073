"""Open, create, verify and remove the store of a campaign or study."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from tdint.errors import OutputError, UsageError
from tdint.files import Content, is_there, protect_input, refuse_protected, settle, write_files
from tdint.studies.campaign.plan import Plan
from tdint.studies.store import schema
from tdint.studies.store.result_store import (
    FILE,
    Identity,
    Store,
    all_differences,
    create_tables,
    differences,
    is_empty,
)
from tdint.studies.store.schema import connect, connect_to_read, sqlite_errors_reported
from tdint.system import __version__


def open_store(
    folder: Path | None, plan: Plan, building_numbers: Sequence[int] | None = None
) -> tuple[Store, list[str]]:
    """Open or create the store of a campaign.

    Parameters
    ----------
    folder : Path | None
        Directory of the store; None: in memory.
    building_numbers : sequence of int, optional
        Numbers of the buildings of a shard; by default all buildings are in the store.

    Returns
    -------
    Store, list of str
        Store, and messages for the user, for example about chunks that are run again.

    Raises
    ------
    AnotherStudyError
        The directory contains another campaign; the message has a line per difference.
    OutputError
        The store cannot be written.
    """
    return open_or_create(
        None if folder is None else folder / FILE, Identity.of(plan, building_numbers)
    )


def open_or_create(file: Path | None, identity: Identity) -> tuple[Store, list[str]]:
    """Open the store in a file, or create it if the file does not exist.

    Results and errors are as for `open_store`.

    Parameters
    ----------
    file : Path | None
        Path of the store; None: in memory.
    identity : Identity
        Campaign or study that the store must contain.
    """
    name = ":memory:" if file is None else str(file)
    store = open_written(name)
    with schema.closed_on_failure(store.connection), sqlite_errors_reported(name):
        # `remarks` is `None` if the file is new or empty.
        remarks = None if is_empty(store) else check_same(store, identity)
        if remarks is None:
            create_tables(store, identity)
        elif removed_count := store.remove_invalid_chunks(identity):
            remarks.append(
                f"{name}: {removed_count} chunks of runs are corrupt or incomplete; they are run "
                "again"
            )
        store.update_metadata(identity)
    return store, remarks or []


def replacement_of(file: Path) -> Path:
    """Return the path of the store of a study that will replace the store `file` when its results
    are complete."""
    return file.with_name(f"{file.name}.new")


def open_replacement(file: Path, identity: Identity) -> tuple[Store, list[str]]:
    """Open or create the store that will replace the store `file`, as by `open_or_create`. A store
    of the same study from an interrupted call is continued; any other one is removed."""
    new_file = replacement_of(file)
    try:
        return open_or_create(new_file, identity)
    except (schema.AnotherStudyError, schema.UntrustedStoreError):
        remove_store(new_file)
        return open_or_create(new_file, identity)


def write_from_store(
    store: Store, contents: Mapping[Path, Content], file: Path, stale: Mapping[Path, str]
) -> None:
    """Write the files of a study from its open store. A store that replaces another one
    (`open_replacement`) is renamed to `file` together with them, and the files `stale` of the
    earlier study are removed (`write_files`)."""
    new_file = Path(store.name)
    if new_file == file:
        write_files(contents, overwrite=True, on_written=store.record_written)
        return

    def finish(digests: Mapping[Path, str]) -> None:
        """Record the files in the store and close it, so that it can be renamed."""
        store.record_written(digests)
        store.__exit__(None, None)

    write_files(
        contents,
        overwrite=True,
        stale={**stale, **dict.fromkeys(logs_of(file), "")},
        on_written=finish,
        complete={file: new_file},
    )
    store.connection, store.name = connect(str(file)), str(file)


def open_existing(folder: Path, *, write: bool = False) -> Store:
    """Open the store of a campaign in a directory. Its chunks are not verified (`check_chunks`).

    Raises
    ------
    UsageError
        The directory contains no campaign.
    OutputError
        The store cannot be used or trusted.
    """
    settle(folder, is_read=not write)
    if not is_there(folder / FILE):
        raise UsageError(
            f"{folder}: no campaign in this directory ({FILE} not found); specify the directory "
            "that was specified with -o of `tdint campaign`"
        )
    protect_input(folder / FILE)
    if write and not os.access(folder, os.W_OK):
        raise OutputError(
            f"{folder}: no permission to write to the directory; copy it, or call `tdint campaign "
            f"merge {folder} -o DIR`, which writes the tables to another directory"
        )
    name = str(folder / FILE)
    with sqlite_errors_reported(name):
        store = Store(connect(name) if write else connect_to_read(folder / FILE), name)
    if not _has_contents(store):
        store.connection.close()
        raise UsageError(
            f"{folder}: the campaign in this directory has not started; call `tdint campaign` again"
        )
    return store


def open_written(file: Path | str) -> Store:
    """Open the store of a study for writing, and verify it unless it is empty."""
    name = str(file)
    with sqlite_errors_reported(name):
        store = Store(connect(name), name)
    _has_contents(store)  # raises the error of a store with invalid contents
    return store


def _has_contents(store: Store) -> bool:
    """Verify a store, and return True if it has contents. If they are invalid, the store is closed
    and OutputError is raised.
    """
    with schema.closed_on_failure(store.connection), sqlite_errors_reported(store.name):
        has_contents = not is_empty(store)
        if has_contents:
            schema.check_store(store.connection, store.name)
    return has_contents


def check_chunks(store: Store) -> None:
    """Raise OutputError if chunks of runs in a store do not match their checksums."""
    with sqlite_errors_reported(store.name):
        corrupt = schema.corrupt_chunks(store.connection)
    if corrupt:
        raise OutputError(
            f"{store.name}: {len(corrupt)} chunks of runs are corrupt; call `tdint campaign FILE "
            f"-o {Path(store.name).parent}` again, which runs them again"
        )


def check_same(store: Store, identity: Identity) -> list[str]:
    """Check that a store contains the runs of a campaign.

    Returns
    -------
    list of str
        A message if another version of tdint created the store; otherwise empty.

    Raises
    ------
    AnotherStudyError
        The store contains another campaign; the message has a line per difference.
    """
    # An empty list of `inventory_files` represents a store without an inventory.
    if identity.fingerprint != store.meta("fingerprint"):
        differences_text = all_differences(
            store.compared_values(),
            identity.compared_values,
            ("the store", f"this {identity.study_type}"),
            are_shards=bool(store.shards()),
            has_new_inventory=store.inventory_files() not in ([], sorted(identity.files.values())),
        )
        changed = ""
        if identity.study_type == "campaign" and not obstacle_to_reuse(store, identity):
            changed = "--changed to keep the results of unchanged records and buildings, "
        raise schema.AnotherStudyError(
            f"{store.name}: contains another {identity.study_type}; specify another directory with "
            f"-o, {changed}or --overwrite to start again\n"
            f"{differences_text}"
        )
    version = store.meta("version")
    if version == __version__:
        return []
    return [f"{store.name}: created by tdint {version}, this is tdint {__version__}"]


def obstacle_to_reuse(store: Store, identity: Identity) -> str:
    """Return the reason for which no result of a store can be used in a campaign with other records
    or buildings; empty if there is none."""
    if identity.building_numbers is not None or store.shards():
        return "the directory contains a part of a campaign (--shard)"
    if store.settings().keys() >= {"tolerance"} and store.parameters()["tolerance"] is not None:
        return "with `tolerance`, the time step of a building depends on all its records"
    if (version := store.meta("version")) != __version__:
        return f"it was created by tdint {version}, this is tdint {__version__}"
    labels = "the store", "this campaign"
    lines = differences(store.settings(), identity.settings, "setting", labels)
    lines += differences(store.code(), identity.code, "plug-in", labels)
    return "; ".join(lines)


def remove_store(file: Path) -> None:
    """Remove the file of a store and its log files. The caller has locked the directory.

    Raises
    ------
    OutputError
        The store cannot be removed, or is an input of the command.
    """
    refuse_protected([file])
    for part in (file, *logs_of(file)):
        try:
            part.unlink(missing_ok=True)
        except OSError as error:
            reason = error.strerror or error
            raise OutputError(f"{part}: cannot remove the file: {reason}") from None


def logs_of(file: Path) -> list[Path]:
    """Return the paths of the files that SQLite creates next to the file of a store."""
    return [file.with_name(file.name + suffix) for suffix in ("-wal", "-shm", "-journal")]
