"""Methods that are rejected are not registered, also not by a second attempt."""

import os
import subprocess
import sys
from textwrap import dedent

import pytest

import tdint
from registered import forgotten  # noqa: F401 (fixture)
from tdint.errors import AnalysisError, UsageError
from tdint.kernels.building.sources import CODE
from tdint.methods import catalogue

METHOD = """\
from tdint.methods.single_step import FAMILY, newmark
from tdint.plugin import AnalysisError, Method


def coefficients():
    return newmark(0.25, 0.5)


METHODS = (
    Method(
        name="own-newmark",
        family=FAMILY,
        coefficients=coefficients,
        rho_inf=lambda: 1.0,
        source="Newmark (1959)",
    ),
)
"""
"""Plug-in with Newmark's method."""


@pytest.fixture
def write(tmp_path):
    """Return a function that writes METHOD with one replacement to a file and returns its path."""

    def write_changed(before="", after=""):
        assert before in METHOD
        file = tmp_path / "own.py"
        file.write_text(METHOD.replace(before, after) if before else METHOD)
        return str(file)

    return write_changed


@pytest.mark.parametrize(
    ("exception", "expected"),
    [
        ("AnalysisError('no coefficients')", AnalysisError),
        ("KeyboardInterrupt", KeyboardInterrupt),
        ("ValueError('no coefficients')", UsageError),
    ],
)
def test_method_is_not_registered_after_any_exception(write, exception, expected):
    file = write("return newmark(0.25, 0.5)", f"raise {exception}")
    for _ in range(2):
        with pytest.raises(expected):
            tdint.load_plugin(file)
        assert "own-newmark" not in catalogue.catalogue()


def test_method_is_not_registered_if_its_files_cannot_be_read(write, monkeypatch):
    """The hashes of the files are the last part of a registration."""

    def keep_code(self, noun, registered):
        raise OSError("disk error")

    file = write()
    with monkeypatch.context() as patch:
        patch.setattr("tdint.model.plugins.Origin.keep_code", keep_code)
        with pytest.raises(UsageError, match=r"own\.py: OSError: disk error"):
            tdint.load_plugin(file)
        assert "own-newmark" not in catalogue.catalogue()
    tdint.load_plugin(file)
    assert CODE["method own-newmark"].keys() == {"own.py"}


@pytest.mark.parametrize("value", [True, False])
@pytest.mark.parametrize("name", ["order", "stability_limit", "rho_inf"])
def test_true_and_false_are_not_numbers(write, name, value):
    line = "rho_inf=lambda: 1.0,"
    declaration = f"{name}=lambda: {value},"
    file = write(line, declaration if name == "rho_inf" else f"{line} {declaration}")
    with pytest.raises(UsageError, match=f"{name} must be of type (int|float), got {value}"):
        tdint.load_plugin(file)
    assert "own-newmark" not in catalogue.catalogue()


def test_integers_are_accepted_for_properties_of_type_float(write):
    tdint.load_plugin(write("rho_inf=lambda: 1.0", "rho_inf=lambda: 1"))
    assert catalogue.parse("own-newmark").rho_inf == 1


def test_method_of_standard_input_is_registered_without_file():
    """Python states the file name `<stdin>` for code from standard input."""
    script = METHOD + dedent(
        """
        from tdint.kernels.building.sources import CODE
        from tdint.methods import catalogue

        catalogue.register_method(METHODS[0])
        assert __file__ == "<stdin>"
        print(catalogue.parse("own-newmark").label, CODE["method own-newmark"])
        """
    )
    done = subprocess.run(
        [sys.executable, "-"],
        input=script,
        capture_output=True,
        text=True,
        env={**os.environ, "TDINT_KERNELS": "python"},
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "own-newmark {}\n"
