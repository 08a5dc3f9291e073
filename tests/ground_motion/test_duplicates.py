"""Copies of ground motions are found in any form; different motions are not copies."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt, sosfiltfilt

from tdint.ground_motion.duplicates import first_copies
from tdint.ground_motion.record import Record


def motion(seed: int, dt: float = 0.01) -> Record:
    """Return a random motion of 20 s whose intensity rises and decays."""
    time = np.arange(0.0, 20.0, dt)
    noise = np.random.default_rng(seed).standard_normal(time.size)
    sections = butter(2, [0.3, 12.0], "band", fs=1.0 / dt, output="sos")
    envelope = (time / 4.0) * np.exp(1.0 - time / 4.0)
    return Record(envelope * sosfiltfilt(sections, noise), dt, "", "", "", "")


def filtered(record: Record, corners: list[float], filtering) -> Record:
    sections = butter(4, corners, "band", fs=1.0 / record.dt, output="sos")
    return replace(record, acceleration=filtering(sections, record.acceleration))


def resampled(record: Record) -> Record:
    times = 0.5 * record.dt * np.arange(2 * record.acceleration.size - 1)
    own = record.dt * np.arange(record.acceleration.size)
    return replace(
        record, dt=0.5 * record.dt, acceleration=np.interp(times, own, record.acceleration)
    )


COPIES = {
    "unit": lambda record: replace(record, acceleration=record.acceleration / 9.81 * 9.81),
    "sign and scale": lambda record: replace(record, acceleration=-2.5 * record.acceleration),
    "step": resampled,
    "trimmed": lambda record: replace(record, acceleration=record.acceleration[100:-500]),
    "filtered": lambda record: filtered(record, [0.1, 25.0], sosfiltfilt),
    "causal filter": lambda record: filtered(record, [0.1, 25.0], sosfilt),
}


@pytest.mark.parametrize("change", COPIES.values(), ids=COPIES)
def test_changed_copies_are_found(change):
    original, other = motion(1), motion(2)
    assert first_copies([[original], [other], [change(original)]]) == [0, 1, 0]


def test_both_components_of_a_pair_must_be_copies_in_either_order():
    x, y, z = motion(1), motion(2), motion(3)
    swapped = [replace(y, acceleration=-y.acceleration), x]
    assert first_copies([[x, y], [x, z], swapped, [x]]) == [0, 1, 0, 3]


def test_different_motions_and_motions_at_rest_are_not_copies():
    rest = Record(np.zeros(100), 0.01, "", "", "", "")
    time = np.arange(0.0, 10.0, 0.01)
    # Slow pulses, whose energy is below the frequencies that are compared
    pulses = [
        replace(rest, acceleration=np.where(time < end, np.sin(np.pi * time / end), 0.0))
        for end in (4.0, 4.5, 8.0)
    ]
    motions = [*map(motion, range(12)), rest, rest, *pulses]
    assert first_copies([[record] for record in motions]) == list(range(len(motions)))


TIMES = np.arange(0.0, 10.0, 0.01)
SIMPLE = {
    "sines of different period": [np.sin(2.0 * np.pi * TIMES / t) for t in (0.3, 0.31, 0.5, 2.0)],
    "modulated sines of different phase": [
        np.sin(15.0 * TIMES + phase) * np.sin(2.5 * TIMES) for phase in (0.0, 1.0, 2.0)
    ],
    "half sines": [
        np.where(end > TIMES, np.sin(np.pi * TIMES / end), 0.0) for end in (0.05, 0.055, 0.5, 0.52)
    ],
    "triangles": [np.maximum(1.0 - np.abs(2.0 * TIMES / end - 1.0), 0.0) for end in (0.2, 0.22)],
    "wavelets": [
        (1.0 - 2.0 * (f * (TIMES - 3.0)) ** 2) * np.exp(-((f * (TIMES - 3.0)) ** 2))
        for f in (6.0, 6.2, 12.0)
    ],
    "trains of pulses": [np.where((TIMES % 1.0 < 0.1) & (n > TIMES), 1.0, 0.0) for n in (8, 9, 10)],
}


@pytest.mark.parametrize("shapes", SIMPLE.values(), ids=SIMPLE)
def test_simple_motions_are_copies_only_if_they_are_equal(shapes):
    motions = [[Record(shape, 0.01, "", "", "", "")] for shape in shapes]
    copy = replace(
        resampled(motions[0][0]), acceleration=-2.0 * resampled(motions[0][0]).acceleration
    )
    assert first_copies([*motions, [copy]]) == [*range(len(motions)), 0]


@pytest.mark.parametrize(
    "record", [motion(1), Record(SIMPLE["half sines"][2], 0.01, "", "", "", "")]
)
def test_motions_of_another_amplitude_are_copies_only_of_scaled_motions(record):
    motions = [[record], [replace(record, acceleration=1.5 * record.acceleration)], [record]]
    assert first_copies(motions) == [0, 0, 0]
    assert first_copies(motions, scaled=False) == [0, 1, 0]
