"""Compiled steps of methods: the check of plug-ins, and the kernels of a time integration."""

from __future__ import annotations

import os
import threading
from contextlib import suppress
from typing import NamedTuple

from tdint.errors import AnalysisError
from tdint.kernels import layout as rows
from tdint.kernels.building.compilable import PLAIN, Variant
from tdint.kernels.building.sources import digest
from tdint.kernels.compiling import Kernel
from tdint.kernels.laws import LAWS, LINEAR
from tdint.kernels.laws.compiled import CompiledLaw, compiled_laws
from tdint.kernels.laws.law import DriftLaw
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


_MAX_DAMPING_RATIO = 1e5
"""Maximum damping ratio of a mode with a well conditioned transition over a time step. The slowest
rate behind a damper is 1 / (4 ratio^2) of the fastest rate, so that its relative rounding error is
about 1e-16 times 4 ratio^2: 1e-5 at this ratio."""


def unsupported_reason(integrator: Integrator, building: Building) -> str:
    """Return a message if a method does not support a building; empty if it does.

    The message names the methods that support the building.
    """
    obstacle = _obstacle(integrator, building)
    if obstacle is None:
        return ""
    names = [name for name in catalogue() if _obstacle(parse(name), building) is None]
    remedies = [f"use {'one of ' * (len(names) > 1)}{', '.join(names)}"] if names else []
    remedies += filter(None, [obstacle.remedy])
    return f"{integrator.label} does not support {obstacle.part}; {', or '.join(remedies)}"


class _Obstacle(NamedTuple):
    """Part of a building that a method does not support, and a change of the model as remedy."""

    part: str
    remedy: str = ""


def _obstacle(integrator: Integrator, building: Building) -> _Obstacle | None:
    """Return the first part of a building that a method does not support; None if it supports all
    parts."""
    family, is_exact = integrator.family, integrator.method.name == EXACT
    if building.inertial:
        if not family.inertance:
            return _Obstacle("inertance with a law that is not linear")
        if building.has_damper_state:
            return _Obstacle(
                "inertance together with braces of dampers, Rayleigh damping with the tangent "
                "stiffness, or `restitution` of the law hertz",
                "omit one of them",
            )
    elif building.system is not None and len(building.system.inerters):
        if not is_exact and step_coefficients(integrator) is None:
            return _Obstacle("inertance")
    elif building.system is not None and not is_exact:
        return _Obstacle("models of matrices and flexural stories")
    if building.uses_matrices:
        ratio = float(building.modes().own_damping(building.damping_matrix()).max())
        if ratio > _MAX_DAMPING_RATIO:
            return _Obstacle(
                f"the damping ratio {ratio:.3g} of a mode, above {_MAX_DAMPING_RATIO:g}: rounding "
                "destroys the slow movement behind such a damper",
                "reduce the damping, or omit the rows that it holds",
            )
    if building.tangent_damped and not integrator.tangent_damping:
        return _tangent_obstacle(building)
    if building.impact_damped and not family.impact_damping:
        return _Obstacle("`restitution` of the law hertz")
    if building.braced and not integrator.method.braces:
        return _Obstacle("dampers with a brace", "omit `brace` from the dashpots")
    if building.branched and not (
        family.braced_devices if building.has_damper_state else family.devices
    ):
        part = "attachments and links"
        if building.braced:
            return _Obstacle(f"{part} with braces of dampers")
        return (
            _tangent_obstacle(building, f"{part} with ")
            if building.tangent_damped
            else _Obstacle(part)
        )
    if family.linear_only and not building.linear:
        return _Obstacle("nonlinear stories")
    if building.power_damped and not family.power_dampers:
        return _Obstacle("power-law dashpots")
    return None


def _tangent_obstacle(building: Building, prefix: str = "") -> _Obstacle:
    """Return the obstacle of damping with the tangent stiffness: of contacts, or of Rayleigh."""
    damped = building.linear_terms[rows.TANGENT_DAMPING, :-1] != 0.0
    codes = building.law_parameters[rows.CODE, : building.stories][damped]
    if all(code > 0 and LAWS[int(code)].stops is not DriftLaw.stops for code in codes.tolist()):
        return _Obstacle(f"{prefix}a dashpot or `restitution` in contact")
    part = f"{prefix}Rayleigh damping with the tangent stiffness"
    return _Obstacle(part, "omit `tangent` from the damping")
