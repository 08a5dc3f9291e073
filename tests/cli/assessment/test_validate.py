"""`tdint validate`: the table of cases, and the exit code of a failing case."""

import csv
import dataclasses
import io
import re

import pytest

from tdint.assessment.validation import validation as cases
from tdint.assessment.validation.validation import compute_case


def test_all_cases_are_within_their_tolerances(tdint):
    result = tdint("validate")
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert len(rows) == len({row["case"] for row in rows}) >= 42
    assert all(row["within"] == "true" for row in rows)
    assert all(float(row["largest_difference"]) <= float(row["tolerance"]) for row in rows)
    assert result.stderr.endswith(
        f"{len(rows)} of {len(rows)} cases are within their tolerances.\n"
    )


def test_a_failing_case_causes_exit_code_5(tdint, tmp_path, monkeypatch):
    right = cases.textbook_cases()[:2]
    wrong = dataclasses.replace(right[0], published=(1.0, *right[0].published[1:]))
    monkeypatch.setattr(cases, "all_cases", lambda: (wrong, right[1]))
    out = tmp_path / "validation.csv"
    result = tdint("validate", "-o", out, code=5)
    assert re.search(r"chopra-E5\.1: .* 0\.968, .* 0\.0001", result.stderr)
    rows = list(csv.DictReader(io.StringIO(out.read_text())))
    assert [row["within"] for row in rows] == ["false", "true"]


@pytest.mark.parametrize(("relative", "expected"), [(False, (-0.2, 0.1)), (True, (-0.1, 0.02))])
def test_differences_are_absolute_or_relative(relative, expected):
    case = cases.textbook_cases()[0]
    two = dataclasses.replace(
        case, published=(-2.0, 5.0), computed=lambda: (-2.2, 5.1), relative=relative
    )
    assert compute_case(two).differences == pytest.approx(expected)
