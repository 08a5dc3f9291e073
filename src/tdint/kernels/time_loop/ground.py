"""Ground acceleration over a step from the samples of a record, linear between the samples and zero
after the last sample."""

from __future__ import annotations

from tdint.kernels.compiling import inline, outlined


@inline
def _sample(ground, position):
    """Return the sample of the ground acceleration with the index `position`, m/s^2; 0 after the
    last sample.
    """
    return ground[position] if position < ground.shape[0] else 0.0


@inline
def ground_between(ground, position):
    """Return the ground acceleration at a time, m/s^2.

    `position` is the time divided by the sampling interval: 2.5 is the middle between the samples
    with the indices 2 and 3.
    """
    sample = int(position)
    value = _sample(ground, sample)
    return value + (_sample(ground, sample + 1) - value) * (position - sample)


@inline
def ground_at(ground, step, per_sample, stride):
    """Return the ground acceleration at the start of a step, m/s^2.

    It is linear between the samples. A step can be a fraction of a sampling interval (`stride` 1),
    one or several sampling intervals (`per_sample` 1), or a ratio of both.

    Parameters
    ----------
    per_sample, stride : int
        `per_sample` steps have the length of `stride` sampling intervals.
    """
    if per_sample == 1:
        return _sample(ground, step * stride)
    if stride > 1:
        return ground_between(ground, step * stride / per_sample)
    # `part` is the time after this sample, as a fraction of the sampling interval.
    sample = step // per_sample
    part = (step - sample * per_sample) / per_sample
    value = _sample(ground, sample)
    return value + (_sample(ground, sample + 1) - value) * part


@outlined
def fitted_line(ground, begin, end):
    """Fit a straight line to the ground acceleration over a time step; return its end values,
    m/s^2.

    The line has the same impulse I = int a dt and the same first moment J = int (t - t_m) a dt
    about the middle t_m of the step as the ground acceleration a, which is linear between samples.
    It is therefore the least-squares fit. With the duration T, the end values are I / T -+ 6 J /
    T^2. Within one sampling interval the line is equal to the ground acceleration.

    Parameters
    ----------
    begin, end : float
        Times of the endpoints divided by the sampling interval.

    Returns
    -------
    float, float
        Values of the line at the start and at the end of the step, m/s^2.
    """
    # The time step consists of pieces between two samples (or an endpoint of the step and a
    # sample). Sum the impulse and the first moment about the middle of the step over these pieces.
    middle = 0.5 * (begin + end)
    impulse = 0.0
    moment = 0.0
    piece_start = begin
    value = ground_between(ground, begin)
    sample = int(begin)
    while piece_start < end:
        sample += 1
        piece_end = float(sample)
        if piece_end <= end:
            next_value = _sample(ground, sample)
        else:
            piece_end = end
            next_value = ground_between(ground, end)
        # The ground acceleration is linear in the piece: a trapezoid with this area. Its first
        # moment is the moment of the area, concentrated in the middle of the piece, plus length^2 /
        # 12 times the rise.
        length = piece_end - piece_start
        area = 0.5 * length * (value + next_value)
        impulse += area
        moment += (0.5 * (piece_start + piece_end) - middle) * area + length * length / 12.0 * (
            next_value - value
        )
        piece_start = piece_end
        value = next_value
    duration = end - begin
    mean = impulse / duration
    half_rise = 6.0 * moment / (duration * duration)
    return mean - half_rise, mean + half_rise


@inline
def fitted_line_between_samples(ground, first, last):
    """Fit a straight line to the ground acceleration between two samples; return its end values,
    m/s^2.

    The line has the impulse I and the first moment J of the ground acceleration, which is linear
    between samples. J is the moment about the middle of the step. With T sampling intervals, the
    end values of the line are I / T - 6 J / T^2 and I / T + 6 J / T^2. The step starts at the
    sample with the index `first` and ends at the sample with the index `last`. For such a step,
    `fitted_line` has the same result, but this function is faster.

    Parameters
    ----------
    first, last : int
        Indices of the samples at the start and at the end of the step.

    Returns
    -------
    float, float
        Values of the line at the start and at the end of the step, m/s^2.
    """
    # Times are multiples of the sampling interval. In each interval, the ground acceleration is a
    # trapezoid with this area; its first moment is the moment of the area, concentrated in the
    # middle of the interval, plus 1 / 12 of the rise.
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
    half_rise = 6.0 * inverse_duration * inverse_duration * moment
    return mean - half_rise, mean + half_rise
