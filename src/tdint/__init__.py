"""tdint: earthquake response of shear buildings with a time-integration method of your choice.

A tour; everything is in SI units, `help(tdint.run)` and the like tell shapes, units and sources:

    model = tdint.load_model("office.yaml")              # or a mapping that says the same
    record = tdint.read_record("station.mseed", component="HNE", units="m/s^2")
    record = tdint.make_record(samples, dt=0.01, units="g")      # or of an ObsPy Trace or Stream
    record = tdint.process(record, baseline="linear", highpass=0.1)
    tdint.modes(model)                                   # periods, damping ratios, masses
    response = tdint.run(model, record, history=True, check=True)
    response.stories.peak_drift_ratio                    # an array over the stories
    pandas.DataFrame(response.to_dict("kip,in,g"))       # the columns of the command's table, in other units
    case = tdint.prepare(model, record)                  # put together once for many runs:
    tdint.run_case(case.scaled(2.0))
    tdint.run_many(models, records, scales=[1, 2], history="drift")    # arrays [run, time, story], on all processors
    tdint.run_sequence(case, [record, aftershock])       # one after the other; .shocks has the peaks of each
    tdint.cyclic_test(model, 1, ["1%", "2%"])            # the law of a story, as in a laboratory
    tdint.pushover(model, "2%")

Spectra of records: `spectrum`, `rotated_spectrum` (of `read_horizontals`), `constant_ductility`, `constant_strength`,
`drift_spectrum`, `floor_spectra` of a response. Methods: `stability`. Text tables that do not tell what they are take a
`TextLayout`. In a notebook results show themselves as tables; `to_dict` of each gives its columns. All of it loads on
first use, so that importing tdint costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from tdint.tabular import Tabular
from tdint.version import __version__

if TYPE_CHECKING:
    from tdint.analysis.assessment.stability import stability as stability
    from tdint.analysis.run.run import prepare as prepare
    from tdint.analysis.run.run import run as run
    from tdint.analysis.run.run import run_case as run_case
    from tdint.analysis.run_many import run_many as run_many
    from tdint.analysis.sequence import run_sequence as run_sequence
    from tdint.analysis.spectra.drift import drift_spectrum as drift_spectrum
    from tdint.analysis.spectra.elastic import spectrum as spectrum
    from tdint.analysis.spectra.floors import floor_spectra as floor_spectra
    from tdint.analysis.spectra.inelastic import constant_ductility as constant_ductility
    from tdint.analysis.spectra.inelastic import constant_strength as constant_strength
    from tdint.analysis.spectra.rotated import rotated_spectrum as rotated_spectrum
    from tdint.analysis.static.cyclic import cyclic_test as cyclic_test
    from tdint.analysis.static.pushover import pushover as pushover
    from tdint.campaign.fragility.fits import fit_capacities as fit_capacities
    from tdint.campaign.fragility.fits import fit_cloud as fit_cloud
    from tdint.campaign.fragility.fits import fit_stripes as fit_stripes
    from tdint.campaign.ida.study import ida as ida
    from tdint.ground_motion.processing import process as process
    from tdint.ground_motion.reading.read import make_record as make_record
    from tdint.ground_motion.reading.read import read_horizontals as read_horizontals
    from tdint.ground_motion.reading.read import read_record as read_record
    from tdint.ground_motion.text_layout import TextLayout as TextLayout
    from tdint.methods.catalogue import load_plugin as load_plugin
    from tdint.methods.catalogue import register_method as register_method
    from tdint.model.building import modes as modes
    from tdint.model.config.model_file import load_model as load_model
    from tdint.model.definition import register_law as register_law
    from tdint.output.tables.to_dict import to_dict as to_dict

_HOMES = {
    "load_plugin": "tdint.methods.catalogue",
    "register_law": "tdint.model.definition",
    "register_method": "tdint.methods.catalogue",
    "make_record": "tdint.ground_motion.reading.read",
    "modes": "tdint.model.building",
    "cyclic_test": "tdint.analysis.static.cyclic",
    "pushover": "tdint.analysis.static.pushover",
    "stability": "tdint.analysis.assessment.stability",
    "floor_spectra": "tdint.analysis.spectra.floors",
    "to_dict": "tdint.output.tables.to_dict",
    "TextLayout": "tdint.ground_motion.text_layout",
    "process": "tdint.ground_motion.processing",
    "read_record": "tdint.ground_motion.reading.read",
    "load_model": "tdint.model.config.model_file",
    "prepare": "tdint.analysis.run.run",
    "run": "tdint.analysis.run.run",
    "run_case": "tdint.analysis.run.run",
    "run_many": "tdint.analysis.run_many",
    "run_sequence": "tdint.analysis.sequence",
    "spectrum": "tdint.analysis.spectra.elastic",
    "constant_ductility": "tdint.analysis.spectra.inelastic",
    "constant_strength": "tdint.analysis.spectra.inelastic",
    "fit_capacities": "tdint.campaign.fragility.fits",
    "fit_cloud": "tdint.campaign.fragility.fits",
    "fit_stripes": "tdint.campaign.fragility.fits",
    "ida": "tdint.campaign.ida.study",
    "drift_spectrum": "tdint.analysis.spectra.drift",
    "read_horizontals": "tdint.ground_motion.reading.read",
    "rotated_spectrum": "tdint.analysis.spectra.rotated",
}
__all__ = [
    "TextLayout",
    "__version__",
    "constant_ductility",
    "constant_strength",
    "cyclic_test",
    "drift_spectrum",
    "fit_capacities",
    "fit_cloud",
    "fit_stripes",
    "floor_spectra",
    "ida",
    "load_model",
    "load_plugin",
    "make_record",
    "modes",
    "prepare",
    "process",
    "pushover",
    "read_horizontals",
    "read_record",
    "register_law",
    "register_method",
    "rotated_spectrum",
    "run",
    "run_case",
    "run_many",
    "run_sequence",
    "spectrum",
    "stability",
    "to_dict",
]

Tabular.tables = _HOMES["to_dict"]


if not TYPE_CHECKING:  # to a checker of types every name would be one of tdint's

    def __getattr__(name: str) -> Any:
        if name in _HOMES:
            return getattr(import_module(_HOMES[name]), name)
        raise AttributeError(f"module 'tdint' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
