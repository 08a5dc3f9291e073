"""Tables of a chart of work against precision."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from tdint.output.tables.columns import methods as columns
from tdint.output.tables.table import Table, rows_of

if TYPE_CHECKING:
    from tdint.analysis.chart.work_precision import Chart

PEER = "/"
"""In the name of a line that is another program's: program/method."""


def chart_table(chart: Chart) -> Table:
    """One row per method and step; empty cells for what there is not."""
    return Table.of_results(columns.CHART, chart.points)


def sizes_table(charts: Iterable[Chart]) -> Table:
    """The tables of several charts, with the number of stories before all."""
    rows = [
        (chart.stories, *row) for chart in charts for point in chart.points for row in rows_of(columns.CHART, point)
    ]
    return Table.of((columns.CHART_STORIES, *columns.CHART), rows)
