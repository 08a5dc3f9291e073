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

    Buildings        model_template, check, run (run_many, run_case of prepare, run_sequence,
                     Stepper), modes (response_spectrum_analysis, transfer_function, matrices),
                     cyclic_test (law_path), pushover (target_displacements), compare, inventory
    Ground motions   record_info (intensity), spectrum (rotated_spectrum of read_horizontals,
                     constant_ductility, constant_strength, floor_spectra of a response,
                     design_spectrum), drift_spectrum, fourier_spectrum
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

from importlib import import_module
from types import FunctionType
from typing import Any

from tdint.public_names import DEFINED_AS, PUBLIC
from tdint.system import __version__ as __version__
from tdint.tabular import FunctionPackage, Tabular, WithTable

# The modules that define results must not import the output layer, because the output layer imports
# them. This module is above both layers, and gives the results their table and figure functions.
WithTable.tables = lambda: import_module("tdint.output.to_dict")
Tabular.figures = lambda: import_module("tdint.output.plotting")
Tabular._presentations = lambda: [
    import_module("tdint.studies.presentations").PRESENTATIONS,
    import_module("tdint.assessment.presentations").PRESENTATIONS,
]


def __getattr__(name: str) -> Any:
    """Import a public name at its first use; public functions are wrapped by `validated_call`."""
    if name == "__all__":
        return __dir__()
    if name not in PUBLIC:
        raise AttributeError(f"module 'tdint' has no attribute {name!r}")
    value = getattr(import_module(PUBLIC[name]), DEFINED_AS.get(name, name))
    if not isinstance(value, FunctionType):
        return value
    # The import is here and not at the top, because commands of the terminal never reach this
    # line and should not load the module.
    from tdint.validated_calls import validated_call

    return validated_call(value, name)


FunctionPackage.functions = __getattr__


def __dir__() -> list[str]:
    """Return the sorted public names."""
    return sorted(["__version__", *PUBLIC])
