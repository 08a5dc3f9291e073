"""tdint: earthquake response of shear buildings with a time-integration method of your choice.

A tour; everything is in SI units, `help(tdint.run)` and the like tell shapes, units and sources:

    model = tdint.load_model("office.yaml")              # or a mapping that says the same
    record = tdint.read_record("station.mseed", component="HNE", units="m/s^2")
    record = tdint.make_record(samples, dt=0.01, units="g")      # or of an ObsPy Trace or Stream
    record = tdint.process(record, baseline="linear", highpass=0.1)
    tdint.modes(model)                                   # periods, damping ratios, masses
    response = tdint.run(model, record, history=True, check=True)
    response.stories.peak_drift_ratio                    # an array over the stories
    response.plot(), response.plot(ax=ax)                # a matplotlib Figure; or its main panel on your axes
    pandas.DataFrame(response.to_dict("kip,in,g"))       # the columns of the command's table, in other units
    case = tdint.prepare(model, record)                  # put together once for many runs:
    tdint.run_case(case.scaled(2.0))
    tdint.run_many(models, records, scales=[1, 2], history="drift")    # arrays [run, time, story], on all processors
    tdint.run_sequence(case, [record, aftershock])       # one after the other; .shocks has the peaks of each
    tdint.cyclic_test(model, 1, ["1%", "2%"])            # the law of a story, as in a laboratory
    tdint.pushover(model, "2%")

Each command has the function of its name; what these give shows itself in a line, as a table in a notebook, has its
columns by `to_dict`, is drawn by `plot`, and can be pickled:

    Buildings        init, check, run (run_many, run_case of prepare, run_sequence), modes, law, pushover, compare,
                     inventory
    Ground motions   info, spectrum (rotated_spectrum of read_horizontals, constant_ductility, constant_strength,
                     floor_spectra of a response), drift_spectrum
    Studies          campaign, scale, ida, sensitivity, fragility (fit_stripes, fit_capacities, fit_cloud)
    Methods          methods, stability, overshoot, order, failures, examples, chart; load_plugin, register_method,
                     register_law
    Housekeeping     compile, validate

Text tables that do not tell what they are take a `TextLayout`. All of it loads on first use, so that importing tdint
costs nothing; matplotlib loads with the first picture.
"""

from __future__ import annotations

import re
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdint.tabular import Tabular
from tdint.version import __version__ as __version__

if TYPE_CHECKING:
    from tdint.analysis.assessment.failures import failures as failures
    from tdint.analysis.assessment.order import order as order
    from tdint.analysis.assessment.overshoot import overshoot as overshoot
    from tdint.analysis.assessment.paper_examples import run_examples
    from tdint.analysis.assessment.stability import stability as stability
    from tdint.analysis.chart.work_precision import chart as chart
    from tdint.analysis.comparison.compare import compare as compare
    from tdint.analysis.run.compilation import compile_model
    from tdint.analysis.run.overview import modes as modes
    from tdint.analysis.run.overview import overview
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
    from tdint.campaign.carry_out import campaign as campaign
    from tdint.campaign.fragility.fit_table import fragility as fragility
    from tdint.campaign.fragility.fits import fit_capacities as fit_capacities
    from tdint.campaign.fragility.fits import fit_cloud as fit_cloud
    from tdint.campaign.fragility.fits import fit_stripes as fit_stripes
    from tdint.campaign.ida.study import ida as ida
    from tdint.campaign.sensitivity import sensitivity as sensitivity
    from tdint.campaign.suites.scaling import scale as scale
    from tdint.ground_motion.processing_steps import process as process
    from tdint.ground_motion.reading.read import make_record as make_record
    from tdint.ground_motion.reading.read import read_horizontals as read_horizontals
    from tdint.ground_motion.reading.read import read_record as read_record
    from tdint.ground_motion.text_layout import TextLayout as TextLayout
    from tdint.methods.catalogue import list_methods
    from tdint.methods.catalogue import load_plugin as load_plugin
    from tdint.methods.catalogue import register_method as register_method
    from tdint.model.config.model_file import load_model as load_model
    from tdint.model.first_model import first_model
    from tdint.model.inventory.derive import inventory as inventory
    from tdint.model.laws import register_law as register_law
    from tdint.output.plotting import plot as plot
    from tdint.output.tables.spectra import record_info
    from tdint.output.tables.to_dict import to_dict as to_dict
    from tdint.validation.cases import validate as validate

    examples = run_examples
    compile = compile_model
    check = overview
    law = cyclic_test
    methods = list_methods
    init = first_model
    info = record_info


Tabular.tables, Tabular.figures = "tdint.output.tables.to_dict", "tdint.output.plotting"


@cache
def _homes() -> dict[str, tuple[str, str]]:
    """Module and name there of all that a checker of types is told above: it stands there once, and is read, as it is
    loaded, on first use."""
    block = Path(__file__).read_text(encoding="utf-8").partition("if TYPE_CHECKING:\n")[2].partition("\n\n\n")[0]
    homes = {name: (module, name) for module, name in re.findall(r"^    from (\S+) import (\w+)", block, re.M)}
    others = {name: homes[called] for name, called in re.findall(r"^    (\w+) = (\w+)$", block, re.M)}
    return {name: homes[name] for name in re.findall(r" as (\w+)$", block, re.M)} | others


if not TYPE_CHECKING:  # to a checker of types every name would be one of tdint's

    def __getattr__(name: str) -> Any:
        if name == "__all__":
            return __dir__()
        if name not in _homes():
            raise AttributeError(f"module 'tdint' has no attribute {name!r}")
        home, called = _homes()[name]
        return getattr(import_module(home), called)


def __dir__() -> list[str]:
    return sorted(["__version__", *_homes()])
