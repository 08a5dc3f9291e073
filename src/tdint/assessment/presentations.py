"""Tables and figures of the results of this package: class of a result -> its presentation."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tdint.assessment import figures as assessment_figures
from tdint.assessment import tables as assessment_tables
from tdint.output.presentations import Presentation, fixed_columns

if TYPE_CHECKING:
    pass

PRESENTATIONS: dict[str, Presentation] = {
    "Chart": Presentation(
        lambda result: assessment_tables.assessment.chart_table(result),
        picture=lambda result, _: assessment_figures.assessment.chart_picture(
            result, name="Work-precision diagram", target="peak-drift"
        ),
        alone=True,
    ),
    "ExampleRun": Presentation(
        rows=lambda results, _: assessment_tables.assessment.example_table(results)
    ),
    "FieldChart": Presentation(
        lambda result: assessment_tables.assessment.profile_table(result),
        picture=lambda result, _: assessment_figures.chart_profiles.profile_picture(
            result, target="peak-drift"
        ),
        alone=True,
    ),
    "ObservedOrder": Presentation(
        lambda result: assessment_tables.assessment.order_table([result]),
        picture=lambda results, _: assessment_figures.assessment.order_picture(results),
    ),
    "Overshoot": Presentation(
        fixed_columns(lambda: assessment_tables.assessment.OVERSHOOT),
        picture=lambda results, _: assessment_figures.assessment.overshoot_picture(results),
    ),
    "StabilityCurve": Presentation(
        fixed_columns(lambda: assessment_tables.assessment.STABILITY),
        picture=lambda results, _: assessment_figures.assessment.stability_picture(results),
        on_axes=lambda ax, results, _: assessment_figures.assessment.draw_radius(ax, results),
    ),
    "Trial": Presentation(
        rows=lambda results, _: assessment_tables.assessment.failure_table(results),
        picture=lambda results, _: assessment_figures.failure_matrix.failure_picture(results),
    ),
    "ValidationResult": Presentation(
        rows=lambda results, _: assessment_tables.assessment.validation_table(results)
    ),
}
