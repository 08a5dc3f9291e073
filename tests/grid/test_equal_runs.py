"""Runs of a stored case that must be equal: to the bit, or to rounding for interpreted loops."""

from dataclasses import fields, replace
from itertools import count

import numpy as np
import pytest

import tdint
from grid.axes import build
from grid.judge import STEPS, attempt, model_of, motion_of
from grid.test_grid import CASES, LABELS
from registered import plain as interpreted  # noqa: F401
from selection import every

_TOLERANCE = 1e-9
"""Largest difference of interpreted and compiled loops, divided by the largest value."""
_NEGLIGIBLE = 1e-15  # m, N or J: differences of residual drifts after a motion has decayed


def completed_run(number, start):
    """Return the model, motion and options of a case with a method from `start` on that completes
    the case, and its response; None if the model is refused."""
    row, seed, *_ = CASES[number]
    case = build(row, seed)
    model, record = model_of(case), motion_of(case)
    if model is None:
        return None
    for i in count(start):
        method, samples = LABELS[i % len(LABELS)], STEPS[(number + i) % len(STEPS)]
        options = {"dt": samples * case.interval, "duration": case.duration, "check": False}
        response = attempt(model, record, method, **options)
        if not isinstance(response, tuple):
            return model, record, {"method": method, **options}, response


def values_of(results):
    """Return the arrays and numbers of peaks or energies by name."""
    return {field.name: np.asarray(getattr(results, field.name)) for field in fields(results)}


def assert_equal(result, expected):
    """Assert that peaks and energies have equal bits."""
    for part in ("stories", "energy"):
        reported, wanted = values_of(getattr(result, part)), values_of(getattr(expected, part))
        for name, value in wanted.items():
            assert np.array_equal(reported[name], value, equal_nan=True), (part, name)


def changes_by_rounding(model, record, options):
    """Return the largest change of each peak and energy, by name, if all masses change by 1e-16 to
    1e-12 of their values.

    A dashpot with a power of the velocity and elements that slide let rounding grow to 4e-9 m
    within 2 s (case 47): rounding can add an iteration for the forces of a step.
    """
    changes = {}
    expected = tdint.run(model, record, **options)
    for exponent in range(12, 17):
        for change in (10.0**-exponent, -(10.0**-exponent)):
            stories = [replace(story, mass=story.mass * (1 + change)) for story in model.stories]
            other = tdint.run(replace(model, stories=tuple(stories)), record, **options)
            for part in ("stories", "energy"):
                wanted = values_of(getattr(expected, part))
                for name, value in values_of(getattr(other, part)).items():
                    difference = np.max(np.abs(np.nan_to_num(value - wanted[name])), initial=0.0)
                    changes[name] = max(changes.get(name, 0.0), difference)
    return changes


def assert_close(result, expected, *scene):
    """Assert that peaks and energies are equal to rounding; `scene` are the arguments of
    `changes_by_rounding`."""
    peaks, energies = values_of(expected.stories), values_of(expected.energy)
    largest_energy = max(map(np.max, energies.values()))
    for part, wanted in (("stories", peaks), ("energy", energies)):
        reported = values_of(getattr(result, part))
        for name, value in wanted.items():
            size = np.max(np.abs(np.nan_to_num(value)), initial=0.0)
            difference = np.max(np.abs(np.nan_to_num(reported[name] - value)), initial=0.0)
            allowed = max(_TOLERANCE * (size if part == "stories" else largest_energy), _NEGLIGIBLE)
            if difference > allowed and scene:
                allowed = 100 * changes_by_rounding(*scene)[name]
            assert difference <= allowed, (part, name)


@pytest.mark.parametrize("number", every(16, range(len(CASES))))
def test_equal_bits(number):
    """`run`, `run_case` and `run_many`, with and without history.

    The elements of a story are moved to its drift when energies are summed, which a history does at
    each step. Peaks of such buildings are therefore equal to rounding only.
    """
    has_elements = CASES[number][0]["elements"] != "one"
    completed = completed_run(number, 7 * number)
    if completed is None:
        return
    model, record, options, expected = completed
    scene = model, record, {**options}
    assert_same = (lambda *both: assert_close(*both, *scene)) if has_elements else assert_equal
    method = options.pop("method")
    prepared = tdint.prepare(model, record, method=method)
    assert_equal(tdint.run_case(prepared, **options), expected)
    assert_same(tdint.run_case(prepared, history=True, **options), expected)
    assert_same(tdint.run(model, record, method=method, history=True, **options), expected)
    if record is None:
        return
    many = tdint.run_many(model, record, scales=(0.5, 1.0), method=method, **options)
    for name, value in values_of(expected.stories).items():
        if name != "height":
            assert np.array_equal(getattr(many.stories, name)[1], value, equal_nan=True), name


@pytest.mark.parametrize("number", range(0, len(CASES), 25))
def test_events_of_a_sequence(number):
    """The first event of a sequence is the run of its record, and a record alone is a sequence."""
    row, seed, *_ = CASES[number]
    case = build(row, seed)
    model, record = model_of(case), motion_of(case)
    if model is None or record is None:
        return
    prepared, options = tdint.prepare(model, method="impulse4"), {"dt": record.dt, "check": False}
    first = tdint.run(model, record, method="impulse4", **options)
    assert_equal(tdint.run_sequence(prepared, [record], **options), first)
    both = tdint.run_sequence(prepared, [record, record.scaled(-0.5)], rest=0.5, **options)
    for name in ("peak_drift", "peak_shear", "peak_absolute_acceleration"):
        assert np.all(getattr(both.stories, name) >= getattr(first.stories, name))


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(CASES)))
def test_interpreted_loops(number, request):
    completed = completed_run(number, 11 * number)
    if completed is None:
        return
    model, record, options, expected = completed
    request.getfixturevalue("interpreted")
    assert_close(tdint.run(model, record, **options), expected, model, record, options)
