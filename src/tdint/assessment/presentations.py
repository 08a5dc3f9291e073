"""Tables and figures of the results of assessments: class of a result -> its presentation."""

from __future__ import annotations

from tdint import assessment
from tdint.output.presentation import Presentation, row

PRESENTATIONS: dict[str, Presentation] = {
    "Chart": Presentation(
        lambda result: assessment.tables.chart_table(result),
        picture=lambda result, _: assessment.chart_figures.chart_picture(
            result, name="Work-precision diagram", target="peak-drift"
        ),
        alone=True,
    ),
    "ExampleRun": Presentation(rows=lambda results, _: assessment.tables.example_table(results)),
    "FieldChart": Presentation(
        lambda result: assessment.tables.profile_table(result),
        picture=lambda result, _: assessment.chart_figures.profile_picture(
            result, target="peak-drift"
        ),
        alone=True,
    ),
    "ObservedOrder": Presentation(
        columns=lambda _: assessment.tables.ORDER,
        picture=lambda results, _: assessment.stability_figures.order_picture(results),
    ),
    "Overshoot": Presentation(
        columns=lambda _: assessment.tables.OVERSHOOT,
        picture=lambda results, _: assessment.stability_figures.overshoot_picture(results),
    ),
    "StabilityCurve": Presentation(
        columns=lambda _: assessment.tables.STABILITY,
        picture=lambda results, _: assessment.stability_figures.stability_picture(results),
        on_axes=lambda ax, results, _: assessment.stability_figures.draw_radius(ax, results),
    ),
    "Trial": Presentation(
        rows=row(lambda: assessment.tables.FAILURE),
        picture=lambda results, _: assessment.failure_figures.failure_picture(results),
    ),
    "ValidationResult": Presentation(rows=row(lambda: assessment.tables.VALIDATION)),
}
