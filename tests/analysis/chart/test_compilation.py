"""Methods compiled side by side: only what is missing, and none the worse if the other process fails."""

from __future__ import annotations

import subprocess

import pytest

from tdint.analysis.chart import compilation
from tdint.analysis.chart.compilation import compile_methods
from tdint.analysis.run.workspace import compile_all
from tdint.kernels.compiling import cache_folder
from tdint.methods.catalogue import parse

METHODS = [parse(name) for name in ("newmark-average", "hht", "impulse4", "exact")]


@pytest.fixture
def started(monkeypatch):
    """The command lines of the processes that are started."""
    commands = []

    class Process(subprocess.Popen):
        def __init__(self, command, **options):
            commands.append(command)
            super().__init__(command, **options)

    monkeypatch.setattr(compilation.subprocess, "Popen", Process)
    return commands


def test_what_is_in_the_cache_is_seen_there():
    if cache_folder() is None:
        pytest.skip("no folder to keep compiled kernels in")
    for method in METHODS:
        compile_all(method)
        assert compilation._is_cached(method.family.step)


def test_nothing_is_started_where_all_is_in_the_cache(started):
    for method in METHODS:
        compile_all(method)
    told = []
    compile_methods(METHODS, told.append)
    assert told == [0.0, 0.25, 0.5, 0.75]
    assert started == [] or cache_folder() is None


@pytest.mark.parametrize("fails", [False, True])
def test_another_process_takes_all_but_the_first_family(started, monkeypatch, fails):
    if cache_folder() is None:
        pytest.skip("no folder to keep compiled kernels in")
    monkeypatch.setattr(compilation, "_is_cached", lambda kernel: False)
    monkeypatch.setattr(compilation.os, "cpu_count", lambda: 2)
    if fails:
        monkeypatch.setattr(compilation, "_CODE", "raise SystemExit(1)")
    compile_methods(METHODS, lambda part: None)
    (command,) = started
    assert command[3:] == [METHODS[2].label, METHODS[3].label]  # one per family; the first is compiled here


def test_one_missing_family_is_compiled_here(started, monkeypatch):
    monkeypatch.setattr(compilation, "_is_cached", lambda kernel: False)
    compile_methods(METHODS[:2], lambda part: None)
    assert started == []
