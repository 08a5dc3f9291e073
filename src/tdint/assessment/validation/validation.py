"""Validation cases of `tdint validate` and the functions that compute them.

The reference values are closed-form solutions, tables of textbooks, printed results of other
programs for models with complete input, and for each optional feature and each law the results of a
separate solver (`tests/validation/separate_solver.py` in the source tree).
"""

from __future__ import annotations

import io
import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from typing import Any

import numpy as np
from scipy.special import ellipj, ellipk

from tdint.arrays import Array as Array
from tdint.arrays import max_absolute
from tdint.ground_motion.reading.read import make_record
from tdint.ground_motion.record import Record
from tdint.model.config.model_file import load_model
from tdint.response.overview import modes
from tdint.response.runs.history import History
from tdint.response.runs.run import run
from tdint.response.spectra.elastic import spectrum
from tdint.response.static.cyclic import cyclic_test
from tdint.tabular import ResultList

# ---- A case: reference values, and the function that computes the same values

ROUNDING = "rounding of the source"
NUMERICAL = "numerical error"
MODEL = "model error"


@dataclass(frozen=True)
class ValidationCase:
    """Reference values with their source, and the function that computes the same values.

    Attributes
    ----------
    name : str
        Short name for tables.
    title : str
        Description of the case in a sentence.
    source : str
        Author, year, and table or equation.
    unit : str
        Unit of the values; "1" for dimensionless values.
    quantities : tuple of str
        Name of each value.
    published : tuple of float
        Reference values.
    computed : callable
        Function without arguments that returns the same number of values, computed by the installed
        program.
    tolerance : float
        Maximum permitted difference, in `unit`; dimensionless if `relative` is True.
    difference_is : str
        Cause of the difference: `ROUNDING`, `NUMERICAL` or `MODEL`.
    relative : bool
        True if differences are divided by the reference values.
    remark : str
        Explanation of the difference.
    """

    name: str
    title: str
    source: str
    unit: str
    quantities: tuple[str, ...]
    published: tuple[float, ...]
    computed: Callable[[], Sequence[float] | Array]
    tolerance: float
    difference_is: str
    relative: bool = False
    remark: str = ""


def cases_of(
    group: str, computations: Mapping[str, tuple[Callable[[], Array], tuple[float, ...]]]
) -> tuple[ValidationCase, ...]:
    """Return the validation cases of a group in the file `validation_cases.toml`.

    Parameters
    ----------
    computations : mapping of str to tuple
        For each name of a case without a model in the file, the function that computes the values,
        and the reference values of a closed-form solution (empty if the file contains published
        values).
    """
    text = (files("tdint") / "validation_cases.toml").read_text(encoding="utf-8")
    cases = []
    for case in tomllib.loads(text)[group]:
        quantities = tuple(case.pop("quantities"))
        model = case.pop("model", None)
        peaks = (partial(_peaks, model, quantities), ())
        computed, formula = peaks if model else computations[case["name"]]
        published = tuple(case.pop("published", ())) or formula
        cases.append(
            ValidationCase(**case, published=published, quantities=quantities, computed=computed)
        )
    return tuple(cases)


@dataclass(frozen=True, eq=False)
class ValidationResult:
    """Result of a validation case.

    Attributes
    ----------
    case : ValidationCase
        The case.
    computed : ndarray
        Computed values.
    differences : ndarray
        Computed minus published values, divided by the published values for a relative case.
    """

    case: ValidationCase
    computed: Array
    differences: Array

    @property
    def largest(self) -> float:
        """Maximum absolute difference; infinite if a value is not finite."""
        sizes = np.abs(self.differences)
        return float(np.max(sizes)) if np.all(np.isfinite(sizes)) else float("inf")

    @property
    def within(self) -> bool:
        """True if all differences are within the tolerance."""
        return self.largest <= self.case.tolerance


def compute_case(case: ValidationCase) -> ValidationResult:
    """Compute a case.

    Raises
    ------
    TdintError
        A run that the case needs failed.
    """
    computed = np.asarray(case.computed(), float)
    # Different numbers of values are an error in the definition of the case, not in the program.
    published = np.asarray(case.published, float)
    if computed.shape != published.shape:
        raise ValueError(
            f"{case.name}: {computed.size} values are computed, but {published.size} are published"
        )
    differences = computed - published
    return ValidationResult(
        case, computed, differences / np.abs(published) if case.relative else differences
    )


# ---- Cases

_OMEGA = 2.0 * math.pi
_XI = 0.05
"""Damping ratio of the closed-form solutions, dimensionless."""


def _history(model: Mapping[str, Any], *record: Record, method: str | None = None) -> History:
    """Run a model and return its response history.

    `method` is the time-integration method instead of the method of the model.
    """
    history = run(load_model(model), *record, method=method, history=True, check=False).history
    assert history is not None
    return history


def _oscillator(method: str, dt: float, duration: float, **keys: Any) -> History:
    """Return the response history of an oscillator with a mass of 1 kg and a period of 1 s.

    `dt` and `duration` are the time step and duration, s. `**keys` contains the further keys of the
    model file; `story` replaces the stiffness of the story.
    """
    story = {"mass": 1.0} | (keys.pop("story", None) or {"stiffness": _OMEGA**2})
    return _history(
        {"stories": [story], "analysis": {"method": method, "dt": dt, "duration": duration}} | keys
    )


def _final_displacement(history: History) -> float:
    """Return the displacement (m) of the first floor at the end of a response history."""
    return float(history.displacement[-1, 0])


def _by_both_methods(dt: float, duration: float, **keys: Any) -> Array:
    """Return the displacements (m) at the end of a run by `moment4` and by `impulse4`; arguments as
    for `_oscillator`."""
    methods = ("moment4", "impulse4")
    histories = (_oscillator(method, dt, duration, **keys) for method in methods)
    return np.array(list(map(_final_displacement, histories)))


def _free_vibration() -> Array:
    """Return the displacement (m) at 1.3 s of a damped oscillator released at 1 m."""
    start = {"displacement": [1.0], "velocity": [0.0]}
    damped = {"damping": {"modal": _XI}, "initial": start}
    return np.array([_final_displacement(_oscillator("exact", 0.1, 1.3, **damped))])


def _resonance() -> Array:
    """Return the displacements (m) at 4.9 s of an undamped oscillator, initially at rest, under a
    sinusoidal force of amplitude 1 N at its natural frequency, by `moment4` and `impulse4`.
    """
    force = {
        "excitation": {"forces": [{"floor": 1, "amplitude": 1.0, "omega": _OMEGA, "phase": "sin"}]}
    }
    return _by_both_methods(0.01, 4.9, **force)


def _sudden_step() -> Array:
    """Return the maximum displacements (m) of undamped oscillators with periods of 0.3, 1 and 3 s
    under a ground acceleration that is constant, 1 m/s^2, from the start.
    """
    record = make_record(np.ones(1001), dt=0.01, units="m/s^2")
    return np.asarray(spectrum(record, np.array([0.3, 1.0, 3.0]), damping=0.0).sd).ravel()


_DUFFING: dict[str, Any] = {
    "story": {"law": {"type": "polynomial", "coefficients": [100.0, 0.0, 1000.0]}},
    "initial": {"displacement": [1.5], "velocity": [0.0]},
}
"""Keys of the oscillator u'' + 100 u + 1000 u^3 = 0 released at 1.5 m."""


def _duffing_frequency() -> tuple[float, float]:
    """Return the circular frequency omega (rad/s) and the parameter m of the Duffing oscillator.

    Released at 1.5 m, it has the displacement 1.5 cn(omega t, m), where cn is the elliptic cosine.
    For u'' + a u + b u^3 = 0 and the amplitude A, omega^2 = a + b A^2 and m = b A^2 / (2 omega^2).
    """
    square = 100.0 + 1000.0 * 1.5**2
    return math.sqrt(square), 1000.0 * 1.5**2 / (2.0 * square)


def _duffing() -> Array:
    """Return the displacements (m) of the Duffing oscillator after 13.3 periods, computed by
    `moment4` and `impulse4` with a time step of 1/300 period.
    """
    omega, m = _duffing_frequency()
    # The period of cn is 4 K(m), where K is the complete elliptic integral (`ellipk`).
    period = 4.0 * float(ellipk(m)) / omega
    return _by_both_methods(period / 300.0, 13.3 * period, **_DUFFING)


def _energy_conservation() -> Array:
    """Return the maximum change of the energy of the Duffing oscillator divided by its initial
    energy, over 200 steps of `moment4`.
    """
    history = _oscillator("moment4", 0.05, 10.0, **_DUFFING)
    # The energy is the sum of the kinetic energy and of the potential energy of the restoring force
    # 100 u + 1000 u^3.
    u, v = history.displacement[:, 0], history.velocity[:, 0]
    energy = 0.5 * v**2 + 50.0 * u**2 + 250.0 * u**4
    return np.array([max_absolute(energy / energy[0] - 1.0)])


def _bilinear_loop() -> Array:
    """Return the hysteretic energy (J) of a bilinear story in a complete cycle.

    The closed form is 4 (1 - a) Fy (D - dy), with the hardening ratio a = 0.05, the yield force
    Fy = 10 N, the amplitude D = 0.03 m (1 % of the height) and the yield drift dy = 0.01 m.
    """
    law = {"type": "bilinear", "yield_force": 10.0, "hardening": 0.05}
    model = load_model({"stories": [{"mass": 1.0, "height": 3.0, "stiffness": 1000.0, "law": law}]})
    # The first cycle starts at zero drift, so only the second cycle is a closed loop.
    return np.array([cyclic_test(model, 1, ["1%", "1%"], points=100).cycles[1].hysteretic_energy])


def closed_form_cases() -> tuple[ValidationCase, ...]:
    """Return the validation cases with closed-form solutions as reference values.

    The functions of the cases compute the same values when they are called; no run is made here.
    """
    # `free` is the displacement of a damped free vibration from 1 m after 1.3 s.
    damped, decay = _OMEGA * math.sqrt(1.0 - _XI**2), math.exp(-_XI * _OMEGA * 1.3)
    free = decay * (math.cos(damped * 1.3) + _XI / math.sqrt(1.0 - _XI**2) * math.sin(damped * 1.3))
    # `resonance` is the displacement of an undamped oscillator under sin(omega t) after 4.9 s.
    angle = _OMEGA * 4.9
    resonance = (math.sin(angle) - angle * math.cos(angle)) / (2.0 * _OMEGA**2)
    # A sudden load results in twice the static displacement, (1 m/s^2) / omega^2.
    steps = tuple(2.0 * (period / (2.0 * math.pi)) ** 2 for period in (0.3, 1.0, 3.0))
    # The Duffing oscillator follows the elliptic cosine; its period has the length 4 K(m).
    _, m = _duffing_frequency()
    duffing = 1.5 * float(ellipj(13.3 * 4.0 * float(ellipk(m)), m)[1])
    computations = {
        "free-vibration": (_free_vibration, (free,)),
        "resonance": (_resonance, (resonance,) * 2),
        "sudden-step": (_sudden_step, steps),
        "duffing": (_duffing, (duffing,) * 2),
        "energy-kept": (_energy_conservation, (0.0,)),
        "bilinear-loop": (_bilinear_loop, (4.0 * 0.95 * 10.0 * (0.03 - 0.01),)),
    }
    return cases_of("closed-form", computations)


INCH = 0.0254
"""Inch in m, by definition. The published examples are in inches."""


def _chopra_5(method: str, law: Mapping[str, Any] | None = None, steps: int = 10) -> Array:
    """Return the displacements (in) of the oscillator of Chopra's examples 5.1 to 5.5.

    `law` is the hysteretic law of the story; linear by default. `steps` is the number of time steps
    of 0.1 s; one displacement for each step.
    """
    model = {
        "units": {"length": "in", "force": "kip", "mass": "kip*s^2/in"},
        "stories": [{"mass": 0.2533, "stiffness": 10.0} | ({"law": dict(law)} if law else {})],
        "damping": {"modal": 0.05},
    }
    force = [10.0 * math.sin(math.pi * i / 6.0) if i < 6 else 0.0 for i in range(11)]
    record = make_record([-p / 0.2533 for p in force], dt=0.1, units="in/s^2")
    return _history(model, record, method=method).displacement[1 : steps + 1, 0] / INCH


_PLASTIC = {"type": "bilinear", "yield_force": 7.5, "hardening": 0.0}


def _bathe(method: str) -> Array:
    """Return the displacements at 3.36 s (12 steps) of the two masses between walls in Bathe's
    textbook, without units, shape (2,).

    Equations: 2 u1'' + 6 u1 - 2 u2 = 0 and u2'' - 2 u1 + 4 u2 = 10.
    """
    model = {
        # The spring from the second mass to the wall is a story below a mass that is too large to
        # move.
        "stories": [
            {"mass": 2, "stiffness": 4},
            {"mass": 1, "stiffness": 2},
            {"mass": 1e12, "stiffness": 2},
        ],
        "excitation": {"forces": [{"floor": 2, "amplitude": 10, "omega": 0, "phase": "cos"}]},
        "analysis": {"dt": 0.28, "duration": 3.36},
    }
    return _history(model, method=method).displacement[-1, :2]


def _five_yielding_stories() -> Array:
    """Return the roof displacement (m) at 2 s (Chopra, example 16.4, as computed by StructDyn)."""
    law = {"type": "bilinear", "yield_force": 125, "hardening": 0.05 / 1.05}
    model = {
        "units": {"length": "m", "force": "kN", "mass": "t"},
        "stories": [{"repeat": 5, "mass": 25.91, "stiffness": 10000, "law": law}],
        "damping": {"modal": 0.05},
    }
    samples = [1.93 * math.sin(2.0 * math.pi * i / 10) if i <= 10 else 0.0 for i in range(21)]
    record = make_record(samples, dt=0.1, units="m/s^2")
    return _history(model, record, method="newmark-average").displacement[-1:, 4]


def _circular_frequencies(*stories: dict[str, Any]) -> Array:
    """Return the circular frequencies (rad/s) of a building with these stories."""
    return modes(load_model({"stories": list(stories)})).omega


def _eigenvalues_of_three_masses() -> Array:
    """Return the eigenvalues (squared circular frequencies, 1/s^2) of a shear building with three
    stories, shape (3,)."""
    stories = (
        {"mass": 11.1, "stiffness": 30},
        {"mass": 22.2, "stiffness": 20},
        {"mass": 33.3, "stiffness": 10},
    )
    return _circular_frequencies(*stories) ** 2


def _frequencies_of_eight_masses() -> Array:
    """Return the natural frequencies (Hz) of eight masses between walls, shape (8,).

    The upper wall is modeled as a very large mass; its frequency, the lowest, is omitted.
    """
    masses, wall = {"repeat": 8, "mass": 10, "stiffness": 1e5}, {"mass": 1e13, "stiffness": 1e5}
    return _circular_frequencies(masses, wall)[1:] / (2.0 * math.pi)


def _forced_by_a_sine() -> Array:
    """Return the natural frequency (Hz) and the displacement (m) at 1 s of case SDLD106 of
    code_aster.
    """
    model = {
        "stories": [{"mass": 100, "stiffness": 100.0 * (0.2 * math.pi) ** 2}],
        "excitation": {"forces": [{"floor": 1, "amplitude": 1, "omega": 1, "phase": "sin"}]},
        "analysis": {"dt": 0.05, "duration": 1},
    }
    return np.array(
        [
            modes(load_model(model)).omega[0] / (2.0 * math.pi),
            _final_displacement(_history(model, method="impulse4")),
        ]
    )


_TEXTBOOKS: dict[str, Callable[[], Array]] = {
    "chopra-E5.1": partial(_chopra_5, "exact"),
    "chopra-E5.2": partial(_chopra_5, "central-difference"),
    "chopra-E5.3": partial(_chopra_5, "newmark-average"),
    "chopra-E5.4": partial(_chopra_5, "newmark-linear"),
    "chopra-E5.5": partial(_chopra_5, "newmark-average", _PLASTIC, 9),
    "chopra-E5.5 by Hyfeast": partial(_chopra_5, "newmark-average", _PLASTIC),
    "bathe-9.1": partial(_bathe, "central-difference"),
    "bathe-9.3": partial(_bathe, "newmark-average"),
    "bathe-9.3 (1976)": partial(_bathe, "wilson:theta=1.4"),
    "bathe-9.4": partial(_bathe, "bathe"),
    "bathe-9.7": partial(_bathe, "exact"),
    "structdyn-16.4": _five_yielding_stories,
    "opensees-eigen": _eigenvalues_of_three_masses,
    "chopra-10.4": partial(
        _circular_frequencies, {"mass": 2, "stiffness": 2}, {"mass": 1, "stiffness": 1}
    ),
    "code-aster-sdld02": _frequencies_of_eight_masses,
    "code-aster-sdld106": _forced_by_a_sine,
}


def textbook_cases() -> tuple[ValidationCase, ...]:
    """Return the validation cases with reference values from tables of textbooks and from printed
    results of other programs."""
    return cases_of("textbook", {name: (computed, ()) for name, computed in _TEXTBOOKS.items()})


def pulse() -> Array:
    """Return the ground acceleration of the cases of features and laws, 5 sin(pi t / 2.4)^2
    sin(3.2 pi t) m/s^2, at the samples of every 0.02 s until 2.4 s."""
    time = 0.02 * np.arange(121)
    return np.asarray(5.0 * np.sin(math.pi * time / 2.4) ** 2 * np.sin(3.2 * math.pi * time))


def _peaks(model: str, quantities: Sequence[str]) -> Array:
    """Return peaks of a model (YAML) under the ground motion `pulse`.

    A quantity is the name of a column and a story, attachment or link: `drift 1` and `drift tank`
    (m), `damper_force 1` (N).
    """
    record = make_record(pulse(), dt=0.02, units="m/s^2")
    result = run(load_model(io.StringIO(model)), record, check=False)
    rows = {str(i + 1): (result.stories, i) for i in range(len(result.model.stories))}
    if result.devices is not None:
        names = [device.name for device in result.model.devices]
        rows |= {name: (result.devices.stories, i) for i, name in enumerate(names)}
    peaks = []
    for quantity, where in map(str.split, quantities):
        table, i = rows[where]
        peaks.append(getattr(table, f"peak_{quantity}")[i])
    return np.array(peaks)


def feature_cases() -> tuple[ValidationCase, ...]:
    """Return the validation cases of optional features and of laws, with reference values from a
    separate solver."""
    return cases_of("feature", {})


def all_cases() -> tuple[ValidationCase, ...]:
    """Return the validation cases that need no other file."""
    return (*closed_form_cases(), *textbook_cases(), *feature_cases())


def validate() -> ResultList[ValidationResult]:
    """Compare closed-form solutions, tables of textbooks, and results of other programs and of a
    separate solver with the values that this installation computes.

    Returns
    -------
    ResultList of ValidationResult
        For each case, the maximum difference, and True if it is within the tolerance of the case.

    Raises
    ------
    AnalysisError
        A case cannot be run.
    """
    return ResultList(list(map(compute_case, all_cases())))
