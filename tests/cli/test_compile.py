"""`tdint compile`, with a single small kernel instead of all kernels."""

from pathlib import Path

import pytest

from small_kernel import scaled
from tdint.kernels.building import store
from tdint.kernels.building.compilable import ANY, EVERYTHING
from tdint.kernels.building.target import named
from tdint.kernels.oscillators.elastic import peaks
from tdint.methods.catalogue import parse as parse_method
from tdint.model.config.model_file import load_model
from tdint.response.runs import analysis_kernels


@pytest.fixture(autouse=True)
def only_a_small_kernel(monkeypatch):
    monkeypatch.setattr(analysis_kernels, "all_kernels", lambda: [(scaled, EVERYTHING)])


@pytest.mark.long
def test_everything_is_compiled_once_for_each_processor(tdint, folder, monkeypatch):
    """--show lists the objects that are used, and --clean removes them."""
    result = tdint("compile --all --target native,x86-64-v2 -o shared/kernels", code=0)
    goal = f"shared/kernels/{store.folder_name()}"
    assert result.stderr.splitlines()[-1] == f"2 time loops compiled, in {goal}"
    names = [store.file_name(scaled.name, ANY, named(target)) for target in ("native", "x86-64-v2")]
    assert {file.name for file in (folder / goal).iterdir()} == set(names)
    again = tdint("compile", "--all", "-o", "shared/kernels")
    assert (again.exit_code, again.stderr) == (0, "All time loops are compiled already.\n")

    monkeypatch.setenv("TDINT_CACHE_DIR", str(folder / "cache"))
    assert (
        tdint("compile", "--all", "--show")
        .stdout.splitlines()[1]
        .endswith(f"{scaled.name},{ANY},,")
    )
    (folder / "cache").mkdir(mode=0o700)
    (folder / goal).rename(folder / "cache" / store.folder_name())
    (folder / "cache" / store.folder_name() / names[1]).unlink()
    (file,) = (folder / "cache").rglob("*.object")
    shown = tdint("compile", "--all", "--show").stdout
    assert shown == f"loop,form,object,origin\n{scaled.name},{ANY},{file},cache\n"
    monkeypatch.setenv("TDINT_KERNELS_DIR", str(folder / "cache"))
    assert tdint("compile", "--all", "--show").stdout.endswith(f"{file},TDINT_KERNELS_DIR\n")
    monkeypatch.delenv("TDINT_KERNELS_DIR")
    monkeypatch.setattr(store, "_PREBUILT", folder / "cache")
    assert tdint("compile", "--all", "--show").stdout.endswith(f"{file},wheel\n")
    assert tdint("compile", "--clean").stderr == "1 compiled time loop removed.\n"
    assert not file.exists()


def test_a_model_is_compiled_with_the_kernels_of_its_tables():
    model = load_model(Path(__file__).parents[2] / "configs" / "ten-story.yaml")
    assert peaks in [
        kernel for kernel, _ in analysis_kernels.kernels_of_model(model, parse_method("impulse4"))
    ]


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        ((), 2, "compile MODEL.yaml ... compile --all"),
        (("--all", "--target", "x87"), 2, "x87"),
        (("none.yaml",), 3, "none.yaml"),
        (("--all", "-o", "forced.yaml"), 6, "forced.yaml"),
    ],
)
def test_invalid_input_is_reported_in_one_line(tdint, folder, arguments, code, message):
    assert "Traceback" not in tdint.refused(message, "compile", *arguments, code=code).stderr
