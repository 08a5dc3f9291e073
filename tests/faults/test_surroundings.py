"""Hostile working directories, no home, caches of others: nothing of theirs is run, everything still works."""

import os
import stat

import pytest
from click.testing import CliRunner

from tdint_cli.main import cli

TRAP = "open('trapped', 'w').close()\nraise SystemExit('trapped')\n"
MODULES = ("numpy", "scipy", "numba", "obspy", "click", "yaml", "json", "tdint")


@pytest.mark.parametrize("compiled", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_modules_of_the_working_directory_are_not_run(folder, start, compiled):
    """With an empty cache a process that compiles is started, too."""
    for name in MODULES:
        (folder / f"{name}.py").write_text(TRAP)
    empty = {} if compiled else {"TDINT_CACHE_DIR": str(folder.parent / "cache")}
    code, _, words = start("info", "r0.csv", **empty).end(300.0)
    assert (code, "note: compiling 1 time loop" in words) == (0, not compiled), words
    assert not (folder / "trapped").exists()


@pytest.mark.slow
def test_modules_of_the_working_directory_are_not_run_by_a_long_command(folder, start):
    for name in MODULES:
        (folder / f"{name}.py").write_text(TRAP)
    few = ("--method", "newmark-average,hht", "--halvings", "2", "--duration", "1", "--no-cache")
    code, _, words = start("chart", "model.yaml", *few).end(300.0)
    assert code == 0, words
    assert not (folder / "trapped").exists()


def test_a_matplotlibrc_of_the_working_directory_changes_nothing(folder, start):
    assert CliRunner().invoke(cli, ["info", "r0.csv", "-o", "a.csv", "--plot=a.png"]).exit_code == 0
    (folder / "matplotlibrc").write_text("text.usetex: True\nfont.size: 30\nsavefig.dpi: 20\nno.such.key: 1\n")
    code, _, words = start("info", "r0.csv", "-o", "b.csv", "--plot=b.png").end()
    assert code == 0, words
    assert (folder / "a.png").read_bytes() == (folder / "b.png").read_bytes()


def test_without_a_home(folder, start):
    nowhere = {"HOME": "/nonexistent", "XDG_CACHE_HOME": None, "TDINT_CACHE_DIR": None}
    code, out, words = start("info", "r0.csv", **nowhere).end(300.0)
    assert code == 0, words
    assert out.count("\n") == 2


@pytest.mark.slow  # compiles; whose folder is trusted is asked in tests/kernels/test_compiling.py, too
def test_a_cache_that_others_may_write_to_is_not_used(folder, start):
    cache = folder.parent / "cache"
    cache.mkdir()
    cache.chmod(0o777)
    code, _, words = start("info", "r0.csv", TDINT_CACHE_DIR=str(cache)).end(300.0)
    assert code == 0, words
    kept = [path for path in cache.rglob("*") if path.is_file()]
    assert not kept


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() != 0, reason="only root can give a folder away")
def test_a_cache_of_another_user_is_not_used(folder, start):
    cache = folder.parent / "cache"
    cache.mkdir()
    os.chown(cache, 12345, -1)
    code, _, words = start("info", "r0.csv", TDINT_CACHE_DIR=str(cache)).end(300.0)
    assert code == 0, words
    assert not [path for path in cache.rglob("*") if path.is_file()]
    assert not cache.stat().st_mode & stat.S_IWOTH
