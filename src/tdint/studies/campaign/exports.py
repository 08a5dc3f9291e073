"""Exports of campaigns: tables as Parquet, which requires pyarrow, demands for SimCenter workflows,
and fragility and vulnerability functions for OpenQuake."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import Any, BinaryIO
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from tdint.arrays import Array
from tdint.errors import UsageError, write_out_controls
from tdint.items import grouped
from tdint.number_parsing import pluralize
from tdint.output.tables.runs import SAMPLE
from tdint.output.tables.table import PARQUET, TEXT, Column, cell_text, describe
from tdint.response.pairs import Run
from tdint.response.runs.outcome import STORY_QUANTITIES
from tdint.response.runs.run_values import RUN
from tdint.studies.campaign.campaign_tables import StoreTable, numeric
from tdint.studies.fragility.fragility_function import Fragility
from tdint.studies.motions.intensity import PAIRS
from tdint.studies.store.result_store import Store
from tdint.studies.store.schema import STORIES
from tdint.tabular import import_optional
from tdint.units import ACCELERATION, LENGTH, VELOCITY

_ROWS_AT_ONCE = 131_072  # rows per row group of a Parquet file

_INTEGER_COLUMNS = {
    SAMPLE.name,
    "story",
    *(quantity.column for quantity in (*RUN, *STORY_QUANTITIES) if quantity.value_type is int),
}


def write_parquet(
    store: Store, table: StoreTable, stream: BinaryIO, *, has_inventory: bool = False
) -> None:
    """Write a table as Parquet.

    Text columns have the type string, except columns of the inventory that contain only numbers.

    With `has_inventory`, the last columns are the columns of the inventory.
    """
    columns, rows = table
    pyarrow, parquet = (import_optional(name, *PARQUET) for name in ("pyarrow", "pyarrow.parquet"))
    # Inventory columns that contain only numbers are numeric. Their cells are text in `rows`.
    numeric_inventory_indices = []
    if has_inventory:
        first = len(columns) - len(store.inventory_columns())
        numeric_inventory_indices = [
            first + index for index, is_number in enumerate(numeric(store)) if is_number
        ]
    descriptions = describe(columns)
    fields = []
    for index, column in enumerate(columns):
        if column.unit == TEXT and index not in numeric_inventory_indices:
            cell_type = pyarrow.string()
        elif column.name in _INTEGER_COLUMNS:
            cell_type = pyarrow.int64()
        else:
            cell_type = pyarrow.float64()
        # Columns have unit and meaning as metadata.
        fields.append(pyarrow.field(column.name, cell_type, metadata=descriptions[column.name]))
    campaign = {"campaign": store.meta("name"), "fingerprint": store.meta("fingerprint")}
    schema = pyarrow.schema(fields, {"tdint": json.dumps(campaign)})
    with parquet.ParquetWriter(stream, schema) as writer:
        remaining_rows = iter(rows)
        while batch := list(islice(remaining_rows, _ROWS_AT_ONCE)):
            cells = list(zip(*batch, strict=True))  # one tuple per column
            for index in numeric_inventory_indices:
                cells[index] = tuple(float(text) if text else None for text in cells[index])
            arrays = []
            for column_cells, field in zip(cells, schema, strict=True):
                if field.type == pyarrow.string():
                    column_cells = tuple(cell and cell_text(cell) for cell in column_cells)
                arrays.append(pyarrow.array(column_cells, field.type))
            writer.write_table(pyarrow.Table.from_arrays(arrays, schema=schema))


def write_simcenter(store: Store, stream: BinaryIO) -> None:
    """Write the demands of all runs of a campaign as CSV with the column names of SimCenter.

    The columns are building, record, scale, sample and, for each direction, 1-PFA-FLOOR-DIR
    (absolute acceleration, m/s^2; floor 0 is the ground), 1-PID-STORY-DIR (drift ratio),
    1-PRD-1-DIR (roof displacement divided by height) and 1-PFD-FLOOR-DIR (displacement, m). The two
    components of a pair share a row. If several rows have the same record, a column `component`
    after `record` distinguishes the components. Cells of runs without a result are empty.

    Raises
    ------
    UsageError
        The store has no stories.
    """
    stories = store.value("SELECT max(story) FROM story_rows")
    if stories is None:
        raise UsageError(
            "the SimCenter export requires story results; set outputs: {stories: true} in the "
            "campaign file"
        )
    rule, records = store.pair_rule(), store.records()
    directions = 2 if rule.pairs else 1
    names = [
        name for direction in range(1, directions + 1) for name in demand_names(stories, direction)
    ]
    # Ground motions in separate rows can have the same name, if they are components of one record.
    sources = [records[number][0] for number, first in rule.recordings.items() if number == first]
    has_component_column = len(set(sources)) < len(sources)
    header = ["building", "record", "component", "scale", "sample", *names]
    if not has_component_column:
        header.remove("component")
    rows = _rows(store, stories, directions, has_component=has_component_column)
    StoreTable([Column(name, "1", name, name) for name in header], rows).write(stream)


def demand_names(stories: int, direction: int) -> list[str]:
    """Return SimCenter's names of the demands of a building in a single direction.

    The names are, for example, `1-PFA-0-1` to `1-PFA-N-1` (floor accelerations, floor 0 is the
    ground), `1-PID-1-1` to `1-PID-N-1` (drift ratios), `1-PRD-1-1` (roof drift ratio) and
    `1-PFD-1-1` to `1-PFD-N-1` (floor displacements) for N stories and direction 1.

    Parameters
    ----------
    direction : int
        Horizontal direction of the ground motion, 1 or 2.
    """
    floors = range(1, stories + 1)
    return [
        *(f"1-PFA-{floor}-{direction}" for floor in (0, *floors)),
        *(f"1-PID-{story}-{direction}" for story in floors),
        f"1-PRD-1-{direction}",
        *(f"1-PFD-{floor}-{direction}" for floor in floors),
    ]


def _rows(
    store: Store, stories: int, directions: int, *, has_component: bool
) -> Iterator[list[Any]]:
    """Yield the rows of the SimCenter export, one per building, ground motion, scale factor and
    sample: identifiers of the run, with the component if `has_component`, and demands in all
    directions (2 if there are pairs).
    """
    recordings, names = store.pair_rule().recordings, store.records()
    pga = dict(store.connection.execute("SELECT id, pga_m_s2 FROM records"))
    demand_count = len(demand_names(stories, 1))  # in each direction
    for building, (name, _) in store.buildings().items():
        # Both components of a pair are in the same row, which belongs to the first component.
        rows: dict[Run, list[Any]] = {}
        for run, values in store.values_of_runs(STORIES, ", ".join(_DEMANDS), building).items():
            first = run._replace(motion=recordings[run.motion])
            cells = rows.setdefault(first, [None] * (demand_count * directions))
            start = demand_count * (run != first)
            demands = _demands_of_run(values, abs(run.scale) * pga[run.motion], stories)
            cells[start : start + demand_count] = demands
        for run, cells in rows.items():
            yield [name, *names[run.motion][: 1 + has_component], run.scale, run.sample, *cells]


_DEMANDS = (
    "height_m",
    "peak_absolute_acceleration_m_s2",
    "peak_drift_ratio",
    "peak_displacement_m",
)


def _demands_of_run(values: Array, pga: float, stories: int) -> list[Any]:
    """Return the cells of the demands of a run, in the order of `demand_names`.

    `values` are `_DEMANDS` of all stories, `pga` is the peak ground acceleration of the scaled
    motion, m/s^2. `stories` is the number of stories of the tallest building. Cells of missing
    stories are empty.
    """
    missing = np.full((stories - len(values), len(_DEMANDS)), math.nan)
    heights, accelerations, drifts, displacements = np.vstack([values, missing]).T.tolist()
    # The building has a height only if all its stories have heights.
    roof_ratio = displacements[len(values) - 1] / sum(heights[: len(values)])
    return [pga, *accelerations, *drifts, roof_ratio, *displacements]


# ---- Fragility functions for OpenQuake: NRML 0.5, lognormal functions defined by mean and standard
# deviation of the intensity (not of its logarithm)

_RANGE = 4.0  # range of the intensities in standard deviations from the medians
_GRAVITY = ACCELERATION["g"]
_PERIOD = r"\((?P<period>[0-9.]+)\)"
_IMTS: tuple[tuple[str, str, Mapping[str, float], float], ...] = (
    (rf"sa{_PERIOD}", "SA({period})", ACCELERATION, _GRAVITY),
    (rf"sa-avg{_PERIOD}", "AvgSA({period})", ACCELERATION, _GRAVITY),
    (r"sa-avg\([0-9.:]+\)", "AvgSA", ACCELERATION, _GRAVITY),
    (r"pga", "PGA", ACCELERATION, _GRAVITY),
    (r"pgv", "PGV", VELOCITY, 0.01),
    (r"arias", "IA", VELOCITY, 1.0),
    (r"cav", "CAV", VELOCITY, _GRAVITY),
    (r"sdi\((?P<period>[0-9.]+),(?P<strength>[0-9.]+)\)", "SDi({period},{strength})", LENGTH, 0.01),
)
"""Pattern of tdint's name of an intensity measure, its name in OpenQuake 3.26
(`openquake.hazardlib.imt`), possible units, and OpenQuake's unit in SI: g, cm/s, m/s, g s, cm."""

STRENGTH = (
    "the second number of SDi is the yield force divided by the weight here; in ground-motion "
    "models of OpenQuake it is the elastic force divided by the yield force: use the hazard of "
    "this measure"
)


def fragility_model(functions: Sequence[Fragility], name: str, states: Sequence[str] = ()) -> bytes:
    """Return fragility functions of a single intensity measure as an OpenQuake fragility model.

    An element `fragilityFunction` of the model contains the fragility functions of all limit
    states. The model has one element for each building type, or for each initial damage of the
    building, which is its damage before the ground motion. `name` is the taxonomy of the building,
    the id of functions without building type. The limit states are in the order of their
    thresholds, by default ds1, ds2, ...; functions by building type have the states of their types.

    Raises
    ------
    UsageError
        OpenQuake does not support the intensity measure, or the number of states is wrong.
    """
    state_of_threshold = {} if functions[0].type else _state_names(functions, states)
    if state_of_threshold:
        all_states = list(state_of_threshold.values())  # in ascending order of the thresholds
    else:
        all_states = list(dict.fromkeys(function.state for function in functions))
    lines = [f"    <limitStates>{' '.join(all_states)}</limitStates>"]
    for group in _grouped(functions):
        group_states = [
            function.state or state_of_threshold[function.threshold] for function in group
        ]
        first = group[0]
        # OpenQuake requires a function of each state for every building or type.
        if group_states != all_states:
            missing = ", ".join(state for state in all_states if state not in group_states)
            subject = first.type or f"damage {first.damage:g}"
            raise UsageError(
                f"{subject}: no function of {missing}; OpenQuake requires a function of every "
                "state for each type; add intensity levels, or omit the state with --threshold"
            )
        suffix = f"-damaged-{first.damage:g}" if first.damage > 0.0 else ""
        imt, factor = _measure(first)
        params: list[str] = []
        limits: list[float] = []
        for function, state in zip(group, group_states, strict=True):
            median, beta = function.theta * factor, function.beta_total
            limits += [median * math.exp(sign * _RANGE * beta) for sign in (-1.0, 1.0)]
            # The mean and the standard deviation of a lognormal variable follow from its median and
            # from the standard deviation beta of its logarithm.
            mean = median * math.exp(0.5 * beta**2)
            deviation = mean * math.sqrt(math.expm1(beta**2))
            params.append(
                f'      <params ls="{state}" mean="{mean:.9g}" stddev="{deviation:.9g}"/>'
            )
        function_id = quoteattr(first.type or f"{name}{suffix}")
        lines += [
            f'    <fragilityFunction id={function_id} format="continuous" shape="logncdf">',
            f'      <imls imt="{imt}" minIML="{min(limits):.6g}" maxIML="{max(limits):.6g}"/>',
            *params,
            "    </fragilityFunction>",
        ]
    return _nrml("fragilityModel", name, functions, lines)


def _nrml(model: str, name: str, functions: Sequence[Fragility], lines: Iterable[str]) -> bytes:
    """Return an OpenQuake model in NRML.

    `model` is the element of the model: `fragilityModel` or `vulnerabilityModel`.
    """
    document = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<nrml xmlns="http://openquake.org/xmlns/nrml/0.5">',
        f'  <{model} id="tdint" assetCategory="buildings" lossCategory="structural">',
        f"    <description>{escape(name)}, {functions[0].fit}, made by tdint</description>",
        *lines,
        f"  </{model}>",
        "</nrml>\n",
    ]
    return write_out_controls("\n".join(document), keep="\n").encode()


def whole_types(functions: Sequence[Fragility]) -> tuple[list[Fragility], list[str]]:
    """Select the building types that have a fragility function of every damage state.

    Returns
    -------
    list of Fragility
        Functions of the complete types.
    list of str
        Names of the other types, for which some states have no function.
    """
    groups = _grouped(functions)
    state_count = max(len(group) for group in groups)
    incomplete_types = [group[0].type for group in groups if len(group) < state_count]
    complete = [function for function in functions if function.type not in incomplete_types]
    return complete, incomplete_types


def _state_names(functions: Sequence[Fragility], states: Sequence[str]) -> dict[float, str]:
    """Return the names of the limit states (by default ds1, ds2, ...) by threshold, in ascending
    order of the thresholds. UsageError is raised if their number differs from the number of
    thresholds.
    """
    thresholds = sorted({function.threshold for function in functions})
    states = list(states) or [f"ds{number}" for number in range(1, len(thresholds) + 1)]
    if len(states) != len(thresholds) or any(not re.fullmatch(r"\w+", state) for state in states):
        listed = ", ".join(f"{threshold:g}" for threshold in thresholds)
        raise UsageError(
            f"the functions have {pluralize(len(thresholds), 'threshold')} ({listed}), but the "
            f"states are {', '.join(states) or 'not specified'}; specify as many "
            "states as thresholds, each a single word"
        )
    return dict(zip(thresholds, states, strict=True))


def _grouped(functions: Sequence[Fragility]) -> list[list[Fragility]]:
    """Return one list of fragility functions for each building type, or for each damage that the
    building had before the ground motion. Each list is in ascending order of the thresholds."""
    # The damage is nan for functions without initial damage. It is a text in the key, because nan
    # is not equal to nan.
    groups = grouped(((str(function.damage), function.type), function) for function in functions)
    return [sorted(group, key=lambda function: function.threshold) for group in groups.values()]


_INTENSITIES = 100
"""Number of intensities of a vulnerability function. OpenQuake interpolates linearly between them,
with errors of 0.3 % for a dispersion (beta) of 0.16."""


def vulnerability_model(
    functions: Sequence[Fragility], losses: Mapping[str, Sequence[float]], name: str
) -> bytes:
    """Return mean loss ratios by building type as an OpenQuake vulnerability model.

    The loss ratios follow from the fragility functions and the losses of the states. The loss of a
    single building at an intensity has a beta distribution with these means and coefficients of
    variation. Collapse counts as the heaviest state.

    Raises
    ------
    UsageError
        OpenQuake does not support the intensity measure.
    """
    lines: list[str] = []
    for group in _grouped(functions):
        imt, factor = _measure(group[0])
        limits = [
            function.theta * math.exp(sign * _RANGE * function.beta_total)
            for function in group
            for sign in (-1.0, 1.0)
        ]
        intensities = np.geomspace(min(limits), max(limits), _INTENSITIES)
        # Functions of a type may intersect. Limit the probability of reaching a state to the
        # probability of reaching the next lighter state.
        reaching_probabilities = np.minimum.accumulate(
            [function.probability(intensities, total=True) for function in group]
        )
        state_probabilities = reaching_probabilities - np.vstack(
            [reaching_probabilities[1:], np.zeros_like(intensities)]
        )
        # The functions are in ascending order of the states. The losses of heavier states without a
        # function are ignored.
        loss_ratios = np.array(losses[group[0].type][: len(group)])
        mean = np.maximum(loss_ratios @ state_probabilities, _LEAST_LOSS)
        mean_square = loss_ratios**2 @ state_probabilities
        # OpenQuake requires a beta distribution. Its squared coefficient of variation is below
        # 1 / mean - 1, the value for losses that are either 0 or 1.
        squared_cov = np.minimum(
            np.maximum(mean_square / mean**2 - 1.0, 0.0), (1.0 - 1e-6) * (1.0 / mean - 1.0)
        )
        coefficients_of_variation = np.sqrt(np.maximum(squared_cov, 0.0))
        lines += [
            f'    <vulnerabilityFunction id={quoteattr(group[0].type)} dist="BT">',
            f'      <imls imt="{imt}">{_numbers_text(factor * intensities)}</imls>',
            f"      <meanLRs>{_numbers_text(mean)}</meanLRs>",
            f"      <covLRs>{_numbers_text(coefficients_of_variation)}</covLRs>",
            "    </vulnerabilityFunction>",
        ]
    return _nrml("vulnerabilityModel", name, functions, lines)


def _numbers_text(values: Array) -> str:
    """Return the numbers of an element as text, separated by spaces."""
    return " ".join(f"{value:.9g}" for value in values)


_LEAST_LOSS = 1e-9  # OpenQuake rejects a coefficient of variation for a mean loss of 0


def _measure(first: Fragility) -> tuple[str, float]:
    """Return OpenQuake's name of the intensity measure of a function, and the factor that converts
    the intensity to OpenQuake's unit. UsageError is raised if OpenQuake does not support the
    measure. OpenQuake's names do not state the combination of the components of pairs.
    """
    im = re.sub(rf"^({'|'.join(PAIRS)})-", "", first.im.lower())
    for pattern, name, units, openquake_unit in _IMTS:
        match = re.fullmatch(pattern, im)
        if match and first.unit in units:
            numbers = {key: f"{float(text):.6g}" for key, text in match.groupdict().items()}
            return name.format(**numbers), units[first.unit] / openquake_unit
    measure = f"{first.im or 'unknown'} {first.unit}".rstrip()
    raise UsageError(
        "the intensity measure must be Sa or its average at a period, PGA, PGV, Arias intensity, "
        f"CAV or SDi, with its unit, for OpenQuake; got {measure}"
    )
