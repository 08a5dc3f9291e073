"""The ground acceleration over a step, from the samples of a record: linear between them, zero
after the last."""

from __future__ import annotations

from tdint.kernels.compiling import inline, outlined


@inline
def _sample(ground, position):
    return ground[position] if position < ground.shape[0] else 0.0


@inline
def ground_between(ground, position):
    """Ground acceleration at a position counted in samples."""
    sample = int(position)
    value = _sample(ground, sample)
    return value + (_sample(ground, sample + 1) - value) * (position - sample)


@inline
def ground_at(ground, step, per_sample, stride):
    """Ground acceleration at the start of a step of which `per_sample` take `stride` samples."""
    if per_sample == 1:
        return _sample(ground, step * stride)
    if stride > 1:
        return ground_between(ground, step * stride / per_sample)
    sample = step // per_sample
    part = (step - sample * per_sample) / per_sample
    value = _sample(ground, sample)
    return value + (_sample(ground, sample + 1) - value) * part


@outlined
def straightened(ground, begin, end):
    """Ends of the line that has the impulse and the first moment of the ground acceleration from
    position `begin` to `end`, counted in samples.

    It is the line of least squares. Within one sampling interval it is the record's own.
    """
    middle = 0.5 * (begin + end)
    impulse = 0.0
    moment = 0.0
    left = begin
    value = ground_between(ground, begin)
    sample = int(begin)
    while left < end:
        sample += 1
        right = float(sample)
        if right <= end:
            following = _sample(ground, sample)
        else:
            right = end
            following = ground_between(ground, end)
        length = right - left
        area = 0.5 * length * (value + following)
        impulse += area
        moment += (0.5 * (left + right) - middle) * area + length * length / 12.0 * (
            following - value
        )
        left = right
        value = following
    whole = end - begin
    mean = impulse / whole
    half = 6.0 * moment / (whole * whole)
    return mean - half, mean + half


@inline
def straightened_samples(ground, first, last):
    """`straightened` between two samples."""
    middle = 0.5 * (first + last)
    impulse = 0.0
    moment = 0.0
    value = _sample(ground, first)
    for sample in range(first, last):
        following = _sample(ground, sample + 1)
        area = 0.5 * (value + following)
        impulse += area
        moment += (sample + 0.5 - middle) * area + 1.0 / 12.0 * (following - value)
        value = following
    share = 1.0 / (last - first)
    mean = share * impulse
    half = 6.0 * share * share * moment
    return mean - half, mean + half
