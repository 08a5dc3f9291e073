"""Hostile working directories, no home, caches of others: nothing of theirs is run, everything
still works."""

import os
import stat

import platformdirs
import pytest
from click.testing import CliRunner

from tdint.system import cache_home
from tdint_cli.main import cli

TRAP = "open('trapped', 'w').close()\nraise SystemExit('trapped')\n"
MODULES = ("numpy", "scipy", "numba", "obspy", "click", "yaml", "json", "tdint")


@pytest.fixture
def hostile(folder):
    """A working directory with modules of its own, and settings of pictures."""
    for name in MODULES:
        (folder / f"{name}.py").write_text(TRAP)
    (folder / "matplotlibrc").write_text(
        "text.usetex: True\nfont.size: 30\nsavefig.dpi: 20\nno.such.key: 1\n"
    )
    yield folder
    assert not (folder / "trapped").exists()


def test_a_figure_in_a_hostile_working_directory(hostile, start):
    """Its matplotlibrc changes nothing."""
    code, _, words = start("modes", "model.yaml", "-o", "b.csv", "--plot=b.png").end()
    assert code == 0, words
    (hostile / "matplotlibrc").unlink()
    assert (
        CliRunner().invoke(cli, ["modes", "model.yaml", "-o", "a.csv", "--plot=a.png"]).exit_code
        == 0
    )
    assert (hostile / "a.png").read_bytes() == (hostile / "b.png").read_bytes()


@pytest.mark.slow
def test_a_process_that_compiles_in_a_hostile_working_directory(hostile, start):
    """It is started where the cache is empty."""
    code, _, words = start("info", "r0.csv", TDINT_CACHE_DIR=str(hostile.parent / "cache")).end(
        300.0
    )
    assert (code, "note: compiling 1 time loop" in words) == (0, True), words


@pytest.mark.slow
def test_a_long_command_in_a_hostile_working_directory(hostile, start):
    few = ("--method", "newmark-average,hht", "--halvings", "2", "--duration", "1", "--no-cache")
    code, _, words = start("chart", "model.yaml", *few).end(300.0)
    assert code == 0, words


def test_a_command_without_a_home_in_a_hostile_working_directory(hostile, start):
    """No module of the directory is run. Kernels are taken from elsewhere: that they compile there
    is asked above."""
    nowhere = {"HOME": "/nonexistent", "XDG_CACHE_HOME": None, "TDINT_CACHE_DIR": None}
    nowhere["TDINT_KERNELS_DIR"] = os.environ["TDINT_CACHE_DIR"]
    code, out, words = start("info", "r0.csv", **nowhere).end(300.0)
    assert code == 0, words
    assert out.count("\n") == 2


# Compiles; whose folder is trusted is asked in tests/kernels/test_compiling.py, too.
@pytest.mark.slow
@pytest.mark.parametrize("owner", ["everyone", "another user"])
def test_a_cache_of_other_users_is_not_used(folder, start, owner):
    cache = folder.parent / "cache"
    cache.mkdir()
    if owner == "everyone":
        cache.chmod(0o777)
    elif not hasattr(os, "getuid") or os.getuid() != 0:
        pytest.skip("only root can give a folder away")
    else:
        os.chown(cache, 12345, -1)
    code, _, words = start("info", "r0.csv", TDINT_CACHE_DIR=str(cache)).end(300.0)
    assert code == 0, words
    assert not [path for path in cache.rglob("*") if path.is_file()]
    assert owner == "everyone" or not cache.stat().st_mode & stat.S_IWOTH


@pytest.mark.parametrize("chosen", [None, "", "relative", "/somewhere/else"])
def test_the_cache_is_in_the_directory_of_the_platform(monkeypatch, chosen):
    """On Linux without the import of platformdirs, which is to say the same."""
    monkeypatch.delenv("TDINT_CACHE_DIR", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    if chosen is not None:
        monkeypatch.setenv("XDG_CACHE_HOME", chosen)
    if chosen != "relative":  # passed over by the specification, taken by older platformdirs
        assert cache_home() == platformdirs.user_cache_path("tdint", appauthor=False)
    assert cache_home().is_absolute()
