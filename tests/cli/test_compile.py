"""`tdint compile`, with one small kernel in place of all that there are."""

from __future__ import annotations

import pytest

from small_kernel import scaled
from tdint.analysis.run import compilation
from tdint.kernels.building import store
from tdint.kernels.building.target import named
from tdint.kernels.building.variant import EVERYTHING


@pytest.fixture(autouse=True)
def only_a_small_kernel(monkeypatch):
    monkeypatch.setattr(compilation, "of_everything", lambda: [(scaled, EVERYTHING)])


def test_everything_is_compiled_once_for_each_processor(tdint, folder):
    result = tdint("compile", "--all", "--target", "native,x86-64-v2", "-o", "shared/kernels")
    assert result.exit_code == 0, result.stderr
    goal = f"shared/kernels/{store.folder_name()}"
    assert result.stderr.splitlines()[-1] == f"2 time loops compiled, in {goal}"
    names = {store.file_name(scaled.name, EVERYTHING.text, named(target)) for target in ("native", "x86-64-v2")}
    assert {file.name for file in (folder / goal).iterdir()} == names
    again = tdint("compile", "--all", "-o", "shared/kernels")
    assert (again.exit_code, again.stderr) == (0, "All of it is compiled already.\n")


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ((), 2, "give a MODEL.yaml, or --all"),
        (("--all", "--target", "x87"), 2, "x87"),
        (("none.yaml",), 3, "none.yaml"),
        (("--all", "-o", "forced.yaml"), 6, "forced.yaml"),
    ],
)
def test_bad_input_is_one_line(tdint, folder, arguments, code, words):
    result = tdint("compile", *arguments)
    assert result.exit_code == code, result.stderr
    assert words in result.stderr
    assert "Traceback" not in result.stderr
