"""Hostile working directories, a missing home directory and caches of other users: their code is
not executed, and commands work."""

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
    """Working directory with modules that have the names of packages, and settings of figures."""
    for name in MODULES:
        (folder / f"{name}.py").write_text(TRAP)
    (folder / "matplotlibrc").write_text(
        "text.usetex: True\nfont.size: 30\nsavefig.dpi: 20\nno.such.key: 1\n"
    )
    yield folder
    assert not (folder / "trapped").exists()


@pytest.mark.long
def test_a_figure_in_a_hostile_working_directory(hostile, start):
    """The file matplotlibrc in the working directory has no effect."""
    code, _, messages = start("modes", "model.yaml", "-o", "b.csv", "--plot=b.png").end()
    assert code == 0, messages
    (hostile / "matplotlibrc").unlink()
    assert (
        CliRunner().invoke(cli, ["modes", "model.yaml", "-o", "a.csv", "--plot=a.png"]).exit_code
        == 0
    )
    assert (hostile / "a.png").read_bytes() == (hostile / "b.png").read_bytes()


@pytest.mark.slow
def test_a_process_that_compiles_in_a_hostile_working_directory(hostile, start):
    """The compiling process is started, because the cache is empty."""
    code, _, messages = start("info", "r0.csv", TDINT_CACHE_DIR=str(hostile.parent / "cache")).end(
        300.0
    )
    assert (code, "note: compiling 1 time loop" in messages) == (0, True), messages


@pytest.mark.slow
def test_a_long_command_in_a_hostile_working_directory(hostile, start):
    options = (
        "--method", "newmark-average,hht", "--halvings", "2", "--duration", "1",
        "--no-cache",
    )  # fmt: skip
    code, _, messages = start("chart", "model.yaml", *options).end(300.0)
    assert code == 0, messages


@pytest.mark.long
def test_a_command_without_a_home_in_a_hostile_working_directory(hostile, start):
    """No module of the directory is executed. The kernels are in another directory; a test above
    compiles kernels."""
    environment = {"HOME": "/nonexistent", "XDG_CACHE_HOME": None, "TDINT_CACHE_DIR": None}
    environment["TDINT_KERNELS_DIR"] = os.environ["TDINT_CACHE_DIR"]
    code, out, messages = start("info", "r0.csv", **environment).end(300.0)
    assert code == 0, messages
    assert out.count("\n") == 2


# This test compiles. tests/kernels/test_compiling.py also tests which directories are trusted.
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
    code, _, messages = start("info", "r0.csv", TDINT_CACHE_DIR=str(cache)).end(300.0)
    assert code == 0, messages
    assert not [path for path in cache.rglob("*") if path.is_file()]
    assert owner == "everyone" or not cache.stat().st_mode & stat.S_IWOTH


@pytest.mark.parametrize("chosen", [None, "", "relative", "/somewhere/else"])
def test_the_cache_is_in_the_directory_of_the_platform(monkeypatch, chosen):
    """On Linux, the directory is determined without importing platformdirs, with the same
    result."""
    monkeypatch.delenv("TDINT_CACHE_DIR", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    if chosen is not None:
        monkeypatch.setenv("XDG_CACHE_HOME", chosen)
    if chosen != "relative":  # ignored by the specification, but used by older platformdirs
        assert cache_home() == platformdirs.user_cache_path("tdint", appauthor=False)
    assert cache_home().is_absolute()
