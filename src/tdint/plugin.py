"""Public interface for plug-ins: methods, drift laws, reference programs in charts, record formats
and intensity measures.

    from tdint.plugin import STEP, Family, Method, kernel, rows

The docstring of `rows` defines the arguments of the kernels. These names are stable: a name changes
only after a minor release that announces the change. Names of other modules of tdint can change
without notice. Each name is imported when it is first used, so that a law does not load the modules
that methods need.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from tdint.errors import did_you_mean
from tdint.tabular import declared_homes

if TYPE_CHECKING:  # one import per line, because `declared_homes` reads these lines
    from tdint.assessment.chart.problem import Problem as Problem
    from tdint.errors import AnalysisError as AnalysisError
    from tdint.errors import RecordError as RecordError
    from tdint.errors import UsageError as UsageError
    from tdint.ground_motion.formats.lines import NUMBER as NUMBER
    from tdint.ground_motion.formats.lines import Lines as Lines
    from tdint.ground_motion.formats.lines import recognizes as recognizes
    from tdint.ground_motion.formats.series import Series as Series
    from tdint.ground_motion.formats.series import motion_units as motion_units
    from tdint.ground_motion.formats.series import reader as reader
    from tdint.ground_motion.formats.series import required_units as required_units
    from tdint.ground_motion.measures import Measure as Measure
    from tdint.ground_motion.record import Record as Record
    from tdint.kernels import layout
    from tdint.kernels.compiling import F8 as F8
    from tdint.kernels.compiling import I8 as I8
    from tdint.kernels.compiling import TABLE as TABLE
    from tdint.kernels.compiling import VECTOR as VECTOR
    from tdint.kernels.compiling import inline as inline
    from tdint.kernels.compiling import kernel as kernel
    from tdint.kernels.compiling import local as local
    from tdint.kernels.compiling import local_table as local_table
    from tdint.kernels.compiling import outlined as outlined
    from tdint.kernels.equations.newton import EQUILIBRIUM_ROWS as EQUILIBRIUM_ROWS
    from tdint.kernels.equations.newton import ROW as ROW
    from tdint.kernels.equations.newton import factor_rows as factor_rows
    from tdint.kernels.equations.newton import invalidate as invalidate
    from tdint.kernels.equations.newton import solve_equilibrium as solve_equilibrium
    from tdint.kernels.equations.tridiagonal import COUPLING_ROWS as COUPLING_ROWS
    from tdint.kernels.equations.tridiagonal import Combination as Combination
    from tdint.kernels.equations.tridiagonal import ModalBlocks as ModalBlocks
    from tdint.kernels.equations.tridiagonal import assemble_blocks as assemble_blocks
    from tdint.kernels.equations.tridiagonal import assemble_combination as assemble_combination
    from tdint.kernels.equations.tridiagonal import factor as factor
    from tdint.kernels.equations.tridiagonal import factor_blocks as factor_blocks
    from tdint.kernels.equations.tridiagonal import factor_combination as factor_combination
    from tdint.kernels.equations.tridiagonal import factor_damped as factor_damped
    from tdint.kernels.equations.tridiagonal import link_blocks as link_blocks
    from tdint.kernels.equations.tridiagonal import solve as solve
    from tdint.kernels.equations.tridiagonal import solve_blocks as solve_blocks
    from tdint.kernels.equations.tridiagonal import solve_blocks_damped as solve_blocks_damped
    from tdint.kernels.equations.tridiagonal import solve_damped as solve_damped
    from tdint.kernels.laws.branch_following import add_work as add_work
    from tdint.kernels.laws.branch_following import branch_first as branch_first
    from tdint.kernels.laws.branch_following import branch_follower as branch_follower
    from tdint.kernels.laws.branch_following import copy_extra_rows as copy_extra_rows
    from tdint.kernels.laws.branch_following import extra_rows as extra_rows
    from tdint.kernels.laws.branch_following import fail as fail
    from tdint.kernels.laws.branch_following import follow_branches as follow_branches
    from tdint.kernels.laws.branch_following import no_operation as no_operation
    from tdint.kernels.laws.branch_following import set_branch as set_branch
    from tdint.kernels.laws.law import DriftLaw as DriftLaw
    from tdint.kernels.laws.law import LawFunctions as LawFunctions
    from tdint.kernels.laws.law import LawParameter as LawParameter
    from tdint.kernels.laws.law import yields_at_its_strength as yields_at_its_strength
    from tdint.kernels.layout import chained as chained
    from tdint.kernels.linear_terms import add_modal_force as add_modal_force
    from tdint.kernels.linear_terms import finite as finite
    from tdint.kernels.linear_terms import floor_impulse as floor_impulse
    from tdint.kernels.linear_terms import floor_load as floor_load
    from tdint.kernels.linear_terms import force_impulse as force_impulse
    from tdint.kernels.linear_terms import force_moment as force_moment
    from tdint.kernels.linear_terms import force_rate as force_rate
    from tdint.kernels.linear_terms import force_value as force_value
    from tdint.kernels.linear_terms import internal_forces as internal_forces
    from tdint.kernels.linear_terms import power_damper as power_damper
    from tdint.kernels.stepping import STEP as STEP
    from tdint.kernels.stepping import EffectiveCoefficients as EffectiveCoefficients
    from tdint.kernels.stepping import Factors as Factors
    from tdint.kernels.stepping import Memory as Memory
    from tdint.kernels.stepping import Scene as Scene
    from tdint.kernels.stories.law_state import accumulate_dissipation as accumulate_dissipation
    from tdint.kernels.stories.law_state import commit as commit
    from tdint.kernels.stories.law_state import (
        commit_without_dissipation as commit_without_dissipation,
    )
    from tdint.kernels.stories.law_state import hysteretic_energy as hysteretic_energy
    from tdint.kernels.stories.law_state import restoring_force as restoring_force
    from tdint.kernels.stories.law_state import restoring_force_outlined as restoring_force_outlined
    from tdint.kernels.stories.law_state import resume as resume
    from tdint.kernels.stories.law_state import strain_energy as strain_energy
    from tdint.methods.bathe import ImplicitTableau as ImplicitTableau
    from tdint.methods.bathe import composite_method as composite_method
    from tdint.methods.method import Family as Family
    from tdint.methods.method import Method as Method
    from tdint.methods.method import Parameter as Parameter
    from tdint.units import Quantity as Quantity

    rows = layout

HOMES = declared_homes(__file__) | {"rows": "tdint.kernels.layout"}  # the name `rows` is a module
"""Modules that define the names."""

if not TYPE_CHECKING:  # otherwise a type checker would accept every name

    def __getattr__(name: str) -> Any:
        """Import a public name at its first use; raise AttributeError for an unknown name."""
        if name == "__all__":  # `help` shows these names
            return __dir__()
        if name not in HOMES:
            raise AttributeError(
                f"module 'tdint.plugin' has no attribute {name!r}{did_you_mean(name, HOMES)}"
            )
        module = import_module(HOMES[name])
        return module if name == "rows" else getattr(module, name)


def __dir__() -> list[str]:
    """Return the sorted public names."""
    return sorted(HOMES)
