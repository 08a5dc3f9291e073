"""Compiled steps of methods: the check of plug-ins, the kernels of a time integration, and the
stability that is measured on them."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, bisect_interval, cached_property
from tdint.errors import AnalysisError
from tdint.kernels import layout as rows
from tdint.kernels.building.compilable import Variant
from tdint.kernels.building.sources import digest
from tdint.kernels.compiling import Kernel
from tdint.kernels.laws import LAWS
from tdint.kernels.located_peaks import update_located_peaks
from tdint.kernels.stepping import Scene
from tdint.kernels.time_loop.loop import integrate
from tdint.kernels.time_loop.observer import initialize_laws, sum_law_energies
from tdint.methods.catalogue import EXACT, catalogue, parse
from tdint.methods.method import Integrator
from tdint.methods.workspace import workspace
from tdint.model.building import Building, oscillators
from tdint.system import cache_subfolder

LINEAR_OSCILLATORS = Variant(
    laws=("linear",),
    modal=False,
    forces=False,
    power_dampers=False,
    elements=False,
    braces=False,
    tangent_damping=False,
)
"""Variant of the kernels for linear oscillators."""

LOOP_KERNELS = (initialize_laws, sum_law_energies, update_located_peaks)
"""Kernels that the time loop calls in addition to the step of a method, in the order of its
arguments."""

VALIDATED_STEPS: set[Kernel] = set()
"""Steps of plug-ins that this process has executed in plain Python, or that are being executed."""

STEPS_WITH_BALANCE: set[Kernel] = set()
"""Steps of plug-ins of which this process has also validated the energies of yielding stories."""

_VALIDATION_LOCK = threading.RLock()
if hasattr(os, "register_at_fork"):  # the thread that holds the lock does not exist in the child
    os.register_at_fork(after_in_child=_VALIDATION_LOCK._at_fork_reinit)  # type: ignore[attr-defined]


def validate_plugin_step(integrator: Integrator, variant: Variant = LINEAR_OSCILLATORS) -> None:
    """Execute the step of a plug-in in plain Python before its first compiled run.

    An invalid compiled step could write outside its arrays or lose the state of a story without an
    error. The energies are checked only for a variant with a law that accumulates its dissipated
    energy, because all other results do not depend on the energies. Steps of tdint are not checked.
    If the kernels run in plain Python, no step is checked.

    Raises
    ------
    AnalysisError
        The step is invalid.
    """
    step = integrator.family.step
    if step.function.__module__.startswith("tdint.") or os.environ.get("TDINT_KERNELS") == "python":
        return
    with _VALIDATION_LOCK:
        _validate(integrator, energies=False)
        if _accumulates_energy(variant):
            _validate(integrator, energies=True)


def _validate(integrator: Integrator, *, energies: bool) -> None:
    """Check the energies of a step, or everything else, once for each version of its sources.

    After the check, an empty file is written to the cache directory.
    """
    step = integrator.family.step
    validated = STEPS_WITH_BALANCE if energies else VALIDATED_STEPS
    if step in validated:
        return
    # The check executes the step, which calls this function again. Add the step first, so that the
    # nested call returns immediately.
    validated.add(step)
    folder = cache_subfolder("plugins")
    suffix = "-energies" if energies else ""
    file = folder and folder / f"{digest(step.name)}-{integrator.method.name}{suffix}"
    if file is not None and file.exists():
        return
    # Imported here, because only plug-ins need the check.
    from tdint.methods import step_check

    check = step_check.energy_faults_of_step if energies else step_check.faults_of_step
    if faults := check(integrator):
        validated.remove(step)
        raise AnalysisError(f"{'; '.join(faults)} (`tdint check --plugin` checks all declarations)")
    if file is not None:
        with suppress(OSError):
            file.touch()


def _accumulates_energy(variant: Variant) -> bool:
    """Return True if the steps of a variant must accumulate the dissipated energy of a law."""
    names = {name.partition("@")[0] for name in variant.laws}  # empty for all laws
    return any(
        law.functions().accumulate_dissipation is not None
        for law in LAWS
        if not names or law.name in names
    )


def kernels(integrator: Integrator, variant: Variant) -> list[tuple[Kernel, Variant]]:
    """Return the kernels of a time integration with their variant, in the order of decreasing time
    of compilation.

    Raises
    ------
    AnalysisError
        The step of a plug-in is invalid (`validate_plugin_step`).
    """
    validate_plugin_step(integrator, variant)
    return [(kernel, variant) for kernel in (integrator.family.step, integrate, *LOOP_KERNELS)]


def unsupported_reason(integrator: Integrator, building: Building) -> str:
    """Return a message if a method does not support a building; empty if it does.

    Some methods do not support nonlinear stories, power-law dashpots or braces of dampers.
    """
    if building.system is not None and integrator.method.name != EXACT:
        return (
            f"{integrator.label} does not support models of matrices and flexural stories; use "
            f"{EXACT}"
        )
    if building.tangent_damped and not integrator.tangent_damping:
        names = ", ".join(name for name in catalogue() if parse(name).tangent_damping)
        return (
            f"{integrator.label} does not support Rayleigh damping with the tangent stiffness; use "
            f"one of {names}, or omit `tangent` from the damping"
        )
    if building.braced and not integrator.method.braces:
        names = ", ".join(name for name, method in catalogue().items() if method.braces)
        return (
            f"{integrator.label} does not support dampers with a brace; use one of {names}, or "
            "omit `brace` from the dashpots"
        )
    if building.branched:
        is_braced = building.braced or building.tangent_damped
        needed = "braced_devices" if is_braced else "devices"
        if not getattr(integrator.family, needed):
            names = ", ".join(
                name for name, method in catalogue().items() if getattr(method.family, needed)
            )
            of_dampers = " with braces of dampers or tangent damping" if is_braced else ""
            return (
                f"{integrator.label} does not support attachments and links{of_dampers}; use one "
                f"of {names}"
            )
    if integrator.family.linear_only and not building.linear:
        return (
            f"{integrator.label} supports only linear buildings; this building has nonlinear "
            "stories"
        )
    if building.power_damped and not integrator.family.power_dampers:
        return (
            f"{integrator.label} does not support power-law dashpots; use impulse4 or "
            "newmark-average"
        )
    return ""


# ---- Amplification matrices measured on the compiled steps, and the stability that follows from
# them

STABLE = 1e-9
"""Dimensionless. Excess of a spectral radius above 1 that is attributed to rounding."""

# Number of completed steps that is stored in the state of a method before its step is measured.
# After this number, the start procedure of every method has ended
_COMPLETED_STEPS = 100.0

# Maximum number of oscillators in one building if the coefficients of the step belong to the
# complete building. Its matrix is dense, and from 26 oscillators LAPACK returns mixed modes of
# uncoupled oscillators.
_MAX_COUPLED = 16


def amplification(integrator: Integrator, omega: Array, damping: Array, h: float) -> Array:
    """Return amplification matrices of free oscillators over one time step.

    Each matrix is measured by one step from a unit value in each row of the memory of the method.

    Returns
    -------
    ndarray, shape (k, m, m)
        Matrices; m is the number of memory rows of the method family. Units are the units of the
        state.
    """
    omega, damping = np.broadcast_arrays(np.asarray(omega, float), np.asarray(damping, float))
    # If the coefficients of the method belong to the complete building, limit the number of
    # oscillators in a building.
    if integrator.family.prepare is not None:
        starts = range(0, max(omega.size, 1), _MAX_COUPLED)
        groups = [
            oscillators(omega[j : j + _MAX_COUPLED], damping[j : j + _MAX_COUPLED]) for j in starts
        ]
        return np.concatenate([_amplification(integrator, group, h) for group in groups])
    return _amplification(integrator, oscillators(omega, damping), h)


def _amplification(integrator: Integrator, building: Building, h: float) -> Array:
    """Return the amplification matrices of the uncoupled oscillators of a building (`oscillators`),
    each of mass 1 kg, shape (k, m, m).

    The memory rows of a method are the m rows of its state that a step uses from the previous step,
    such as displacement and velocity. Column j of a matrix contains the memory rows after one step
    that starts with the value 1 in memory row j and 0 in all further rows.
    """
    memory_rows = integrator.family.memory
    k = building.stories
    forces = np.zeros((0, rows.FORCE_COLUMNS))  # no forces on floors
    coefficients = integrator.coefficients(building, forces, h)
    step = integrator.family.step.variant(LINEAR_OSCILLATORS)
    validate_plugin_step(integrator)
    space = workspace(building, integrator)
    scene = Scene(
        building.linear_terms, building.modal, building.law_parameters, forces, space.flags
    )
    result = np.empty((k, len(memory_rows), len(memory_rows)))
    state, law_state, stiffness = space.state, space.law_state, building.initial_stiffness
    for column, row in enumerate(memory_rows):
        state[:], law_state[:] = 0.0, 0.0
        state[row, :k] = 1.0
        # If the acceleration is not part of the memory of the method, it follows from equilibrium
        # for the unit mass.
        u, v = state[rows.DISPLACEMENT, :-1], state[rows.VELOCITY, :-1]
        law_state[rows.DRIFT, :-1], law_state[rows.FORCE, :-1], law_state[rows.SLOPE, :-1] = (
            u,
            stiffness * u,
            stiffness,
        )
        # A linear spring has no drifts where its branch changes.
        law_state[rows.UPPER, :-1], law_state[rows.LOWER, :-1] = math.inf, -math.inf
        if rows.ACCELERATION not in memory_rows:
            state[rows.ACCELERATION, :-1] = (
                -stiffness * u - building.linear_terms[rows.STORY_DAMPER, :-1] * v
            )
        # The step must not execute the start procedure of the method.
        space.step_status[rows.STEPS_DONE] = _COMPLETED_STEPS
        code = step(coefficients, *scene, h, np.zeros(rows.LOAD_SIZE), *space.memory)
        if code < 0:
            raise AnalysisError(
                f"{integrator.label}: the time step {h:.6g} s of a linear oscillator failed, so "
                "the stability of the method cannot be measured"
            )
        result[:, :, column] = state[list(memory_rows), :k].T
    return result


def spectral_radius(integrator: Integrator, omega: Array, damping: Array, h: float) -> Array:
    """Return the spectral radii of the amplification matrices of oscillators, shape (k,)."""
    matrices = amplification(integrator, omega, damping, h)
    # The memory of a method contains quantities in m, m/s and m/s^2. Scale its rows to similar
    # magnitudes, which reduces rounding errors of the eigenvalues.
    family = integrator.family
    scale = np.array([h ** family.derivatives[row] for row in family.memory])
    matrices = matrices * scale[:, None] / scale
    return np.asarray(np.max(np.abs(np.linalg.eigvals(matrices)), axis=1))


@dataclass(frozen=True)
class Instability:
    """Unstable oscillator for a time step h (s).

    Attributes
    ----------
    stable : callable
        Function that receives a time step, s, and returns True if all oscillators are stable with
        it.
    """

    index: int
    h: float
    stable: Callable[[float], bool] = field(compare=False)

    @cached_property
    def largest_stable(self) -> float:
        """Largest stable time step below h, s; 0 if there is none.

        It is computed on first access with about 150 measurements.
        """
        return largest_stable(self.stable, self.h)


def find_instability(
    integrator: Integrator, omega: Array, damping: Array, h: float
) -> Instability | None:
    """Return the stiffest oscillator that is unstable with a time step; None if all are stable.

    An oscillator is unstable if the spectral radius of its measured amplification matrix is above
    1. A method that declares no stability limit is not measured; the result is None.
    """
    if integrator.stability_limit == math.inf:
        return None

    def is_unstable(step: float) -> NDArray[np.bool_]:
        """Return True for each oscillator that grows with a time step."""
        return spectral_radius(integrator, omega, damping, step) > 1.0 + STABLE

    grows = np.flatnonzero(is_unstable(h))
    if not grows.size:
        return None
    stiffest = grows[np.argmax(omega[grows])]
    return Instability(int(stiffest), h, lambda step: not is_unstable(step).any())


def largest_stable(stable: Callable[[float], bool], h: float) -> float:
    """Return the end of the first interval of stable time steps in (0, h], rounded down, s.

    The interval is searched upward from 0 in 200 equal steps, and its end is bisected. The result
    is 0 if no step is stable.

    Parameters
    ----------
    stable : callable
        Function that receives a time step, s, and returns True if it is stable.
    h : float
        Upper end of the search, s.
    """
    low, high = 0.0, h
    # Some methods are unstable at intermediate time steps and stable again above them. Searching in
    # steps of h / 200 locates the first stable interval.
    for part in range(1, 201):
        candidate = h * part / 200
        if not stable(candidate):
            high = candidate
            break
        low = candidate
    # After 40 bisections the result is more precise than any time step that is written in messages.
    low, _ = bisect_interval(stable, low, high, 40)
    return low if low > 1e-9 * h else 0.0
