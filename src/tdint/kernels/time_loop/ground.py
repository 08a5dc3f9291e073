"""Ground acceleration over a step from the samples of a record, linear between the samples and zero
after the last sample."""

from __future__ import annotations

from tdint.kernels.compiling import inline, outlined


@inline
def _sample(ground, position):
    """Return the sample of the ground acceleration at an index; 0 after the last sample."""
    return ground[position] if position < ground.shape[0] else 0.0


@inline
def ground_between(ground, position):
    """Return the ground acceleration at a position in units of the sampling interval, m/s^2."""
    sample = int(position)
    value = _sample(ground, sample)
    return value + (_sample(ground, sample + 1) - value) * (position - sample)


@inline
def ground_at(ground, step, per_sample, stride):
    """Return the ground acceleration at the start of a step, m/s^2.

    Parameters
    ----------
    ground : ndarray
        Samples, m/s^2.
    step : int
        Index of the step.
    per_sample, stride : int
        `per_sample` steps have the length of `stride` sampling intervals.
    """
    if per_sample == 1:
        return _sample(ground, step * stride)
    if stride > 1:
        return ground_between(ground, step * stride / per_sample)
    sample = step // per_sample
    part = (step - sample * per_sample) / per_sample
    value = _sample(ground, sample)
    return value + (_sample(ground, sample + 1) - value) * part


@outlined
def fitted_line(ground, begin, end):
    """Fit a straight line to the ground acceleration over a time step; return its end values.

    The line has the same impulse and the same first moment as the ground acceleration, which is
    linear between samples. It is therefore the least-squares fit. Within one sampling interval it
    is equal to the ground acceleration.

    Parameters
    ----------
    ground : ndarray
        Samples, m/s^2.
    begin, end : float
        Positions of the endpoints in units of the sampling interval.
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
            next_value = _sample(ground, sample)
        else:
            right = end
            next_value = ground_between(ground, end)
        length = right - left
        area = 0.5 * length * (value + next_value)
        impulse += area
        moment += (0.5 * (left + right) - middle) * area + length * length / 12.0 * (
            next_value - value
        )
        left = right
        value = next_value
    duration = end - begin
    mean = impulse / duration
    half = 6.0 * moment / (duration * duration)
    return mean - half, mean + half


@inline
def fitted_line_between_samples(ground, first, last):
    """Fit a straight line to the ground acceleration between two samples; return its end values.

    The result is that of `fitted_line` for a step that starts at the sample with the index `first`
    and ends at the sample with the index `last`; this function is faster.
    """
    middle = 0.5 * (first + last)
    impulse = 0.0
    moment = 0.0
    value = _sample(ground, first)
    for sample in range(first, last):
        next_value = _sample(ground, sample + 1)
        area = 0.5 * (value + next_value)
        impulse += area
        moment += (sample + 0.5 - middle) * area + 1.0 / 12.0 * (next_value - value)
        value = next_value
    inverse_duration = 1.0 / (last - first)
    mean = inverse_duration * impulse
    half = 6.0 * inverse_duration * inverse_duration * moment
    return mean - half, mean + half
