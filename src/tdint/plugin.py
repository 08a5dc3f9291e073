"""Public interface for plug-ins: methods, drift laws, reference programs in charts, record formats
and intensity measures.

    from tdint.plugin import STEP, Family, Method, kernel, rows

These names are stable: a name changes only after a minor release that announces the change. Names
of other modules of tdint can change without notice. Each name is imported when it is first used, so
that a law does not load the modules that methods need. Each name is documented in the module that
defines it: `help(tdint.plugin.restoring_force)`.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from tdint.errors import did_you_mean

_NAMES_BY_MODULE = {
    "kernels.layout": "chained",
    "kernels.compiling": "F8 I8 TABLE VECTOR inline kernel local local_table outlined specialized",
    "kernels.stepping": "STEP EffectiveCoefficients Factors Memory Scene",
    "kernels.linear_terms": "add_modal_force finite floor_impulse floor_load force_impulse "
    "force_moment force_rate force_value internal_forces power_damper",
    "kernels.stories.law_state": "accumulate_dissipation commit commit_without_dissipation "
    "hysteretic_energy restoring_force restoring_force_outlined resume strain_energy",
    "kernels.equations.newton": "EQUILIBRIUM_ROWS ROW factor_rows invalidate solve_equilibrium",
    "kernels.equations.tridiagonal": "COUPLING_ROWS Combination ModalBlocks assemble_blocks "
    "assemble_combination factor factor_blocks factor_combination factor_damped link_blocks solve "
    "solve_blocks solve_blocks_damped solve_damped",
    "kernels.laws.law": "DriftLaw LawFunctions LawParameter yields_at_its_strength",
    "kernels.laws.branch_following": "add_work branch_first branch_follower copy_extra_rows "
    "extra_rows fail follow_branches no_operation set_branch",
    "methods.method": "Family Method Parameter",
    "analysis.chart.problem": "Problem",
    "ground_motion.formats.lines": "NUMBER Lines recognizes",
    "ground_motion.formats.series": "Series motion_units reader required_units",
    "ground_motion.measures": "Measure",
    "ground_motion.record": "Record",
    "errors": "AnalysisError RecordError UsageError",
    "units": "Quantity",
}

HOMES = {
    name: f"tdint.{module}" for module, names in _NAMES_BY_MODULE.items() for name in names.split()
}
"""Modules that define the names."""

HOMES["rows"] = "tdint.kernels.layout"  # the name is a module


def __getattr__(name: str) -> Any:
    if name not in HOMES:
        raise AttributeError(
            f"module 'tdint.plugin' has no attribute {name!r}{did_you_mean(name, HOMES)}"
        )
    module = import_module(HOMES[name])
    return module if name == "rows" else getattr(module, name)


def __dir__() -> list[str]:
    return sorted(HOMES)
