"""Exports of a campaign: Parquet and demands for SimCenter workflows.

Parquet requires pyarrow. Fragility and vulnerability functions are exported for OpenQuake.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby, islice
from typing import TYPE_CHECKING, Any, BinaryIO
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from tdint.analysis.run.demands import RUN
from tdint.analysis.run.outcome import STORY as STORY_QUANTITIES
from tdint.campaign.fragility.fits import Fragility
from tdint.campaign.store_schema import STORIES
from tdint.errors import UsageError
from tdint.number_parsing import pluralize
from tdint.output.tables.campaign import (
    SAMPLE,
    numeric,
    run_columns,
    run_heads,
    run_rows,
    story_columns,
    story_rows,
    write_rows,
)
from tdint.output.tables.damage_states import (
    damage_rows,
    damage_table_columns,
)
from tdint.output.tables.table import PARQUET, TEXT, Column, describe
from tdint.tabular import import_optional
from tdint.units import ACCELERATION, LENGTH, VELOCITY

if TYPE_CHECKING:
    from tdint.campaign.store import Store

_ROWS_AT_ONCE = 131_072  # rows per row group of a Parquet file

_COUNTED = {
    SAMPLE.name,
    "story",
    *(quantity.column for quantity in (*RUN, *STORY_QUANTITIES) if quantity.kind is int),
}


def write_runs_parquet(store: Store, stream: BinaryIO) -> None:
    """Write runs.parquet to a stream."""
    _write_parquet(
        store, stream, run_columns(store), run_rows(store), carried=len(store.inventory_columns())
    )


def write_stories_parquet(store: Store, stream: BinaryIO) -> None:
    """Write stories.parquet to a stream."""
    _write_parquet(store, stream, story_columns(store), story_rows(store))


def write_damage_parquet(store: Store, stream: BinaryIO) -> None:
    """Write damage.parquet to a stream."""
    columns = damage_table_columns(store)
    _write_parquet(
        store, stream, columns, damage_rows(store), carried=len(store.inventory_columns())
    )


def _write_parquet(
    store: Store,
    stream: BinaryIO,
    columns: Sequence[Column],
    rows: Iterable[Sequence[Any]],
    *,
    carried: int = 0,
) -> None:
    """Write rows as Parquet.

    Text columns have the type string, except columns of the inventory that contain only numbers.

    Parameters
    ----------
    store : Store
        Store of the campaign.
    stream : BinaryIO
        Output.
    columns : sequence of Column
        Columns of the rows.
    rows : iterable of sequence
        Rows.
    carried : int
        Number of inventory columns, which are the last columns; 0 by default.
    """
    pyarrow, parquet = (import_optional(name, *PARQUET) for name in ("pyarrow", "pyarrow.parquet"))
    # Inventory columns that contain only numbers are numeric.
    first = len(columns) - carried
    places = (
        [first + place for place, is_number in enumerate(numeric(store)) if is_number]
        if carried
        else []
    )
    texts = {
        column.name
        for place, column in enumerate(columns)
        if column.unit == TEXT and place not in places
    }
    kinds = {
        column.name: pyarrow.int64() if column.name in _COUNTED else pyarrow.float64()
        for column in columns
    }
    # Columns have unit and meaning as metadata; the file has the name of the campaign.
    about = describe(columns)
    schema = pyarrow.schema(
        [
            pyarrow.field(name, kind, metadata=about[name])
            for name, kind in (kinds | dict.fromkeys(texts, pyarrow.string())).items()
        ],
        {
            "tdint": json.dumps(
                {"campaign": store.meta("name"), "fingerprint": store.meta("fingerprint")}
            )
        },
    )
    with parquet.ParquetWriter(stream, schema) as writer:
        source = iter(rows)
        while batch := list(islice(source, _ROWS_AT_ONCE)):
            cells = list(zip(*batch, strict=True))
            # Cells of the inventory are text, also in numeric columns.
            for place in places:
                cells[place] = tuple(float(text) if text else None for text in cells[place])
            arrays = [
                pyarrow.array(column, field.type)
                for column, field in zip(cells, schema, strict=True)
            ]
            writer.write_table(pyarrow.Table.from_arrays(arrays, schema=schema))


def write_simcenter(store: Store, stream: BinaryIO) -> None:
    """Write the demands of all runs under the names of SimCenter.

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
    (stories,) = store.connection.execute("SELECT max(story) FROM story_rows").fetchone()
    if stories is None:
        raise UsageError(
            "the SimCenter export requires story results; set outputs: {stories: true} in the "
            "campaign file"
        )
    (directions,) = store.connection.execute("SELECT max(direction) FROM records").fetchone()
    names = [
        name for direction in range(1, directions + 1) for name in demand_names(stories, direction)
    ]
    # Ground motions in separate rows can have the same name.
    sources = [source for source, _, direction in store.records().values() if direction == 1]
    apart = len(set(sources)) < len(sources)
    rows = (
        [*head[: 2 + apart], *head[3:], *cells] for head, cells in _rows(store, stories, directions)
    )
    header = ("building", "record", *("component",) * apart, "scale", "sample", *names)
    write_rows([Column(name, "1", name, name) for name in header], rows, stream)


def demand_names(stories: int, direction: int) -> list[str]:
    """Return SimCenter's names of the demands of a building in one direction."""
    floors = range(1, stories + 1)
    return [
        *(f"1-PFA-{floor}-{direction}" for floor in (0, *floors)),
        *(f"1-PID-{story}-{direction}" for story in floors),
        f"1-PRD-1-{direction}",
        *(f"1-PFD-{floor}-{direction}" for floor in floors),
    ]


def _rows(store: Store, stories: int, directions: int) -> Iterator[tuple[list[Any], list[Any]]]:
    """Yield identifiers and demands of each building, ground motion, scale factor and sample."""
    named, records = run_heads(store), store.records()
    peaks = dict(store.connection.execute("SELECT id, pga_m_s2 FROM records"))
    size = len(demand_names(stories, 1))
    # A row belongs to the first component: the ground motion, or the component before it.
    firsts = {number: number - (direction - 1) for number, (_, _, direction) in records.items()}
    for building, of_building in groupby(store.stories(), key=lambda row: row[0]):
        rows: dict[tuple[int, float, int], list[Any]] = {}
        for (record, scale, sample), of_run in groupby(of_building, key=lambda row: row[1:4]):
            direction = records[record][2]
            # Both components of a pair are in the same row.
            cells = rows.setdefault((firsts[record], scale, sample), [None] * (size * directions))
            start = size * (direction - 1)
            cells[start : start + size] = _demands_of_run(
                list(of_run), abs(scale) * peaks[record], stories
            )
        for (record, scale, sample), cells in rows.items():
            yield [*named(building, record), scale, sample], cells


def _demands_of_run(rows: list[tuple[Any, ...]], pga: float, stories: int) -> list[Any]:
    """Return the cells of one run; cells of stories above the building are empty."""
    columns = dict(zip(STORIES.columns, zip(*rows, strict=True), strict=False))
    rest = [None] * (stories - len(rows))
    heights, displacements = columns["height_m"], columns["peak_displacement_m"]
    # The building has a height only if all its stories have heights.
    roof_ratio = displacements[-1] / sum(heights) if all(heights) else None
    return [
        *(pga, *columns["peak_absolute_acceleration_m_s2"], *rest),
        *(*columns["peak_drift_ratio"], *rest),
        roof_ratio,
        *(*displacements, *rest),
    ]


# ---- Fragility functions for OpenQuake: NRML 0.5, lognormal functions defined by mean and standard
# deviation of the intensity (not of its logarithm)

_FAR = 4.0  # range of the intensities in standard deviations from the medians
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
    """Return fragility functions of one intensity measure as an OpenQuake fragility model.

    There is one function for each state of the building before the ground motion, or for each
    building type.

    Parameters
    ----------
    functions : sequence of Fragility
        Fragility functions.
    name : str
        Taxonomy of the building, which is the id of functions without building type.
    states : sequence of str
        Limit states by increasing threshold; ds1, ds2, ... by default. Functions by building type
        have the states of their types.

    Raises
    ------
    UsageError
        OpenQuake does not support the intensity measure, or the number of states is wrong.
    """
    named = {} if functions[0].type else _named(functions, states)
    every = list(
        dict.fromkeys(named[state] for state in sorted(named))
        or dict.fromkeys(function.state for function in functions)
    )
    lines = [f"    <limitStates>{' '.join(every)}</limitStates>"]
    for of_one in _grouped(functions):
        listed = [function.state or named[function.threshold] for function in of_one]
        first = of_one[0]
        # OpenQuake requires a function of each state for every building or type.
        if listed != every:
            missing = ", ".join(state for state in every if state not in listed)
            subject = first.type or f"damage {first.damage:g}"
            raise UsageError(
                f"{subject}: no function of {missing}; OpenQuake requires a function of every "
                "state for each type; add intensity levels, or omit the state with --threshold"
            )
        suffix = f"-damaged-{first.damage:g}" if first.damage > 0.0 else ""
        imt, factor = _measure(first)
        params: list[str] = []
        far: list[float] = []
        # Mean and standard deviation are those of the intensity, not of its logarithm.
        for function, state in zip(of_one, listed, strict=True):
            median, beta = function.theta * factor, function.beta_total
            far += [median * math.exp(sign * _FAR * beta) for sign in (-1.0, 1.0)]
            mean = median * math.exp(0.5 * beta**2)
            deviation = mean * math.sqrt(math.expm1(beta**2))
            params.append(
                f'      <params ls="{state}" mean="{mean:.9g}" stddev="{deviation:.9g}"/>'
            )
        called = quoteattr(first.type or f"{name}{suffix}")
        lines += [
            f'    <fragilityFunction id={called} format="continuous" shape="logncdf">',
            f'      <imls imt="{imt}" minIML="{min(far):.6g}" maxIML="{max(far):.6g}"/>',
            *params,
            "    </fragilityFunction>",
        ]
    return _nrml("fragilityModel", name, functions, lines)


def _nrml(model: str, name: str, functions: Sequence[Fragility], lines: Iterable[str]) -> bytes:
    """Return an OpenQuake model that contains the lines of functions."""
    document = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<nrml xmlns="http://openquake.org/xmlns/nrml/0.5">',
        f'  <{model} id="tdint" assetCategory="buildings" lossCategory="structural">',
        f"    <description>{escape(name)}, {functions[0].fit}, made by tdint</description>",
        *lines,
        f"  </{model}>",
        "</nrml>\n",
    ]
    return "\n".join(document).encode()


def whole_types(functions: Sequence[Fragility]) -> tuple[list[Fragility], list[str]]:
    """Return the functions of types that have every state, and the names of other types."""
    most = max(len(of_one) for of_one in _grouped(functions))
    partial = [of_one[0].type for of_one in _grouped(functions) if len(of_one) < most]
    return [function for function in functions if function.type not in partial], partial


def _named(functions: Sequence[Fragility], states: Sequence[str]) -> dict[float, str]:
    """Return the names of the limit states by threshold.

    Raises
    ------
    UsageError
        The number of names differs from the number of thresholds.
    """
    thresholds = sorted({function.threshold for function in functions})
    states = list(states) or [f"ds{number}" for number in range(1, len(thresholds) + 1)]
    if len(states) != len(thresholds) or any(not re.fullmatch(r"\w+", state) for state in states):
        listed = ", ".join(f"{threshold:g}" for threshold in thresholds)
        raise UsageError(
            f"the functions have {pluralize(len(thresholds), 'threshold')} ({listed}): specify "
            "the same number of states, each a single word"
        )
    return dict(zip(thresholds, states, strict=True))


def _grouped(functions: Sequence[Fragility]) -> list[list[Fragility]]:
    """Return the functions of each building or type by increasing threshold."""
    groups: dict[tuple[str, str], list[Fragility]] = {}
    for function in functions:
        groups.setdefault((str(function.damage), function.type), []).append(function)
    return [sorted(of_one, key=lambda function: function.threshold) for of_one in groups.values()]


# Number of intensities of a vulnerability function; linear interpolation errors are 0.3 % for
# beta = 0.16.
_INTENSITIES = 100


def vulnerability_model(
    functions: Sequence[Fragility], losses: Mapping[str, Sequence[float]], name: str
) -> bytes:
    """Return mean loss ratios by building type as an OpenQuake vulnerability model.

    The loss ratios follow from the fragility functions and the losses of the states. Coefficients
    of variation are those of one building, for beta distributions. Collapse counts as the heaviest
    state.

    Raises
    ------
    UsageError
        OpenQuake does not support the intensity measure.
    """
    lines: list[str] = []
    for of_one in _grouped(functions):
        imt, factor = _measure(of_one[0])
        ends = [
            of.theta * math.exp(sign * _FAR * of.beta_total)
            for of in of_one
            for sign in (-1.0, 1.0)
        ]
        im = np.geomspace(min(ends), max(ends), _INTENSITIES)
        # Functions of a type may intersect; a heavier state is never more likely than a lighter
        # state.
        reached = np.minimum.accumulate([of.probability(im, total=True) for of in of_one])
        shares = reached - np.vstack([reached[1:], np.zeros_like(im)])
        ratios = np.array(losses[of_one[0].type][: len(of_one)])
        mean, square = np.maximum(ratios @ shares, _LEAST_LOSS), ratios**2 @ shares
        # The variance is less than that of losses that are either 0 or 1 (limit of beta
        # distributions).
        variance = np.minimum(
            np.maximum(square / mean**2 - 1.0, 0.0), (1.0 - 1e-6) * (1.0 / mean - 1.0)
        )
        rows = {"imls": factor * im, "meanLRs": mean, "covLRs": np.sqrt(np.maximum(variance, 0.0))}
        texts = {key: " ".join(f"{value:.9g}" for value in values) for key, values in rows.items()}
        lines += [
            f'    <vulnerabilityFunction id={quoteattr(of_one[0].type)} dist="BT">',
            f'      <imls imt="{imt}">{texts["imls"]}</imls>',
            *(f"      <{key}>{texts[key]}</{key}>" for key in ("meanLRs", "covLRs")),
            "    </vulnerabilityFunction>",
        ]
    return _nrml("vulnerabilityModel", name, functions, lines)


_LEAST_LOSS = 1e-9  # OpenQuake rejects a coefficient of variation for a mean loss of 0


def _measure(first: Fragility) -> tuple[str, float]:
    """Return OpenQuake's name of the measure of a function, and the factor to its unit."""
    for pattern, called, units, unit in _IMTS:
        match = re.fullmatch(pattern, first.im.lower())
        if match and first.unit in units:
            imt = called.format(
                **{part: f"{float(text):.6g}" for part, text in match.groupdict().items()}
            )
            return imt, units[first.unit] / unit
    measure = f"{first.im or 'unknown'} {first.unit}".rstrip()
    raise UsageError(
        "the intensity measure must be Sa or its average at a period, PGA, PGV, Arias intensity, "
        f"CAV or SDi, with its unit, for OpenQuake; got {measure}"
    )
