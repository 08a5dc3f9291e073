"""Tests of the response spectrum analysis: a two-story frame by hand, published correlations, modes
outside of a target."""

import math

import numpy as np
import pytest

import tdint
from building_cases import model, story
from tdint.errors import UsageError
from tdint.response.spectra.modal import correlations
from tdint.units import STANDARD_GRAVITY as G


def table(folder, periods, psa):
    """Return the file of a target with these pseudo-accelerations (m/s^2)."""
    file = folder / "target.csv"
    file.write_text(
        "period_s,sa_m_s2\n"
        + "".join(f"{t:.12g},{a:.12g}\n" for t, a in zip(periods, psa, strict=True))
    )
    return str(file)


def test_two_story_frame_agrees_with_hand_calculation(tmp_path):
    """Masses 2m, m and springs 2k, k have omega^2 = k/2m, 2k/m, shapes (1/2, 1), (-1, 1) and
    participation factors 4/3, -1/3 (Chopra)."""
    m, k, a = 100.0, 4e4, 0.3 * G
    result = tdint.response_spectrum_analysis(
        model([story(2 * m, 2 * k), story(m, k)]), table(tmp_path, [0.01, 9.0], [a, a])
    )
    omega = np.sqrt([k / (2 * m), 2 * k / m])
    assert result.period == pytest.approx(2.0 * math.pi / omega, rel=1e-12)
    assert result.mass_ratio == pytest.approx([8.0 / 9.0, 1.0 / 9.0], rel=1e-12)
    factor, shapes = np.array([4.0, -1.0]) / 3.0, np.array([[0.5, 1.0], [-1.0, 1.0]])
    displacement = factor[:, None] * shapes * (a / omega**2)[:, None]
    forces = factor[:, None] * shapes * a * np.array([2 * m, m])
    peaks = {
        "displacement": displacement,
        "drift": np.diff(displacement, axis=1, prepend=0.0),
        "shear": np.array([forces.sum(axis=1), forces[:, 1]]).T,
    }
    # Frequencies 1 to 2 at 5 %: 8 z^2 (1 + r) r^1.5 / ((1 - r^2)^2 + 4 z^2 r (1 + r)^2) with r =
    # 1/2
    rho = 8.0 * 0.05**2 * 1.5 * 0.5**1.5 / (0.75**2 + 4.0 * 0.05**2 * 0.5 * 1.5**2)
    for name, (first, second) in peaks.items():
        assert getattr(result, f"{name}_srss") == pytest.approx(np.hypot(first, second), rel=1e-12)
        cqc = np.sqrt(first**2 + second**2 + 2.0 * rho * first * second)
        assert getattr(result, f"{name}_cqc") == pytest.approx(cqc, rel=1e-12)


def test_modal_correlations_have_published_values():
    """The correlation matrix is checked at 5 % for frequency ratios 0.9, 0.8 and 0.5; it is
    symmetric with a unit diagonal."""
    rho = correlations(np.array([0.5, 0.8, 0.9, 1.0]), 0.05)
    assert rho[3, :3] == pytest.approx([0.018486, 0.165635, 0.473028], abs=5e-7)
    assert rho == pytest.approx(rho.T, rel=1e-12)
    assert np.diagonal(rho) == pytest.approx(np.ones(4), rel=1e-14)


def test_modes_outside_period_range_of_target(tmp_path):
    """Modes with short periods follow the ground, or are omitted if the target has no value at
    period zero. Long periods are refused."""
    frame = model([story(100.0, 4e4), story(100.0, 4e7)])
    left_out = tdint.response_spectrum_analysis(frame, table(tmp_path, [0.1, 9.0], [1.0, 1.0]))
    assert (left_out.rigid, left_out.left_out, left_out.spectral_acceleration[1]) == (0, 1, 0.0)
    rigid = tdint.response_spectrum_analysis(
        frame, table(tmp_path, [0.0, 0.1, 9.0], [0.4, 1.0, 1.0])
    )
    assert (rigid.rigid, rigid.left_out, rigid.spectral_acceleration[1]) == (1, 0, 0.4)
    with pytest.raises(UsageError, match=r"spectrum is 0\.2 s, .*building is 0\.44"):
        tdint.response_spectrum_analysis(frame, table(tmp_path, [0.1, 0.2], [1.0, 1.0]))
