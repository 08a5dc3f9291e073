"""Columns of campaigns; of a run they are those of its store."""

from __future__ import annotations

from tdint.output.tables.columns.buildings import STORY
from tdint.output.tables.columns.shared import METHOD_SPEC, OF_NAMED_RECORD
from tdint.output.tables.table import Column

OF_BUILDING = (
    Column("building", "building", "name of the building", text=True),
    *OF_NAMED_RECORD,
    Column("scale", "scale", "factor on the ground acceleration"),
)
RUNS = (
    *OF_BUILDING,
    Column("sample", "sample", "number of the draw from a grid of ground motions, from 1; 0 where nothing is drawn"),
    METHOD_SPEC,
    Column("dt_s", "dt_s", "time step, after repetitions with finer ones"),
    Column("status", "status", "how the run ended", text=True),
    Column("collapse_time_s", "collapse_time_s", "time of the collapse"),
    Column("collapse_story", "collapse_story", "story that collapsed first"),
    Column("peak_drift_ratio", "peak_drift_ratio", "largest peak drift over story height"),
    Column("peak_drift_story", "peak_drift_story", "story that has it; without heights that of the largest drift"),
    Column("peak_drift_m", "peak_drift_m", "largest peak drift, of any story"),
    Column("residual_drift_ratio", "residual_drift_ratio", "largest drift over story height at the end of the run"),
    Column("peak_absolute_acceleration_m_s2", "peak_acceleration", "largest absolute acceleration of a floor"),
    Column("peak_acceleration_floor", "peak_acceleration_floor", "floor that has it"),
    Column("peak_roof_displacement_m", "peak_roof_displacement_m", "largest displacement of the roof"),
    Column("peak_base_shear_N", "peak_base_shear_N", "largest restoring force of the first story"),
    Column("energy_error", "energy_error", "imbalance over the largest input energy"),
    Column("steps", "steps", "time steps"),
    Column("pga_m_s2", "pga_m_s2", "peak ground acceleration, scaled"),
    Column("sa_t1_m_s2", "sa_t1_m_s2", "pseudo-acceleration at the building's first period, 5 % damping, scaled"),
)
"""Of runs.csv."""

STORIES = (*OF_BUILDING, *STORY)
"""Of stories.csv of a campaign."""

STATUS = (
    Column("status", "status", "how runs ended; left: not done yet", text=True),
    Column("runs", "runs", "how many"),
)
