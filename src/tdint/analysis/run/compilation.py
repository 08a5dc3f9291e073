"""Which kernels analyses call, to compile them ahead."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tdint.analysis.run.prepared import PreparedBuilding
from tdint.analysis.run.workspace import kernels
from tdint.kernels.building.compilable import EVERYTHING, Variant
from tdint.kernels.building.obtaining import compile_ahead
from tdint.kernels.compiling import Kernel
from tdint.kernels.laws.compiled_separately import kernels_apart
from tdint.kernels.march.many import many
from tdint.kernels.march.strides import march_in_strides
from tdint.kernels.oscillators.bilinear import bilinear_response
from tdint.kernels.oscillators.elastic import peaks
from tdint.kernels.oscillators.modal_sums import largest_drifts
from tdint.kernels.oscillators.rotated import rotated_peaks
from tdint.kernels.stories.cyclic import follow
from tdint.methods.catalogue import DEFAULT_METHOD, catalogue, parse
from tdint.methods.method import Integrator
from tdint.model.config.model_file import model_of
from tdint.model.definition import Model


def of_model(model: Model, integrator: Integrator) -> list[tuple[Kernel, Variant]]:
    """What a run of a model calls with all its tables, and a cyclic test of its stories."""
    prepared = PreparedBuilding.of(model)
    apart = kernels_apart(prepared.building.law_parameters)
    others = (peaks, *apart)
    return [*kernels(integrator, prepared.variant), (follow, prepared.variant), *((one, EVERYTHING) for one in others)]


def of_everything() -> list[tuple[Kernel, Variant]]:
    """All kernels, each for all scenes."""
    steps = [one for name in catalogue() for one in kernels(parse(name), EVERYTHING)]
    families = {parse(name).family.name: parse(name).family for name in catalogue()}
    steps += [(one.with_error.step, EVERYTHING) for one in families.values() if one.with_error]
    others = (many, march_in_strides, follow, peaks, rotated_peaks, largest_drifts, bilinear_response, *kernels_apart())
    return [*steps, *((kernel, EVERYTHING) for kernel in others)]


def compile_model(model: Any, method: str | None = None) -> list[Path]:
    """Compile the time loops that a run of a model calls, which its first run else does.

    Parameters
    ----------
    model : Model, str, Path or mapping
        What `run` takes.
    method : str, optional
        In place of the model's.

    Returns
    -------
    list of Path
        The files that were written; none where all of it was compiled already.

    Raises
    ------
    ModelError, UsageError
        The model is none; an unknown method.
    OutputError
        The files cannot be written.
    """
    building = model_of(model)
    integrator = parse(method or building.analysis.method or DEFAULT_METHOD)
    return compile_ahead(of_model(building, integrator), ("native",), None, lambda done: None)
