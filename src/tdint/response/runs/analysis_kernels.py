"""Kernels that the analyses of a model need, for compilation ahead of time and in the background of
a run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from tdint.kernels.building.compilable import EVERYTHING, FULL, PLAIN, Variant
from tdint.kernels.building.load_or_compile import (
    compile_ahead,
    interpret_while_compiling,
)
from tdint.kernels.compiling import Kernel
from tdint.kernels.laws import OURS
from tdint.kernels.laws.compiled import compiled_laws
from tdint.kernels.stories.law_state import follow
from tdint.methods.catalogue import catalogue, method_of, parse
from tdint.methods.method import Integrator
from tdint.model.definition import Model
from tdint.response.arguments import AnyModel, model_of
from tdint.response.runs.compiled_steps import (
    LINEAR_OSCILLATORS,
    kernels,
    unsupported_reason,
)
from tdint.response.runs.prepared import PreparedBuilding


def kernels_of_model(model: Model, integrator: Integrator) -> list[tuple[Kernel, Variant]]:
    """Return the kernels of a run of a model with all tables of its results, and of a cyclic test
    of its stories, each with the variant for the model.
    """
    prepared = PreparedBuilding.of(model)
    return [*kernels(integrator, prepared.variant), *_other_kernels(prepared, integrator)]


def _other_kernels(
    prepared: PreparedBuilding, integrator: Integrator
) -> list[tuple[Kernel, Variant]]:
    """Return further kernels that the analysis of a run may call, with their variants.

    The time loop does not call them. They are compiled in the background, together with the kernels
    of the loop, so that later calls do not have to wait.
    """
    # `follow` computes the forces of a story along a path of drifts, for pushover and cyclic tests.
    other_kernels = [(follow, prepared.variant), _spectra()]
    # The stability of a method that declares a finite limit is measured with linear oscillators.
    if integrator.stability_limit != math.inf:
        other_kernels.append((integrator.family.step, LINEAR_OSCILLATORS))
    return other_kernels


def run_interpreted(
    prepared: PreparedBuilding, methods: Sequence[Integrator], needs_spectra: bool
) -> bool:
    """Return True if a run starts with time loops in plain Python because they are not compiled
    yet; otherwise load or compile them.

    Another process compiles the loops at the same time
    (`tdint.kernels.building.load_or_compile.interpret_while_compiling`).

    Parameters
    ----------
    methods : sequence of Integrator
        Method of the run and method of its error estimate.
    needs_spectra : bool
        The run has a summary, which states a spectral acceleration of its ground motion.
    """
    building = prepared.building
    # Models of matrices need no kernels.
    if building.uses_matrices or unsupported_reason(methods[0], building):
        return False
    loop_kernels = dict.fromkeys(
        item for method in methods for item in kernels(method, prepared.variant)
    )
    if interpret_while_compiling(
        list(loop_kernels),
        lambda: list(
            dict.fromkeys(item for method in methods for item in _other_kernels(prepared, method))
        ),
    ):
        return True
    # The processes that compile the loops also compile the spectra.
    prepared.compile(methods, others=[_spectra()] if needs_spectra else [])
    return False


def _spectra() -> tuple[Kernel, Variant]:
    """Return the kernel of response spectra. It is imported here, because a run without a
    summary does not need it."""
    from tdint.kernels.oscillators.elastic import peaks

    return peaks, EVERYTHING


def all_kernels() -> list[tuple[Kernel, Variant]]:
    """Return all kernels in both forms, with all laws that cannot fracture."""
    # Imported here, because a run does not need these kernels.
    from tdint.kernels.oscillators.bilinear import bilinear_response
    from tdint.kernels.oscillators.elastic import peaks
    from tdint.kernels.oscillators.extremes import extremes, radii
    from tdint.kernels.oscillators.modal_sums import largest_drifts
    from tdint.kernels.oscillators.rotated import rotated_peaks

    laws = compiled_laws(range(OURS))
    forms = [Variant(form, laws) for form in (PLAIN, FULL)]
    steps = [item for name in catalogue() for form in forms for item in kernels(parse(name), form)]
    others = (peaks, extremes, radii, rotated_peaks, largest_drifts, bilinear_response)
    return [
        *steps,
        *((follow, form) for form in forms),
        *((kernel, EVERYTHING) for kernel in others),
    ]


def compile_model(model: AnyModel, method: str | None = None) -> list[Path]:
    """Compile the time loops for runs of a model, which its first run would compile otherwise.

    Parameters
    ----------
    model : Model, str, Path or mapping
        Argument that `run` accepts.
    method : str, optional
        Method specification; by default that of the model.

    Returns
    -------
    list of Path
        Written files; empty if everything was compiled before.

    Raises
    ------
    ModelError, UsageError
        The model is invalid, or the method is unknown.
    OutputError
        The files cannot be written.
    """
    building = model_of(model)
    integrator = parse(method_of(building, method))
    return compile_ahead(
        kernels_of_model(building, integrator), ("native",), None, lambda done: None
    )
