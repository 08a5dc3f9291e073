"""An earlier result stays complete until the new one is complete."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from tdint.errors import write_out_controls
from tdint.files import write_files
from tdint.system import cache_subfolder, hold_signals


def test_new_files_are_never_next_to_earlier_ones(tmp_path, monkeypatch):
    """The process is killed (an exception without cleanup) before the second file is renamed."""
    files = [tmp_path / name for name in ("a.csv", "b.csv")]
    write_files(dict.fromkeys(files, b"old"), overwrite=False)
    replace, contents = Path.replace, []

    def watched(source, target):
        contents.append([file.read_bytes() for file in files if file.exists()])
        return replace(source, target)

    monkeypatch.setattr(Path, "replace", watched)
    write_files(dict.fromkeys(files, b"new"), overwrite=True)
    assert contents == [[], [b"new"]]
    assert [file.read_bytes() for file in files] == [b"new", b"new"]


def test_error_before_the_renaming_changes_nothing(tmp_path):
    files = [tmp_path / name for name in ("a.csv", "b.csv")]
    write_files(dict.fromkeys(files, b"old"), overwrite=False)

    def fail(stream):
        stream.write(b"half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_files({files[0]: b"new", files[1]: fail}, overwrite=True)
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == {
        "a.csv": b"old",
        "b.csv": b"old",
    }


def test_complete_file_is_renamed_with_the_others_and_stale_files_are_removed(tmp_path):
    store, table, other = (tmp_path / name for name in ("s.sqlite", "t.csv", "old.csv"))
    for file in (store, table, other):
        file.write_bytes(b"old")
    new_store = tmp_path / "s.sqlite.new"
    new_store.write_bytes(b"new")
    write_files({table: b"new"}, overwrite=True, stale={other: ""}, complete={store: new_store})
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == {
        "s.sqlite": b"new",
        "t.csv": b"new",
    }


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_is_handled_after_the_block(number):
    received = []
    before = signal.signal(number, lambda number, _: received.append(number))
    try:
        with hold_signals():
            os.kill(os.getpid(), number)
            assert received == []
        assert received == [number]
    finally:
        signal.signal(number, before)


def test_cache_directories_are_private_for_any_umask(tmp_path, monkeypatch):
    monkeypatch.setenv("TDINT_CACHE_DIR", str(tmp_path / "a" / "b"))
    before = os.umask(0)
    try:
        folder = cache_subfolder("kernels-x")
    finally:
        os.umask(before)
    assert folder is not None and cache_subfolder("kernels-x") == folder
    modes = [
        oct(path.stat().st_mode & 0o777) for path in (folder, folder.parent, folder.parents[1])
    ]
    assert modes == ["0o700"] * 3


@pytest.mark.parametrize(
    "character",
    [
        "\u202e",
        "\u2066",
        "\u200f",
        "\x1b",
        "\x85",
        "\n",
        "\u200b",
        "\ufeff",
        "\ufe0f",
        "\U000e0041",
    ],
)
def test_control_characters_are_written_out(character):
    text = write_out_controls(f"a{character}b")
    assert text == f"a{character!a}b".replace("'", "") and text.isascii()
    assert write_out_controls("a\nb", keep="\n") == "a\nb"
