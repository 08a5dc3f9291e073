"""tdint: earthquake response of shear buildings with a time-integration method of your choice.

These functions stand behind the commands: `read_record`, `read_horizontals` (with a `TextLayout` for tables that do not
tell what they are), `process`, `load_model`, `run`, `prepare` and `run_case` (many runs of one building), `spectrum`,
`rotated_spectrum`, `constant_ductility`, `constant_strength` and `drift_spectrum`, `ida`, `fit_capacities`,
`fit_stripes` and `fit_cloud`. They load on first use, so that importing tdint costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tdint.analysis.run.run import prepare as prepare
    from tdint.analysis.run.run import run as run
    from tdint.analysis.run.run import run_case as run_case
    from tdint.analysis.spectra.drift import drift_spectrum as drift_spectrum
    from tdint.analysis.spectra.elastic import spectrum as spectrum
    from tdint.analysis.spectra.inelastic import constant_ductility as constant_ductility
    from tdint.analysis.spectra.inelastic import constant_strength as constant_strength
    from tdint.analysis.spectra.rotated import rotated_spectrum as rotated_spectrum
    from tdint.campaign.studies.fragility.fits import fit_capacities as fit_capacities
    from tdint.campaign.studies.fragility.fits import fit_cloud as fit_cloud
    from tdint.campaign.studies.fragility.fits import fit_stripes as fit_stripes
    from tdint.campaign.studies.ida.study import ida as ida
    from tdint.ground_motion.formats.tables.layout import TextLayout as TextLayout
    from tdint.ground_motion.processing import process as process
    from tdint.ground_motion.reading.read import read_horizontals as read_horizontals
    from tdint.ground_motion.reading.read import read_record as read_record
    from tdint.model.config.read import load_model as load_model

__version__ = "0.1.0"

_HOMES = {
    "TextLayout": "tdint.ground_motion.formats.tables.layout",
    "process": "tdint.ground_motion.processing",
    "read_record": "tdint.ground_motion.reading.read",
    "load_model": "tdint.model.config.read",
    "prepare": "tdint.analysis.run.run",
    "run": "tdint.analysis.run.run",
    "run_case": "tdint.analysis.run.run",
    "spectrum": "tdint.analysis.spectra.elastic",
    "constant_ductility": "tdint.analysis.spectra.inelastic",
    "constant_strength": "tdint.analysis.spectra.inelastic",
    "fit_capacities": "tdint.campaign.studies.fragility.fits",
    "fit_cloud": "tdint.campaign.studies.fragility.fits",
    "fit_stripes": "tdint.campaign.studies.fragility.fits",
    "ida": "tdint.campaign.studies.ida.study",
    "drift_spectrum": "tdint.analysis.spectra.drift",
    "read_horizontals": "tdint.ground_motion.reading.read",
    "rotated_spectrum": "tdint.analysis.spectra.rotated",
}
__all__ = [
    "TextLayout",
    "__version__",
    "constant_ductility",
    "constant_strength",
    "drift_spectrum",
    "fit_capacities",
    "fit_cloud",
    "fit_stripes",
    "ida",
    "load_model",
    "prepare",
    "process",
    "read_horizontals",
    "read_record",
    "rotated_spectrum",
    "run",
    "run_case",
    "spectrum",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'tdint' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
