"""Stories with several elements under the complete motion of El Centro, with separately computed
results.

The results are those of another program: the leapfrog scheme with 4000 and 8000 steps per sampling
interval and Richardson extrapolation, and for `imk` a step-by-step formulation of the law.
"""

from typing import NamedTuple

import numpy as np
import pytest
import yaml

from el_centro import el_centro
from tdint import load_model, run


class Reference(NamedTuple):
    """Results of a story: peak drift and last drift (m), peak shear, and for each element its peak
    force (kN) and dissipated energy (kJ)."""

    peak_drift: float
    peak_shear: float
    last_drift: float
    elements: tuple[tuple[float, float], ...] = ()


class Case(NamedTuple):
    """Model (m, kN, t), factor on the motion, results of the stories, significant digits of the
    results, and number of steps per sampling interval."""

    model: str
    scale: float
    references: tuple[Reference, ...]
    digits: int = 6
    parts: int = 8


CASES = {
    "trilinear-from-two-bilinear": Case(
        """
stories:
  - mass: 100
    elements:
      - {type: bilinear, name: brace, stiffness: 12000, yield_force: 120, hardening: 0}
      - {type: bilinear, name: frame, stiffness: 6000, yield_force: 180, hardening: 0.05}
damping: 5%
""",
        1.5,
        (Reference(0.0696312, 311.889, -0.0310552, ((120.0, 82.0798), (191.889, 17.3759))),),
    ),
    "frame-and-friction-device": Case(
        """
stories:
  - mass: 200
    elements:
      - {type: linear, name: frame, stiffness: 20000}
      - {type: bilinear, name: friction device, stiffness: 200000, yield_force: 300, hardening: 0}
damping: 2%
""",
        1,
        (Reference(0.012091, 541.819, 0.00061815, ((241.819, 0.0), (300.0, 47.5956))),),
        parts=16,
    ),
    "bouc-wen-and-gap": Case(
        """
stories:
  - mass: 300
    elements:
      - {type: bouc-wen, name: bearings, stiffness: 30000, yield_force: 200, hardening: 0.08,
         exponent: 2, beta: 0.5}
      - {type: gap, name: stop, gap: 0.06, stop_stiffness: 8.0e+4}
damping: none
""",
        1.5,
        (Reference(0.0827406, 2201.83, -0.00708394, ((382.578, 283.349), (1819.25, 0.0))),),
    ),
    "bouc-wen-and-bilinear": Case(
        """
stories:
  - mass: 150
    elements:
      - {type: bouc-wen, name: frame, stiffness: 15000, yield_force: 250, hardening: 0.05,
         exponent: 1.5, beta: 0.6}
      - {type: bilinear, name: brace, stiffness: 9000, yield_force: 90, hardening: 0.02}
damping: 3%
""",
        1.5,
        (Reference(0.0635476, 384.681, -0.00944439, ((285.043, 105.471), (99.6386, 63.223))),),
    ),
    "tanh-and-bilinear": Case(
        """
stories:
  - mass: 150
    elements:
      - {type: tanh, name: infill, stiffness: 10000, strength: 150}
      - {type: bilinear, name: frame, stiffness: 8000, yield_force: 200, hardening: 0.03}
damping: 5%
""",
        1.5,
        (Reference(0.0859397, 364.622, 0.00117591, ((149.997, 0.0), (214.626, 127.16))),),
    ),
    "three-springs-one-story": Case(
        """
stories:
  - mass: 250
    elements:
      - {type: linear, name: gravity frame, stiffness: 5000}
      - {type: bilinear, name: brb, stiffness: 25000, yield_force: 200, hardening: 0.02}
      - {type: gap, name: stop, gap: 0.05, stop_stiffness: 1.0e+5}
damping: 5%
""",
        2,
        (
            Reference(
                0.0955655, 5278.16, 0.0033039, ((477.828, 0.0), (243.783, 453.89), (4556.55, 0.0))
            ),
        ),
    ),
    "three-story-frame-with-brb": Case(
        """
stories:
  - mass: 120
    height: 3.5
    elements:
      - {type: bilinear, name: frame, stiffness: 40000, yield_force: 500, hardening: 0.03}
      - {type: bilinear, name: brb, stiffness: 60000, yield_force: 250, hardening: 0.01}
  - mass: 120
    height: 3.5
    elements:
      - {type: bilinear, name: frame, stiffness: 36000, yield_force: 420, hardening: 0.03}
      - {type: bilinear, name: brb, stiffness: 50000, yield_force: 210, hardening: 0.01}
  - mass: 120
    height: 3.5
    elements:
      - {type: bilinear, name: frame, stiffness: 30000, yield_force: 300, hardening: 0.03}
      - {type: bilinear, name: brb, stiffness: 40000, yield_force: 140, hardening: 0.01}
damping: {rayleigh: {ratio: 0.03, modes: [1, 2]}}
p_delta: true
""",
        2,
        (
            Reference(0.10159, 915.362, -0.0141398, ((606.908, 192.904), (308.454, 248.611))),
            Reference(0.0327782, 667.09, -0.0203134, ((442.8, 43.6376), (224.289, 122.312))),
            Reference(0.0131175, 446.653, 0.000657552, ((302.806, 4.80283), (143.847, 48.0983))),
        ),
        parts=32,
    ),
    "isolated-building-with-moat-wall": Case(
        """
stories:
  - mass: 400
    isolator: true
    elements:
      - {type: bilinear, name: bearings, stiffness: 60000, yield_force: 300, hardening: 0.1}
      - {type: gap, name: moat wall, gap: 0.08, stop_stiffness: 2.0e+5}
  - {mass: 300, stiffness: 2.0e+5, law: {type: bilinear, yield_force: 1500, hardening: 0.05}}
  - {mass: 300, stiffness: 1.5e+5, law: {type: bilinear, yield_force: 900, hardening: 0.05}}
damping: none
""",
        2,
        (
            Reference(0.111129, 7162.54, -0.00258572, ((936.773, 727.457), (6225.77, 0.0))),
            Reference(0.109306, 2518.06, 0.0309722),
            Reference(0.0564384, 1278.29, 0.00529655),
        ),
        parts=16,
    ),
    "imk-and-bilinear": Case(
        """
stories:
  - mass: 100
    elements:
      - {type: imk, name: frame, stiffness: 8000, yield_force: 150, plastic_drift: 0.06,
         post_capping_drift: 0.15, capping_ratio: 1.2, residual_ratio: 0.2,
         ultimate_drift: 1, deterioration: 1}
      - {type: bilinear, name: brb, stiffness: 6000, yield_force: 60, hardening: 0.02}
damping: none
""",
        1.5,
        (Reference(0.0859631, 241.917, -0.024251, ((173.891, 58.2739), (69.1156, 70.16))),),
        digits=5,
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("method", ["impulse4", "moment4"])
@pytest.mark.parametrize("name", CASES)
def test_elements_have_the_separately_computed_results(name, method):
    """All results agree to a unit of the last printed digit."""
    case = CASES[name]
    model = {"units": {"length": "m", "force": "kN", "mass": "t"}, **yaml.safe_load(case.model)}
    motion = el_centro(duration=31.18, scale=case.scale)
    dt = motion.dt / case.parts
    result = run(load_model(model), motion, method=method, dt=dt, check=False)
    elements = result.elements
    for i, reference in enumerate(case.references):
        found = [
            result.stories.peak_drift[i],
            1e-3 * result.stories.peak_shear[i],
            result.stories.residual_drift[i],
        ]
        of_story = elements.story == i + 1
        found += (1e-3 * elements.peak_force[of_story]).tolist()
        found += (1e-3 * elements.dissipated_energy[of_story]).tolist()
        expected = [*reference[:3], *np.transpose(reference.elements).ravel().tolist()]
        for value, printed in zip(found, expected, strict=True):
            assert value == pytest.approx(printed, abs=_last_digit(printed, case.digits))


def _last_digit(value, digits):
    """Return the unit of the last of the significant digits of a number; 0 for 0."""
    return float(10.0 ** (np.floor(np.log10(abs(value))) + 1 - digits)) if value else 0.0
