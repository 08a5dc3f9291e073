"""Tables and figures of the results of this package: class of a result -> its presentation."""

from __future__ import annotations

from tdint import assessment
from tdint.output.presentations import Presentation, row

PRESENTATIONS: dict[str, Presentation] = {
    "Chart": Presentation(
        lambda result: assessment.chart.chart_tables.chart_table(result),
        picture=lambda result, _: assessment.chart.chart_figures.chart_picture(
            result, name="Work-precision diagram", target="peak-drift"
        ),
        alone=True,
    ),
    "ExampleRun": Presentation(
        rows=lambda results, _: assessment.examples.example_tables.example_table(results)
    ),
    "FieldChart": Presentation(
        lambda result: assessment.chart.chart_tables.profile_table(result),
        picture=lambda result, _: assessment.chart.profile_figures.profile_picture(
            result, target="peak-drift"
        ),
        alone=True,
    ),
    "ObservedOrder": Presentation(
        columns=lambda _: assessment.order.order_tables.ORDER,
        picture=lambda results, _: assessment.order.order_figures.order_picture(results),
    ),
    "Overshoot": Presentation(
        columns=lambda _: assessment.stability.stability_tables.OVERSHOOT,
        picture=lambda results, _: assessment.stability.stability_figures.overshoot_picture(
            results
        ),
    ),
    "StabilityCurve": Presentation(
        columns=lambda _: assessment.stability.stability_tables.STABILITY,
        picture=lambda results, _: assessment.stability.stability_figures.stability_picture(
            results
        ),
        on_axes=lambda ax, results, _: assessment.stability.stability_figures.draw_radius(
            ax, results
        ),
    ),
    "Trial": Presentation(
        rows=row(lambda: assessment.failures.failure_tables.FAILURE),
        picture=lambda results, _: assessment.failures.failure_figures.failure_picture(results),
    ),
    "ValidationResult": Presentation(
        rows=row(lambda: assessment.validation.validation_tables.VALIDATION)
    ),
}
