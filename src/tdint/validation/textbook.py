"""Tables of textbooks, and results that other programs print, for models that can be written down in full."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from tdint.analysis.run.overview import modes
from tdint.analysis.run.run import run
from tdint.campaign.fragility.fits import fit_stripes
from tdint.ground_motion.reading.read import make_record
from tdint.model.config.model_file import load_model
from tdint.tabular import Several
from tdint.validation.case import NUMERICAL, ROUNDING, Array, ValidationCase, ValidationResult, carry_out
from tdint.validation.closed_forms import closed_form_cases

INCH = 0.0254
_TENTHS = tuple(f"u({i / 10:.1f} s)" for i in range(1, 11))


def _chopra_5(method: str, law: Mapping[str, Any] | None = None) -> Array:
    """Displacements (in) of the oscillator of Chopra's examples 5.1 to 5.5 at 0.1 to 1.0 s, in steps of 0.1 s."""
    model = load_model(
        {
            "units": {"length": "in", "force": "kip", "mass": "kip*s^2/in"},
            "stories": [{"mass": 0.2533, "stiffness": 10.0} | ({"law": dict(law)} if law else {})],
            "damping": {"modal": 0.05},
        }
    )
    force = [10.0 * math.sin(math.pi * i / 6.0) if i < 6 else 0.0 for i in range(11)]
    record = make_record([-p / 0.2533 for p in force], dt=0.1, units="in/s^2")
    history = run(model, record, method=method, history=True).history
    assert history is not None
    return np.asarray(history.displacement[1:, 0] / INCH)


def _table_of_chopra(
    table: str,
    method: str,
    published: tuple[float, ...],
    tolerance: float,
    law: Mapping[str, Any] | None = None,
    source: str = "",
    remark: str = "the book carries four decimals from step to step",
) -> ValidationCase:
    plastic = "elastoplastic " if law else ""
    return ValidationCase(
        name=f"chopra-{table}",
        title=f"{plastic}oscillator under half a sine in steps of 0.1 s by `{method}`",
        source=source or f"A. K. Chopra, Dynamics of Structures, 4th ed. (2012), table {table}",
        unit="in",
        quantities=_TENTHS[: len(published)],
        published=published,
        computed=lambda: _chopra_5(method, law)[: len(published)],
        tolerance=tolerance,
        difference_is=ROUNDING,
        remark=remark,
    )


_PLASTIC = {"type": "bilinear", "yield_force": 7.5, "hardening": 0.0}


def _bathe(method: str) -> Array:
    """Both displacements at 3.36 s of Bathe's two masses between walls, 12 steps of 0.28 s."""
    model = load_model(
        {
            # The spring from the second mass to the wall is a story under a mass that stays where it is.
            "stories": [{"mass": 2, "stiffness": 4}, {"mass": 1, "stiffness": 2}, {"mass": 1e12, "stiffness": 2}],
            "excitation": {"forces": [{"floor": 2, "amplitude": 10, "omega": 0, "phase": "cos"}]},
            "analysis": {"dt": 0.28, "duration": 3.36},
        }
    )
    history = run(model, method=method, history=True).history
    assert history is not None
    return np.asarray(history.displacement[-1, :2])


def _example_of_bathe(number: str, method: str, published: tuple[float, float], remark: str = "") -> ValidationCase:
    exact = method == "exact"
    return ValidationCase(
        name=f"bathe-{number}",
        title=f"two masses between walls, step 12 of 0.28 s by `{method}`",
        source=f"K. J. Bathe, Finite Element Procedures, 2nd ed. (2014), example {number}",
        unit="1",
        quantities=("u1(3.36 s)", "u2(3.36 s)"),
        published=published,
        computed=lambda: _bathe(method),
        tolerance=5e-4 if exact else 5e-3,
        difference_is=ROUNDING,
        remark=remark or f"printed with {3 if exact else 2} decimals",
    )


def _five_yielding_stories() -> Array:
    """Roof displacement at 2 s, m (Chopra, example 16.4, as StructDyn computes it)."""
    law = {"type": "bilinear", "yield_force": 125, "hardening": 0.05 / 1.05}
    model = load_model(
        {
            "units": {"length": "m", "force": "kN", "mass": "t"},
            "stories": [{"repeat": 5, "mass": 25.91, "stiffness": 10000, "law": law}],
            "damping": {"modal": 0.05},
        }
    )
    samples = [1.93 * math.sin(2.0 * math.pi * i / 10) if i <= 10 else 0.0 for i in range(21)]
    record = make_record(samples, dt=0.1, units="m/s^2")
    history = run(model, record, method="newmark-average", history=True).history
    assert history is not None
    return np.asarray(history.displacement[-1:, 4])


def _circular_frequencies(*stories: dict[str, Any]) -> Array:
    return np.asarray(modes(load_model({"stories": list(stories)})).omega)


def _forced_by_a_sine() -> Array:
    """Natural frequency (Hz) and displacement (m) at 1 s of code_aster's SDLD106."""
    model = load_model(
        {
            "stories": [{"mass": 100, "stiffness": 100.0 * (0.2 * math.pi) ** 2}],
            "excitation": {"forces": [{"floor": 1, "amplitude": 1, "omega": 1, "phase": "sin"}]},
            "analysis": {"dt": 0.05, "duration": 1},
        }
    )
    history = run(model, method="impulse4", history=True).history
    assert history is not None
    return np.array([modes(model).omega[0] / (2.0 * math.pi), history.displacement[-1, 0]])


def _stripes() -> Array:
    found = fit_stripes([0.2, 0.3, 0.4, 0.6, 0.7, 0.8, 0.9, 1.0], [0, 0, 0, 4, 6, 13, 12, 16], [40] * 8)
    return np.array([found.theta, found.beta])


def textbook_cases() -> tuple[ValidationCase, ...]:
    """Tables of textbooks and printed results of other programs."""
    opensees = "OpenSees, example SmallEigen, printed eigenvalues"
    hyfeast = "Hyfeast, manual, table E.7.2 (the same oscillator, computed with more digits)"
    return (
        _table_of_chopra(
            "E5.1",
            "exact",
            (0.0318, 0.2274, 0.6336, 1.1339, 1.4896, 1.4480, 0.9037, 0.0579, -0.7577, -1.2432),
            1e-4,
        ),
        _table_of_chopra(
            "E5.2",
            "central-difference",
            (0.0000, 0.1914, 0.6293, 1.1825, 1.5808, 1.5412, 0.9141, -0.0247, -0.8968, -1.3726),
            1e-4,
        ),
        _table_of_chopra(
            "E5.3",
            "newmark-average",
            (0.0437, 0.2326, 0.6121, 1.0825, 1.4309, 1.4231, 0.9622, 0.1908, -0.6044, -1.1442),
            1e-4,
        ),
        _table_of_chopra(
            "E5.4",
            "newmark-linear",
            (0.0300, 0.2193, 0.6166, 1.1130, 1.4782, 1.4625, 0.9514, 0.1273, -0.6954, -1.2208),
            1e-4,
        ),
        _table_of_chopra(
            "E5.5",
            "newmark-average",
            (0.0437, 0.2326, 0.6121, 1.1143, 1.6214, 1.9891, 2.0951, 1.9240, 1.5602),
            1.5e-4,
            _PLASTIC,
        ),
        _table_of_chopra(
            "E5.5 by Hyfeast",
            "newmark-average",
            (0.043667, 0.23262, 0.61207, 1.1144, 1.6215, 1.9892, 2.0952, 1.9241, 1.5603, 1.1416),
            5.5e-5,
            _PLASTIC,
            hyfeast,
            "printed with five digits",
        ),
        _example_of_bathe("9.1", "central-difference", (1.02, 2.60)),
        _example_of_bathe("9.3", "newmark-average", (1.40, 2.31)),
        _example_of_bathe("9.3 (1976)", "wilson:theta=1.4", (1.54, 2.29)),
        _example_of_bathe("9.4", "bathe", (1.28, 2.40)),
        _example_of_bathe("9.7", "exact", (1.157, 2.489)),
        ValidationCase(
            "structdyn-16.4",
            "roof of five yielding stories after 2 s of shaking, by `newmark-average`",
            "StructDyn, tests/test_mdf.py, after Chopra, example 16.4",
            "m",
            ("u5(2 s)",),
            (0.03998638459760687,),
            _five_yielding_stories,
            1e-13,
            NUMERICAL,
            remark="same method and step: equal but for rounding",
        ),
        ValidationCase(
            "opensees-eigen",
            "eigenvalues of three masses",
            opensees,
            "1/s^2",
            ("omega1^2", "omega2^2", "omega3^2"),
            (0.139300647653736, 1.05865310768512, 4.9582024008173),
            lambda: (
                _circular_frequencies(
                    {"mass": 11.1, "stiffness": 30}, {"mass": 22.2, "stiffness": 20}, {"mass": 33.3, "stiffness": 10}
                )
                ** 2
            ),
            1e-10,
            NUMERICAL,
            relative=True,
        ),
        ValidationCase(
            "chopra-10.4",
            "frequencies of two stories",
            "Chopra, example 10.4",
            "rad/s",
            ("omega1", "omega2"),
            (0.70710678, 1.41421356),
            lambda: _circular_frequencies({"mass": 2, "stiffness": 2}, {"mass": 1, "stiffness": 1}),
            5e-9,
            ROUNDING,
            remark="printed with eight decimals",
        ),
        ValidationCase(
            "code-aster-sdld02",
            "frequencies of eight masses between walls",
            "code_aster, V2.01.002 (SDLD02)",
            "Hz",
            tuple(f"f{i}" for i in range(1, 9)),
            (5.527393, 10.886839, 15.915494, 20.460565, 24.383952, 27.566445, 29.911345, 31.347404),
            lambda: (
                _circular_frequencies({"repeat": 8, "mass": 10, "stiffness": 1e5}, {"mass": 1e13, "stiffness": 1e5})[1:]
                / (2.0 * math.pi)
            ),
            5.5e-7,
            ROUNDING,
            remark="printed with six decimals; the frequency of the wall, 5e-6 Hz, is left out",
        ),
        ValidationCase(
            "code-aster-sdld106",
            "an oscillator of 0.1 Hz under sin t",
            "code_aster, V2.01.106 (SDLD106)",
            "Hz, m",
            ("f0", "u(1 s)"),
            (0.1, 1.55346e-3),
            _forced_by_a_sine,
            5e-4,
            ROUNDING,
            relative=True,
            remark="5e-4 is code_aster's own tolerance",
        ),
        ValidationCase(
            "baker-2015",
            "fragility of the largest likelihood of published stripes",
            "J. W. Baker (2015), Earthquake Spectra 31(1), example data; a direct search stands for the result",
            "1",
            ("theta", "beta"),
            (1.07611579, 0.4292372),
            _stripes,
            5e-8,
            NUMERICAL,
            remark="the numbers printed in the paper were not at hand",
        ),
    )


def validate() -> Several[ValidationResult]:
    """Closed forms, tables of textbooks and printed results of other programs beside those of this installation: for
    each case the largest difference and whether it is within what the case allows."""
    return Several([carry_out(case) for case in (*closed_form_cases(), *textbook_cases())])
