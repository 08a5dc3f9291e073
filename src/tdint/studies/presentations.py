"""Tables and figures of the results of this package: class of a result -> its presentation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.output import tables
from tdint.output.presentation import Presentation
from tdint.response.spectra.elastic import SA_DAMPING
from tdint.tabular import on_use

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tdint import studies
    from tdint.units import OutputUnits
else:
    studies = on_use("tdint.studies")

_PERIODS = (0.04, 4.0, 100)
"""Range (s) and number of periods of spectra in comparisons with recordings."""


def _comparison_picture(comparisons: Sequence[Any], units: OutputUnits) -> Figure:
    """Return the figure of comparisons of computed with recorded responses of a building."""
    shortest, longest, count = _PERIODS
    # Periods below two sampling intervals are omitted, because there a spectrum depends on the
    # interpolation between samples.
    shortest = max(shortest, 2.0 * comparisons[0].event.base.dt)
    periods = np.geomspace(shortest, longest, count)
    return studies.comparison_figures.comparison_picture(comparisons, periods, SA_DAMPING, units)


def _fragility_picture(functions: Sequence[Any], units: OutputUnits) -> Figure:
    """Return the figure of fragility functions, with accelerations in g."""
    module = studies.fragility_figures
    return module.fragility_picture(module.in_figure_units(functions, units))


def _draw_fragility(axes: Any, functions: Sequence[Any], units: OutputUnits) -> None:
    """Plot fragility functions on a panel, with accelerations in g."""
    module = studies.fragility_figures
    module.draw_functions(axes, module.in_figure_units(functions, units))


PRESENTATIONS: dict[str, Presentation] = {
    "CampaignRuns": Presentation(studies.campaign_tables.stored_columns),
    "Comparison": Presentation(
        studies.comparison_tables.comparison_table,
        picture=_comparison_picture,
    ),
    "Fragility": Presentation(
        rows=lambda results, _: studies.fragility_tables.fragility_table(results),
        picture=_fragility_picture,
        on_axes=_draw_fragility,
    ),
    "FragilityResult": Presentation(
        lambda result: studies.fragility_tables.fragility_table(result.functions),
        picture=lambda result, units: _fragility_picture(result.functions, units),
        on_axes=lambda ax, result, units: _draw_fragility(ax, result.functions, units),
        alone=True,
    ),
    "Gradient": Presentation(
        columns=lambda result: tables.responses.gradient_columns(result),
        picture=studies.suite_figures.gradient_picture,
        alone=True,
        only_si="derivatives are in SI units: units cannot be selected for a gradient",
    ),
    "IdaStudy": Presentation(
        studies.ida_tables.ida_table,
        picture=lambda result, units: studies.ida_figures.ida_picture(
            result.in_units(units.in_figures)
        ),
        on_axes=lambda ax, result, units: studies.ida_figures.draw_ida(ax, result.in_units(units)),
        alone=True,
    ),
    "Match": Presentation(
        lambda result: studies.matching_tables.match_table([result]),
        picture=studies.matching_figures.match_picture,
        on_axes=studies.matching_figures.draw_match,
        alone=True,
    ),
    "Runs": Presentation(
        lambda result: tables.values.runs_columns(result),
        picture=studies.suite_figures.runs_picture,
        on_axes=studies.suite_figures.draw_runs,
        alone=True,
    ),
    "Scaling": Presentation(
        studies.scaling_tables.factor_table,
        picture=studies.scaling_figures.suite_picture,
        on_axes=studies.scaling_figures.draw_suite,
        alone=True,
    ),
    "ParameterEffect": Presentation(
        rows=studies.sensitivity_tables.parameter_effect_table,
        picture=studies.sensitivity_figures.sensitivity_picture,
    ),
}
