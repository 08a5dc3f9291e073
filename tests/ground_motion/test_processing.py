"""Processing steps compared with closed forms; only requested steps are applied, and each step is
noted."""

import math
from contextlib import nullcontext
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_trapezoid
from scipy.signal import butter, sosfilt

from selection import every
from tdint.errors import RecordError, UsageError
from tdint.ground_motion.choice import Processing, parse_pad, parse_trim
from tdint.ground_motion.processing_steps import process, processed
from tdint.ground_motion.record import Input, Record

DT = 0.01


def record(samples, dt=DT, start="2024-01-01T00:00:10.000000Z"):
    return Record(
        np.asarray(samples, dtype=float),
        dt,
        start,
        "TD.X..HNE",
        "HNE",
        "x.mseed",
        ("before",),
        "g (file)",
    )


def noise(size=2000, seed=1):
    return record(np.random.default_rng(seed).standard_normal(size))


def sine(frequency, dt=DT, seconds=30.0):
    return record(np.sin(2.0 * math.pi * frequency * dt * np.arange(round(seconds / dt) + 1)), dt)


def middle(samples):
    """Return the third in the middle, away from the ends."""
    return samples[samples.size // 3 : 2 * samples.size // 3]


def gain(corner, frequency, corners, dt=DT):
    """Return the amplitude of a sine after a low-pass Butterworth filter (bilinear transform) in
    both directions."""
    ratio = math.tan(math.pi * frequency * dt) / math.tan(math.pi * corner * dt)
    return 1.0 / (1.0 + ratio ** (2 * corners))


# ---- All steps


EVERYTHING = {
    "trim": (2.0, 15.0), "baseline": "linear", "pad": (3.0, 5.0), "highpass": 0.2, "lowpass": 20.0,
    "filter_order": 3, "resample": 0.02,
}  # fmt: skip


def test_order_of_processing_steps_is_fixed():
    before = noise()
    one_by_one = before
    for step in (
        ["trim"],
        ["baseline"],
        ["pad", "highpass", "lowpass", "filter_order"],
        ["resample"],
    ):
        one_by_one = process(one_by_one, **{name: EVERYTHING[name] for name in step})
    at_once = process(before, **dict(reversed(EVERYTHING.items())))
    np.testing.assert_array_equal(at_once.acceleration, one_by_one.acceleration)
    assert at_once.processing == one_by_one.processing
    assert process(before) is before
    assert not Processing()


def test_every_step_is_noted_and_other_attributes_are_kept():
    before = replace(noise(), inputs=(Input("x", "00"),))
    copy = before.acceleration.copy()
    after = process(before, **EVERYTHING)
    np.testing.assert_array_equal(before.acceleration, copy)
    assert after.notes == ("before", *after.processing)
    assert [note.split()[0] for note in after.processing] == [
        "trimmed", "a", "padded", "highpass", "resampled",
    ]  # fmt: skip
    assert (after.id, after.component, after.source, after.units) == (
        "TD.X..HNE",
        "HNE",
        "x.mseed",
        "g (file)",
    )
    assert (after.dt, after.start, after.inputs) == (
        0.02,
        "2024-01-01T00:00:09.000000Z",
        before.inputs,
    )
    assert process(replace(before, start=""), trim=(0.01, None)).start == ""
    with pytest.raises(FrozenInstanceError):
        after.dt = 1.0
    with pytest.raises(ValueError, match="read-only"):
        after.acceleration[0] = 1.0


@settings(max_examples=3, deadline=None)
@given(factor=st.floats(-3.0, 3.0), seed=st.integers(0, 99))
def test_processing_steps_are_linear(factor, seed):
    first, second = noise(seed=seed), noise(seed=seed + 100)
    both = process(
        record(first.acceleration + factor * second.acceleration), **EVERYTHING
    ).acceleration
    apart = [process(part, **EVERYTHING).acceleration for part in (first, second)]
    np.testing.assert_allclose(both, apart[0] + factor * apart[1], atol=1e-10)


# Trim, baseline, pad


@pytest.mark.parametrize(
    ("part", "first", "last"),
    [
        ((0.5, 1.0), 50, 100), ((None, 1.0), 0, 100), ((0.5, None), 50, 200), ((0.0, 2.0), 0, 200),
        ((0.495, 0.515), 50, 51),
    ],
)  # fmt: skip
def test_trim_keeps_samples_within_bounds(part, first, last):
    before = record(np.arange(201.0))
    after = process(before, trim=part)
    np.testing.assert_array_equal(after.acceleration, np.arange(first, last + 1.0))
    assert after.start == f"2024-01-01T00:00:{10 + first / 100:.6f}Z"


@pytest.mark.parametrize("dt", [0.005, 1.0 / 128.0, 31.026 / 7339.0, 0.1])
def test_trim_bounds_are_tolerant_to_rounding(dt):
    before = record(np.arange(1001.0), dt)
    for first in range(0, 990, 7):
        after = process(before, trim=(first * dt, (first + 10) * dt))
        np.testing.assert_array_equal(after.acceleration, np.arange(first, first + 11.0))


def test_constant_baseline_is_mean():
    after = process(record(noise().acceleration + 5.0), baseline="constant").acceleration
    assert abs(after.mean()) < 1e-14
    np.testing.assert_allclose(
        after, noise().acceleration - noise().acceleration.mean(), atol=1e-13
    )


def test_linear_baseline_is_orthogonal_to_lines():
    t = np.arange(2000.0)
    after = process(noise(), baseline="linear").acceleration
    assert abs(np.dot(after, np.ones_like(t))) < 1e-10
    assert abs(np.dot(after, t)) < 1e-7
    np.testing.assert_allclose(
        process(record(3.0 - 0.02 * t), baseline="linear").acceleration, 0.0, atol=1e-12
    )


@pytest.mark.parametrize(
    ("pad", "before", "after"), [(0.5, 50, 50), ((0.0, 1.0), 0, 100), ((0.014, 0.0), 2, 0)]
)
def test_pad_adds_zeros(pad, before, after):
    done = process(noise(), pad=pad).acceleration
    np.testing.assert_array_equal(
        done, np.concatenate([np.zeros(before), noise().acceleration, np.zeros(after)])
    )


# Filters


def inner(samples, before):
    """Return the part of padded samples at the times of a record."""
    first = (samples.size - before.acceleration.size) // 2
    return samples[first : first + before.acceleration.size]


def filtered_between_long_zeros(samples, sections, zeros):
    """Return samples after both passes of a filter, with so many zeros on either side."""
    forwards = sosfilt(sections, np.pad(samples, zeros))
    return sosfilt(sections, forwards[::-1])[::-1]


def ground_peaks(acceleration, dt):
    """Return the peak velocity and displacement of a motion from rest."""
    velocity = cumulative_trapezoid(acceleration, dx=dt, initial=0.0)
    displacement = cumulative_trapezoid(velocity, dx=dt, initial=0.0)
    return np.max(np.abs(velocity)), np.max(np.abs(displacement))


@pytest.mark.parametrize("order", [2, 4, 8])
@pytest.mark.parametrize("corners", [(0.05, None), (0.1, 25.0), (0.5, 10.0)])
def test_filters_add_the_padding_that_they_need(corners, order):
    """Butterworth filters of scipy on a record between zeros for twenty orders over the corner."""
    low, high = corners
    before = noise(2000)
    found = process(before, highpass=low, lowpass=high, filter_order=order)
    sections = np.concatenate(
        [
            butter(order, corner, kind, fs=1.0 / DT, output="sos")
            for kind, corner in (("highpass", low), ("lowpass", high))
            if corner
        ]
    )
    zeros = round(20.0 * order / low / DT)
    expected = filtered_between_long_zeros(before.acceleration, sections, zeros)
    np.testing.assert_allclose(
        ground_peaks(found.acceleration, DT), ground_peaks(expected, DT), rtol=1e-3
    )
    added = (found.acceleration.size - before.acceleration.size) * DT
    assert 2.0 * 1.4 / low < added < 2.0 * 3.0 * order / low
    assert [note.split()[0] for note in found.processing] == ["padded", "highpass"]


def test_explicit_padding_stays():
    before = noise(2000)
    found = process(before, highpass=0.1, pad=(3.0, 7.0))
    assert found.acceleration.size == before.acceleration.size + 1000


def test_times_are_multiplied_by_a_factor():
    before = noise()
    found = processed(before, Processing(time_scale=0.2))
    np.testing.assert_array_equal(found.acceleration, before.acceleration)
    assert found.dt == pytest.approx(0.2 * DT)
    assert "times multiplied by 0.2" in found.processing[-1]
    with pytest.raises(UsageError, match="time_scale must be a positive number"):
        Processing(time_scale=0.0)


@pytest.mark.parametrize("corners", [None, 1, 2, 8])
@pytest.mark.parametrize("frequency", [0.5, 2.0, 5.0, 12.0])
def test_filter_changes_amplitude_but_not_phase_of_sine(frequency, corners):
    before = sine(frequency, seconds=90.0)
    low = process(before, lowpass=5.0, filter_order=corners).acceleration
    high = process(before, highpass=5.0, filter_order=corners).acceleration
    kept = gain(5.0, frequency, corners or 4)
    sine_before = middle(before.acceleration)
    np.testing.assert_allclose(middle(inner(low, before)), kept * sine_before, atol=1e-9)
    np.testing.assert_allclose(middle(inner(high, before)), (1.0 - kept) * sine_before, atol=1e-9)


@pytest.mark.parametrize("filter_type", ["highpass", "lowpass"])
@pytest.mark.parametrize(("corner", "corners"), [(0.05, 4), (2.0, 4), (49.0, 10), (0.001, 1)])
def test_filter_does_not_depend_on_zero_padding(filter_type, corner, corners):
    """The filter treats the motion as zero outside its samples, for any number of zeros that the
    record contains."""
    alone = process(noise(), **{filter_type: corner}, filter_order=corners).acceleration
    padded = process(
        noise(), pad=(20.0, 500.0), **{filter_type: corner}, filter_order=corners
    ).acceleration
    alone, padded = inner(alone, noise()), padded[2000 : 2000 + noise().acceleration.size]
    np.testing.assert_allclose(alone, padded, atol=1e-10 * np.max(np.abs(alone)))


# Resampling


@pytest.mark.parametrize("parts", [2, 3, 10])
def test_refined_resampling_keeps_old_samples(parts):
    before = noise(600)
    done = process(before, resample=DT / parts)
    assert done.acceleration.size == parts * 599 + 1
    np.testing.assert_allclose(done.acceleration[::parts], before.acceleration, atol=1e-13)
    assert process(done, resample=DT / parts) is done


@pytest.mark.parametrize("new", every(2, [0.0025, 0.004, 1.0 / 128.0, 0.02, 0.025, 0.0137, 0.1]))
def test_resampling_keeps_sine_below_nyquist_frequencies(new):
    """The sine is kept up to 0.9 of the old Nyquist frequency for a shorter interval, or 0.8 of the
    new one for a longer interval."""
    frequency = min(0.9 * 0.5 / DT, 0.8 * 0.5 / new)
    done = process(sine(frequency), resample=new)
    exact = np.sin(2.0 * math.pi * frequency * new * np.arange(done.acceleration.size))
    assert f"frequencies up to {frequency:.4g} Hz kept" in done.notes[-1]
    np.testing.assert_allclose(middle(done.acceleration), middle(exact), atol=2e-5)


@pytest.mark.parametrize("new", every(2, [0.02, 0.025, 0.0137, 0.1]))
@pytest.mark.parametrize("part", [1.0, 1.1, 1.3])
def test_resampling_removes_frequencies_above_nyquist_without_aliasing(new, part):
    done = process(sine(part * 0.5 / new), resample=new)
    np.testing.assert_allclose(middle(done.acceleration), 0.0, atol=2e-5)


@pytest.mark.parametrize("new", [0.004, 31.026 / 7339.0, 0.02, 0.03])
def test_resampling_keeps_constant_and_duration(new):
    done = process(record(np.ones(1501)), resample=new)
    np.testing.assert_allclose(middle(done.acceleration), 1.0, atol=1e-13)
    assert 15.0 - new < done.duration <= 15.0 + 1e-9


# ---- Invalid values


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"trim": (0.0, 20.1)},
            r"x.mseed: TD.X..HNE: trim must be within the record, .* 19.99 s, got 0:20.1 s",
        ),
        ({"trim": (30.0, None)}, "trim must be within the record"),
        ({"trim": (1.001, 1.009)}, "trim .*two samples .* 0.01 s, got 1.001:1.009 s"),
        ({"lowpass": 50.0}, "lowpass .*50 Hz, got 50 Hz"),
        ({"highpass": 60.0}, "highpass .*50 Hz, got 60 Hz"),
        ({"highpass": 1e-4}, "highpass .*0.001 Hz .*0.01 s, got 0.0001 Hz"),
        ({"resample": 20.0}, "at least two samples; .*20 s"),
        ({"resample": 1e-9}, "must have at most 50000000 samples"),
        ({"pad": 1e9}, "pad must add at most 50000000 samples, got 200000000000"),
        ({"pad": 8e307}, "pad must add at most 50000000 samples, got 2000000000000000000"),
    ],
)
def test_incompatible_processing_is_refused(options, message):
    with pytest.raises(RecordError, match=message):
        process(noise(), **options)


@pytest.mark.parametrize(
    "options",
    [
        {"trim": (2.0, 1.0)}, {"trim": (-1.0, 1.0)}, {"trim": (math.nan, 1.0)},
        {"trim": [None, None]}, {"baseline": "cubic"}, {"pad": -1.0}, {"pad": 0.0},
        {"pad": (1.0, -0.5)}, {"pad": math.nan}, {"pad": math.inf}, {"highpass": 0.0},
        {"lowpass": -1.0}, {"lowpass": math.inf}, {"highpass": 5.0, "lowpass": 5.0},
        {"highpass": 1.0, "filter_order": 0}, {"highpass": 1.0, "filter_order": 11},
        {"filter_order": 4}, {"resample": 0.0}, {"resample": math.nan},
    ],
)  # fmt: skip
def test_invalid_processing_values_are_refused(options):
    (name, *_), message = options, "(filter_order|trim|baseline|pad|highpass|lowpass|resample)"
    with pytest.raises(UsageError, match=message) as error:
        process(noise(), **options)
    assert name in str(error.value) or "filter_order" in str(error.value)


@pytest.mark.parametrize(
    ("parse", "text", "value"),
    [
        (parse_trim, "2:30", (2.0, 30.0)),
        (parse_trim, ":30", (None, 30.0)),
        (parse_trim, "2:", (2.0, None)),
        (parse_pad, "2.5", (2.5, 2.5)),
        (parse_pad, "1:2", (1.0, 2.0)),
        *((parse_trim, text, None) for text in ("2", "1:2:3", "a:b")),
        *((parse_pad, text, None) for text in ("1:", "")),
    ],
)
def test_processing_texts_are_parsed(parse, text, value):
    with pytest.raises(UsageError, match="must be") if value is None else nullcontext():
        assert parse(text) == value


def test_a_record_is_processed_by_the_keys_and_texts_of_a_model_file():
    keys = {"trim": "2:10", "pad": "1:2", "time_scale": 0.5}
    found = process(noise(), **keys)
    assert (found.dt, len(found.acceleration)) == (DT / 2, 801 + 300)
    expected = process(noise(), trim=(2.0, 10.0), pad=(1.0, 2.0))
    assert np.array_equal(found.acceleration, expected.acceleration)


def test_quadratic_baseline_is_orthogonal_to_parabolas():
    """The residual of a least-squares fit is orthogonal to 1, t and t^2, and is zero for a
    parabola."""
    t = np.arange(noise().acceleration.size, dtype=float)
    after = process(noise(), baseline="quadratic").acceleration
    scale = np.max(np.abs(noise().acceleration))
    for power in range(3):
        basis = (t / t[-1]) ** power
        assert abs(np.dot(after, basis)) < 1e-9 * scale * t.size
    assert abs(np.dot(process(noise(), baseline="linear").acceleration, (t / t[-1]) ** 2)) > (
        1e-6 * scale
    )
    parabola = record(3.0 - 0.02 * t + 1e-4 * t**2)
    np.testing.assert_allclose(process(parabola, baseline="quadratic").acceleration, 0.0, atol=1e-9)
    two = process(record(np.array([1.0, 3.0])), baseline="quadratic").acceleration
    np.testing.assert_allclose(two, 0.0, atol=1e-12)
