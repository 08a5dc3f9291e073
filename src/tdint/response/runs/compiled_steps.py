"""Compiled steps of methods: the check of plug-ins, and the kernels of a time integration."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from contextlib import suppress

from tdint.errors import AnalysisError
from tdint.kernels.building.compilable import PLAIN, Variant
from tdint.kernels.building.sources import digest
from tdint.kernels.compiling import Kernel
from tdint.kernels.laws import LAWS, LINEAR
from tdint.kernels.laws.compiled import CompiledLaw, compiled_laws
from tdint.kernels.located_peaks import update_located_peaks
from tdint.kernels.time_loop.loop import integrate
from tdint.kernels.time_loop.observer import initialize_laws, sum_law_energies
from tdint.methods.catalogue import EXACT, catalogue, parse
from tdint.methods.linear_step import step_coefficients
from tdint.methods.method import Integrator
from tdint.model.building import Building
from tdint.system import cache_subfolder

LINEAR_OSCILLATORS = Variant(PLAIN, compiled_laws([LINEAR]))
"""Variant of the kernels for linear oscillators."""

LOOP_KERNELS = (initialize_laws, sum_law_energies, update_located_peaks)
"""Kernels that the time loop calls in addition to the step of a method, in the order of its
arguments."""

VALIDATED_STEPS: set[Kernel] = set()
"""Steps of plug-ins that this process has executed in plain Python, or that are being executed."""

STEPS_WITH_BALANCE: set[Kernel] = set()
"""Steps of plug-ins with energies of yielding stories that this process has also validated."""

_VALIDATION_LOCK = threading.RLock()
if hasattr(os, "register_at_fork"):  # the thread with the lock does not exist in the child
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
    """Check the energies of a step, or all other properties, once for each version of its sources.

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
    codes = [law.code for law in variant.laws if isinstance(law, CompiledLaw)]
    return any(LAWS[code].functions().accumulate_dissipation for code in codes)


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


def _methods(supports: Callable[[Integrator], bool]) -> str:
    """Return the names of the methods that a condition selects, with their default parameters."""
    return ", ".join(name for name in catalogue() if supports(parse(name)))


_MAX_DAMPING_RATIO = 1e5
"""Maximum damping ratio of a mode with a well conditioned transition over a time step. The slowest
rate behind a damper is 1 / (4 ratio^2) of the fastest rate, so that its relative rounding error is
about 1e-16 times 4 ratio^2: 1e-5 at this ratio."""


def unsupported_reason(integrator: Integrator, building: Building) -> str:
    """Return a message if a method does not support a building; empty if it does.

    Some methods do not support nonlinear stories, power-law dashpots or braces of dampers.
    """
    if building.inertial:
        if not integrator.family.inertance:
            return (
                f"{integrator.label} does not support inertance with a law that is not linear; use "
                f"one of {_methods(lambda other: other.family.inertance)}"
            )
        if building.has_damper_state:
            return (
                "inertance is not supported together with braces of dampers, Rayleigh damping with "
                "the tangent stiffness, or `restitution` of the law hertz; omit one of them"
            )
    elif building.system is not None and len(building.system.inerters):
        if integrator.method.name != EXACT and step_coefficients(integrator) is None:
            others = _methods(lambda other: step_coefficients(other) is not None)
            return f"{integrator.label} does not support inertance; use one of {EXACT}, {others}"
    elif building.system is not None and integrator.method.name != EXACT:
        return (
            f"{integrator.label} does not support models of matrices and flexural stories; use "
            f"{EXACT}"
        )
    if building.uses_matrices:
        ratio = float(building.modes().own_damping(building.damping_matrix()).max())
        if ratio > _MAX_DAMPING_RATIO:
            return (
                f"the damping ratio of a mode is {ratio:.3g}, above {_MAX_DAMPING_RATIO:g}: "
                "rounding destroys the slow movement behind such a damper; reduce the damping, or "
                "omit the rows that it holds"
            )
    if building.tangent_damped and not integrator.tangent_damping:
        return (
            f"{integrator.label} does not support Rayleigh damping with the tangent stiffness; use "
            f"one of {_methods(lambda other: other.tangent_damping)}, or omit `tangent` from the "
            "damping"
        )
    if building.impact_damped and not integrator.family.impact_damping:
        return (
            f"{integrator.label} does not support `restitution` of the law hertz; use "
            f"{_methods(lambda other: other.family.impact_damping)}"
        )
    if building.braced and not integrator.method.braces:
        return (
            f"{integrator.label} does not support dampers with a brace; use one of "
            f"{_methods(lambda other: other.method.braces)}, or omit `brace` from the dashpots"
        )
    needed = "braced_devices" if building.has_damper_state else "devices"
    if building.branched and not getattr(integrator.family, needed):
        with_state = building.has_damper_state
        of_dampers = " with braces of dampers or tangent damping" if with_state else ""
        return (
            f"{integrator.label} does not support attachments and links{of_dampers}; use one of "
            f"{_methods(lambda other: getattr(other.family, needed))}"
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
