"""The pictures of the READMEs are drawn from what is there: by a digest, not by pixels."""

import re

import pytest

import pictures
import readmes


def test_no_picture_is_out_of_date():
    """Else: python tests/pictures.py."""
    assert pictures.out_of_date() == []


def test_every_picture_of_configs_is_declared_and_shown():
    shown = {
        name
        for file in readmes.files()
        for name in re.findall(r"\]\((?:[\w./]*/)?([\w-]+\.png)\)", file.read_text())
    }
    assert {file.name for file in pictures.FOLDER.glob("*.png")} == set(pictures.PICTURES)
    assert set(pictures.PICTURES) <= shown


@pytest.mark.parametrize("changed", ["style.py", "assessment.py"])
def test_what_draws_a_picture_counts(tmp_path, monkeypatch, changed):
    """Its own module, and what that imports."""
    before = pictures.digest(pictures.PICTURES["failures.png"])
    for file in pictures._FIGURES.glob("*.py"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    monkeypatch.setattr(pictures, "_FIGURES", tmp_path)
    assert pictures.digest(pictures.PICTURES["failures.png"]) == before
    (tmp_path / changed).write_text((tmp_path / changed).read_text() + "another = 1\n")
    assert pictures.digest(pictures.PICTURES["failures.png"]) != before


def test_a_new_method_and_another_input_count(monkeypatch):
    one = pictures.PICTURES["failures.png"]
    before = pictures.digest(one)
    monkeypatch.setattr(pictures, "catalogue", lambda: {"another": None})
    assert pictures.digest(one) != before
    files = {
        file.name for file in pictures._inputs(pictures.PICTURES["kaikoura-frame.png"].command)
    }
    assert files == {"kaikoura-frame.yaml", "WTMC.mseed"}
    names = {
        file.name for file in pictures._inputs(pictures.PICTURES["design-spectrum.png"].command)
    }
    assert {
        "design-spectrum.csv",
        "firm-soil.mseed",
        "near-fault.mseed",
        "soft-soil.mseed",
    } == names
