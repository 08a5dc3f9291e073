"""tdint: earthquake response of shear buildings with a time-integration method of your choice.

The following examples show the most important functions. All values are in SI units; the docstring
of each function, such as `help(tdint.run)`, states shapes, units and sources:

    model = tdint.load_model("office.yaml")              # or a mapping with the same keys
    record = tdint.read_record("station.mseed", component="HNE", units="m/s^2")
    record = tdint.make_record(samples, dt=0.01, units="g")      # or from an ObsPy Trace or Stream
    record = tdint.process(record, baseline="linear", highpass=0.1)
    tdint.modes(model)                                   # periods, damping ratios, masses
    response = tdint.run(model, record, history=True, check=True)
    response.stories.peak_drift_ratio                    # array with a value for each story
    response.plot(), response.plot(ax=ax)                # a matplotlib Figure; its main panel on ax
    pandas.DataFrame(response.to_dict("kip,in,g"))       # table of the command in other units
    case = tdint.prepare(model, record)                  # prepared once for many runs:
    tdint.run_case(case.scaled(2.0))
    tdint.run_many(models, records, history="drift")     # arrays [run, time, story], all processors
    tdint.run_sequence(case, [record, aftershock])       # main shock and aftershock: .events
    tdint.cyclic_test(model, 1, ["1%", "2%"])            # cyclic test of the law of a story
    tdint.pushover(model, "2%")

Each command has a function. The result of a function has a one-line description, a table in a
notebook, columns (`to_dict`) and a figure (`plot`), and can be pickled:

    Buildings        model_template, check, run (run_many, run_case of prepare, run_sequence), modes
                     (response_spectrum_analysis, transfer_function), cyclic_test, pushover
                     (target_displacements), compare, inventory
    Ground motions   record_info, spectrum (rotated_spectrum of read_horizontals,
                     constant_ductility, constant_strength, floor_spectra of a response),
                     drift_spectrum, fourier_spectrum
    Studies          campaign, scale, ida, sensitivity, fragility (fit_stripes, fit_capacities,
                     fit_cloud)
    Methods          methods, stability, overshoot, order, failures, paper_examples, chart
                     (performance_profiles); load_plugin
    Housekeeping     compile_model, validate

All errors are instances of `TdintError`; `FailedRun` is the error of a run that stops before the
end. `Model` and `Record` are the inputs, `Response` and `Runs` the results of runs.

A `TextLayout` describes text tables that do not state their columns and units. Modules are imported
at their first use, so that `import tdint` is fast; matplotlib is imported with the first figure.
"""

from __future__ import annotations

import warnings
from functools import cache
from importlib import import_module
from types import FunctionType
from typing import TYPE_CHECKING, Any

from tdint.system import __version__ as __version__
from tdint.tabular import FunctionPackage, Tabular, declared_homes

if TYPE_CHECKING:  # one import per line, because `declared_homes` reads these lines
    from tdint.assessment.chart.performance_profiles import FieldChart as FieldChart
    from tdint.assessment.chart.performance_profiles import (
        performance_profiles as performance_profiles,
    )
    from tdint.assessment.chart.work_precision import Chart as Chart
    from tdint.assessment.chart.work_precision import chart as chart
    from tdint.assessment.examples.paper_examples import ExampleRun as ExampleRun
    from tdint.assessment.examples.paper_examples import paper_examples as paper_examples
    from tdint.assessment.failures.failures import Trial as Trial
    from tdint.assessment.failures.failures import failures as failures
    from tdint.assessment.order.order import ObservedOrder as ObservedOrder
    from tdint.assessment.order.order import order as order
    from tdint.assessment.stability.stability import Overshoot as Overshoot
    from tdint.assessment.stability.stability import StabilityCurve as StabilityCurve
    from tdint.assessment.stability.stability import overshoot as overshoot
    from tdint.assessment.stability.stability import stability as stability
    from tdint.assessment.validation.validation import ValidationResult as ValidationResult
    from tdint.assessment.validation.validation import validate as validate
    from tdint.errors import TdintError as TdintError
    from tdint.ground_motion.choice import TextLayout as TextLayout
    from tdint.ground_motion.horizontals import Horizontals as Horizontals
    from tdint.ground_motion.processing_steps import process as process
    from tdint.ground_motion.reading.read import make_record as make_record
    from tdint.ground_motion.reading.read import read_horizontals as read_horizontals
    from tdint.ground_motion.reading.read import read_record as read_record
    from tdint.ground_motion.record import Record as Record
    from tdint.methods.catalogue import list_methods
    from tdint.methods.catalogue import load_plugin as load_plugin
    from tdint.methods.catalogue import register_method as register_method
    from tdint.methods.method import Integrator as Integrator
    from tdint.model.config.model_file import load_model as load_model
    from tdint.model.definition import Model as Model
    from tdint.model.first_model import model_template as model_template
    from tdint.model.modes import Modes as Modes
    from tdint.model.story_laws import register_law as register_law
    from tdint.output.plotting import plot as plot
    from tdint.output.tables.spectra import RecordInfo as RecordInfo
    from tdint.output.tables.spectra import record_info as record_info
    from tdint.output.to_dict import to_dict as to_dict
    from tdint.response.overview import Overview as Overview
    from tdint.response.overview import modes as modes
    from tdint.response.overview import overview
    from tdint.response.runs.analysis_kernels import compile_model as compile_model
    from tdint.response.runs.case import Case as Case
    from tdint.response.runs.energy import Energy as Energy
    from tdint.response.runs.history import History as History
    from tdint.response.runs.many_results import Runs as Runs
    from tdint.response.runs.outcome import Collapse as Collapse
    from tdint.response.runs.outcome import ErrorEstimate as ErrorEstimate
    from tdint.response.runs.outcome import EventResponse as EventResponse
    from tdint.response.runs.outcome import FailedRun as FailedRun
    from tdint.response.runs.outcome import Gradient as Gradient
    from tdint.response.runs.outcome import Response as Response
    from tdint.response.runs.outcome import StoryErrors as StoryErrors
    from tdint.response.runs.outcome import StoryPeaks as StoryPeaks
    from tdint.response.runs.run import prepare as prepare
    from tdint.response.runs.run import run as run
    from tdint.response.runs.run import run_case as run_case
    from tdint.response.runs.run_many import run_many as run_many
    from tdint.response.runs.sequence import run_sequence as run_sequence
    from tdint.response.spectra.drift import DriftSpectrum as DriftSpectrum
    from tdint.response.spectra.drift import HeightPeriod as HeightPeriod
    from tdint.response.spectra.drift import drift_spectrum as drift_spectrum
    from tdint.response.spectra.elastic import Spectrum as Spectrum
    from tdint.response.spectra.elastic import spectrum as spectrum
    from tdint.response.spectra.floor_motions import FloorSpectrum as FloorSpectrum
    from tdint.response.spectra.floor_motions import floor_spectra as floor_spectra
    from tdint.response.spectra.fourier import FourierSpectrum as FourierSpectrum
    from tdint.response.spectra.fourier import fourier_spectrum as fourier_spectrum
    from tdint.response.spectra.inelastic import InelasticSpectrum as InelasticSpectrum
    from tdint.response.spectra.inelastic import constant_ductility as constant_ductility
    from tdint.response.spectra.inelastic import constant_strength as constant_strength
    from tdint.response.spectra.modal import ModalResponse as ModalResponse
    from tdint.response.spectra.modal import (
        response_spectrum_analysis as response_spectrum_analysis,
    )
    from tdint.response.spectra.rotated import RotatedSpectrum as RotatedSpectrum
    from tdint.response.spectra.rotated import rotated_spectrum as rotated_spectrum
    from tdint.response.spectra.target import TargetSpectrum as TargetSpectrum
    from tdint.response.spectra.transfer import TransferFunction as TransferFunction
    from tdint.response.spectra.transfer import transfer_function as transfer_function
    from tdint.response.static.cyclic import CyclicTest as CyclicTest
    from tdint.response.static.cyclic import cyclic_test as cyclic_test
    from tdint.response.static.pushover import Pushover as Pushover
    from tdint.response.static.pushover import pushover as pushover
    from tdint.response.static.target_displacement import TargetDisplacements as TargetDisplacements
    from tdint.response.static.target_displacement import (
        target_displacements as target_displacements,
    )
    from tdint.studies.campaign.execute import CampaignRuns as CampaignRuns
    from tdint.studies.campaign.execute import campaign as campaign
    from tdint.studies.fragility.fit_table import FragilityResult as FragilityResult
    from tdint.studies.fragility.fit_table import fragility as fragility
    from tdint.studies.fragility.fits import fit_capacities as fit_capacities
    from tdint.studies.fragility.fits import fit_cloud as fit_cloud
    from tdint.studies.fragility.fits import fit_stripes as fit_stripes
    from tdint.studies.fragility.fragility_function import Fragility as Fragility
    from tdint.studies.ida.ida import IdaSettings as IdaSettings
    from tdint.studies.ida.ida import IdaStudy as IdaStudy
    from tdint.studies.ida.ida import ida as ida
    from tdint.studies.ida.ida_curve import Mainshock as Mainshock
    from tdint.studies.motions.matching import Match as Match
    from tdint.studies.motions.matching import match as match
    from tdint.studies.motions.matching import match_suite as match_suite
    from tdint.studies.motions.scaling import Scaling as Scaling
    from tdint.studies.motions.scaling import scale as scale
    from tdint.studies.motions.selection import select as select
    from tdint.studies.recordings.compare import Comparison as Comparison
    from tdint.studies.recordings.compare import compare as compare
    from tdint.studies.regions.inventory import InventoryBuilding as InventoryBuilding
    from tdint.studies.regions.inventory import inventory as inventory
    from tdint.studies.sensitivity.sensitivity import ParameterEffect as ParameterEffect
    from tdint.studies.sensitivity.sensitivity import sensitivity as sensitivity
    from tdint.tabular import ResultList as ResultList

    check = overview
    methods = list_methods


# The modules that define results must not import the output layer, because the output layer imports
# them. This module is above both layers, and gives the results their table and figure functions.
Tabular.tables = lambda: import_module("tdint.output.to_dict")
Tabular.figures = lambda: import_module("tdint.output.plotting")
Tabular._presentations = lambda: [
    import_module("tdint.studies.presentations").PRESENTATIONS,
    import_module("tdint.assessment.presentations").PRESENTATIONS,
]

_DEFINED_AS = {"check": "overview", "methods": "list_methods"}
"""Public names that differ from the names in the modules that define them, with these names."""

_RENAMED_HOMES = {"check": "tdint.response.overview", "methods": "tdint.methods.catalogue"}
"""Modules that define the functions of `_DEFINED_AS`."""

_OLD_NAMES = {
    "compile": "compile_model",
    "examples": "paper_examples",
    "info": "record_info",
    "init": "model_template",
    "law": "cyclic_test",
}
"""Names in version 0.1 and their present names, for the message of an AttributeError."""

_DEPRECATED = dict.fromkeys(
    ("register_law", "register_method"), "load_plugin loads laws and methods from a file"
)
"""Deprecated names, which `dir(tdint)` omits, and their replacement."""


@cache
def _homes() -> dict[str, str]:
    """Return the module that defines each public name, read from the imports under TYPE_CHECKING in
    this file."""
    return declared_homes(__file__) | _RENAMED_HOMES


# The function is hidden from type checkers. Otherwise they would accept every name, even a name
# with a typing error.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """Import a public name at its first use; public functions are wrapped by `validated_call`.

        Deprecated names result in a DeprecationWarning, unknown names in an AttributeError.
        """
        if name == "__all__":
            return __dir__()
        if name in _DEPRECATED:
            warnings.warn(
                f"tdint.{name} will be removed in the next release; {_DEPRECATED[name]}",
                DeprecationWarning,
                stacklevel=2,
            )
        if name not in _homes():
            now = f"; it is {_OLD_NAMES[name]!r} now" if name in _OLD_NAMES else ""
            raise AttributeError(f"module 'tdint' has no attribute {name!r}{now}")
        value = getattr(import_module(_homes()[name]), _DEFINED_AS.get(name, name))
        if not isinstance(value, FunctionType):
            return value
        # The import is here and not at the top, because commands of the terminal never reach this
        # line and should not load the module.
        from tdint.validated_calls import validated_call

        return validated_call(value, name)

    FunctionPackage.functions = __getattr__


def __dir__() -> list[str]:
    """Return the sorted public names without deprecated names."""
    return sorted(["__version__", *(_homes().keys() - _DEPRECATED.keys())])
