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


SPRINGS = [
    {"mass": 6e4, "height": 3, "stiffness": 3e7},
    {"mass": 5e4, "height": 3, "stiffness": 2.5e7},
]
ABSORBER = {"mass": 5e3, "stiffness": 5e5}
SPECTRUM = "ec8:type=1,soil=C,ag=0.35g"
CQC = ("drift", "shear", "displacement", "acceleration", "force")


def test_an_absorber_on_the_roof_is_a_story():
    absorber = {"name": "tmd", "floor": "roof", **ABSORBER, "dashpot": 1e3}
    found = tdint.response_spectrum_analysis(
        {"stories": SPRINGS, "attachments": [absorber]}, SPECTRUM
    )
    chain = tdint.response_spectrum_analysis(
        {"stories": [*SPRINGS, {**ABSORBER, "height": 3}]}, SPECTRUM
    )
    for name in CQC:
        values = getattr(found, f"{name}_cqc")
        assert values == pytest.approx(getattr(chain, f"{name}_cqc")[:2], rel=1e-12), name
    assert found.device_deformation_cqc == pytest.approx(chain.drift_cqc[2:], rel=1e-12)
    assert found.base_shear == pytest.approx(chain.base_shear, rel=1e-12)
    assert found.applied_force == pytest.approx(chain.applied_force, rel=1e-12)


def test_a_link_to_the_ground_carries_a_part_of_the_base_shear():
    """Base shear and force of a link from the ground to floor 1 have the ratio of both
    stiffnesses; together they are a story of the sum."""
    link = {"name": "brace", "from": "ground", "to": 1, "stiffness": 1e7}
    found = tdint.response_spectrum_analysis({"stories": SPRINGS, "links": [link]}, SPECTRUM)
    sum_of_both = [{**SPRINGS[0], "stiffness": 4e7}, SPRINGS[1]]
    whole = tdint.response_spectrum_analysis({"stories": sum_of_both}, SPECTRUM)
    assert found.drift_cqc == pytest.approx(whole.drift_cqc, rel=1e-12)
    assert found.shear_cqc == pytest.approx(whole.shear_cqc * [0.75, 1.0], rel=1e-12)
    assert found.moment_cqc == pytest.approx(whole.moment_cqc, rel=1e-12)
    assert found.device_deformation_cqc == pytest.approx(whole.drift_cqc[:1], rel=1e-12)


@pytest.mark.parametrize("devices", [{}, {"base": {"rotation": 3e9}}])
def test_an_absorber_beside_flexural_stories(devices):
    """An absorber with a hundred times the stiffness of its floor is part of the floor; equilibrium
    gives its force."""
    stories = [{"mass": 6e4, "height": 3, "flexural": {"EI": 2e9, "GA": 4e8}}] * 2
    options = {"damping": {"modal": 0.05}, **devices}
    absorber = {"name": "tmd", "floor": 2, "mass": 1e4, "stiffness": 1e12}
    found = tdint.response_spectrum_analysis(
        {"stories": stories, "attachments": [absorber], **options}, SPECTRUM
    )
    heavy = [stories[0], {**stories[1], "mass": 7e4}]
    rigid = tdint.response_spectrum_analysis({"stories": heavy, **options}, SPECTRUM)
    for name in ("drift", "shear", "displacement", "moment"):
        expected = getattr(rigid, f"{name}_cqc")
        assert getattr(found, f"{name}_cqc") == pytest.approx(expected, rel=1e-3), name
