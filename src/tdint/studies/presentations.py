"""Tables and figures of the results of this package: class of a result -> its presentation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.analysis.spectra.elastic import SA_DAMPING
from tdint.output import tables
from tdint.output.presentations import Presentation
from tdint.studies import figures as studies_figures
from tdint.studies import tables as studies_tables

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tdint.units import OutputUnits

_PERIODS = (0.04, 4.0, 100)
"""Range (s) and number of periods of spectra in comparisons with recordings."""


def _comparison_picture(comparisons: Sequence[Any], units: OutputUnits) -> Figure:
    """Return the figure of comparisons of computed with recorded responses of a building."""
    shortest, longest, count = _PERIODS
    # Periods below two sampling intervals are omitted, because there a spectrum depends on the
    # interpolation between samples.
    shortest = max(shortest, 2.0 * comparisons[0].event.base.dt)
    periods = np.geomspace(shortest, longest, count)
    return studies_figures.recorded.comparison_picture(comparisons, periods, SA_DAMPING, units)


PRESENTATIONS: dict[str, Presentation] = {
    "CampaignRuns": Presentation(lambda result: studies_tables.campaign.stored_columns(result)),
    "Comparison": Presentation(
        lambda result: studies_tables.comparison.comparison_table([result]),
        picture=_comparison_picture,
    ),
    "Fragility": Presentation(
        rows=lambda results, _: studies_tables.studies.fragility_table(results),
        picture=lambda results, _: studies_figures.collapse.fragility_picture(results),
        on_axes=lambda ax, results, _: studies_figures.collapse.draw_functions(ax, results),
    ),
    "FragilityResult": Presentation(
        lambda result: studies_tables.studies.fragility_table(result.functions),
        picture=lambda result, _: studies_figures.collapse.fragility_picture(result.functions),
        on_axes=lambda ax, result, _: studies_figures.collapse.draw_functions(ax, result.functions),
        alone=True,
    ),
    "Gradient": Presentation(
        lambda result: tables.values.column_values(
            tables.responses.gradient_columns(result), result
        ),
        picture=lambda result, units: studies_figures.many_runs.gradient_picture(result, units),
        alone=True,
        only_si="derivatives are in SI units: units cannot be selected for a gradient",
    ),
    "IdaStudy": Presentation(
        lambda result: studies_tables.studies.ida_table(result),
        picture=lambda result, units: studies_figures.collapse.ida_picture(result.in_units(units)),
        on_axes=lambda ax, result, units: studies_figures.collapse.draw_ida(
            ax, result.in_units(units)
        ),
        alone=True,
    ),
    "Match": Presentation(
        lambda result: studies_tables.matching.match_table([result]),
        picture=lambda result, units: studies_figures.matching.match_picture(result, units),
        on_axes=lambda ax, result, units: studies_figures.matching.draw_match(ax, result, units),
        alone=True,
    ),
    "Runs": Presentation(
        lambda result: tables.values.runs_columns(result),
        picture=lambda result, units: studies_figures.many_runs.runs_picture(result, units),
        on_axes=lambda ax, result, units: studies_figures.many_runs.draw_runs(ax, result, units),
        alone=True,
    ),
    "Scaling": Presentation(
        lambda result: studies_tables.studies.factor_table(result),
        picture=lambda result, units: studies_figures.collapse.suite_picture(result, units),
        on_axes=lambda ax, result, units: studies_figures.collapse.draw_suite(ax, result, units),
        alone=True,
    ),
    "ParameterEffect": Presentation(
        rows=lambda results, units: studies_tables.studies.parameter_effect_table(results, units),
        picture=lambda results, units: studies_figures.sensitivity.sensitivity_picture(
            results, units
        ),
    ),
}
