"""CSV tables: columns, digits, empty cells, names with commas; the fast function for histories
writes the same text."""

import csv
import io
import math
from dataclasses import replace
from importlib import import_module
from pkgutil import iter_modules
from types import SimpleNamespace

import numpy as np
import pytest

from story_values import story_values
from tdint.ground_motion.record import Record, component_names
from tdint.methods.catalogue import catalogue, parse
from tdint.model.config.model_file import load_model
from tdint.output import tables
from tdint.output.tables import buildings, histories, methods, responses, spectra
from tdint.output.tables.columns import ColumnFile
from tdint.output.tables.table import (
    TEXT,
    Column,
    Table,
    cell_text,
    csv_bytes,
    numbered,
    placeholder,
)
from tdint.response.runs.energy import ENERGY_TERMS
from tdint.response.runs.history import EnergyHistory, History
from tdint.response.runs.outcome import StoryPeaks
from tdint.response.spectra.elastic import Spectrum
from tdint.units import parse_output_units, suffix
from tdint.units import quantities as declared_by


def read(data: bytes) -> list[list[str]]:
    assert b"\r" not in data
    assert data.endswith(b"\n")
    return list(csv.reader(io.StringIO(data.decode("utf-8"))))


def record(component="HNE", source="a.mseed", id_=None) -> Record:
    return Record(np.array([0.0, 1.0]), 0.01, "", id_ or f"N.S..{component}", component, source)


def history(steps: int, stories: int, seed: int = 1) -> History:
    random = np.random.default_rng(seed)
    tables = [
        random.normal(size=(steps, stories)) * 10.0**power for power in (-2, -1, 0, -3, 6, 5, 7)
    ]
    terms = dict(zip((*ENERGY_TERMS, "error"), random.normal(size=(8, steps)), strict=True))
    energy = EnergyHistory(**terms)
    return History(np.arange(steps) * 0.01, random.normal(size=steps), *tables, energy=energy)


def test_cells():
    assert [
        cell_text(value)
        for value in (None, math.nan, np.float64("nan"), math.inf, True, False, np.True_)
    ] == ["", "", "", "inf", "true", "false", "true"]
    assert [
        cell_text(value) for value in (3, np.int64(7), "a b", -0.0, 1.0, 0.1, np.float64(1e-7))
    ] == ["3", "7", "a b", "0", "1", "0.1", "1e-07"]


def test_rows_of_any_cells_are_written_as_their_texts():
    """The csv module reads each cell as its text, also next to nan, negative zero, empty cells and
    texts that contain "nan" or end with -0."""
    cells = [
        *(0.0, -0.0, math.nan, math.inf, 1e-05, 5e-324, 123456789012345.6, -1.5, None, True, 1, -7),
        *(10**20, "", "a", "nan", "x-0", "a,b", 'q"t', "=cmd", "a;=b", "-", "%s", "Fernandez"),
        *(np.float64(-0.0), np.float64(math.nan), np.int64(3), np.bool_(True)),
    ]
    rows = [(first, second) for first in cells for second in cells]
    expected = [[cell_text(cell) for cell in row] for row in rows]
    assert list(csv.reader(io.StringIO(csv_bytes(rows).decode()))) == expected
    assert csv_bytes([[""], ["a;=b"], [-0.0]]) == b'""\n"a;=b"\n0\n'


def test_values_of_columns_are_parts_of_the_result_that_a_placeholder_states(tmp_path):
    """The default is the attribute with the name of the column without its unit, of the result or
    of a part of it; a part that the result does not have is an empty cell."""
    module = tmp_path / "tables.py"
    module.with_suffix(".csv").write_text(
        "table,name,unit,meaning\n"
        "one,drift_m,m,drift\none,m,text,material\none,second_N,N,second force\none,story,1,story\n"
    )
    path = SimpleNamespace(drift=np.array([1.0, 2.0]), m="steel", forces=np.array([[3.0, 4.0]]))
    test = placeholder()
    columns = ColumnFile(str(module))(
        "one", test.path, second_N=test.path.forces[0, :], story=numbered(test.path.drift)
    )
    assert [column.unit for column in columns] == ["m", "text", "N", "1"]
    rows = Table.of_results(columns, [SimpleNamespace(path=path)]).rows
    assert rows == [(1.0, "steel", 3.0, 1), (2.0, "steel", 4.0, 2)]
    assert test.path.deeper.drift(SimpleNamespace(path=None)) is None
    with pytest.raises(AttributeError, match="no attribute 'stroke'"):
        test.path.stroke(SimpleNamespace(path=path))
    plain = ColumnFile(str(module))("one", second_N="drift", story=numbered("drift", 0))
    assert Table.of_results(plain, [path]).rows == [(1.0, "steel", 1.0, 0), (2.0, "steel", 2.0, 1)]


def test_story_table():
    nan = math.nan
    peaks = story_values(
        StoryPeaks,
        height=np.array([nan, 3.5]),
        peak_drift=np.array([0.1, 1 / 3]),
        peak_drift_ratio=np.array([nan, 2 / 21]),
        residual_drift=np.array([-0.0, -0.001]),
        peak_shear=np.array([1e7, 5e6]),
        peak_damper_force=np.array([0.0, 2.0]),
        peak_total_shear=np.array([2e7, 6e6]),
        ductility=np.array([nan, 4.0]),
        peak_displacement=np.array([0.1, 0.2]),
        peak_velocity=np.array([1.0, 2.0]),
        peak_absolute_acceleration=np.array([9.80665, 1e-20]),
    )
    table = responses.story_table(peaks).csv().decode()
    # Further quantities may follow.
    first_columns = [",".join(line.split(",")[:12]) + "\n" for line in table.splitlines()]
    assert "".join(first_columns) == (
        "story,height_m,peak_drift_m,peak_drift_ratio,residual_drift_m,peak_shear_N,peak_damper_force_N,"
        "peak_total_shear_N,ductility,peak_displacement_m,"
        "peak_velocity_m_s,peak_absolute_acceleration_m_s2\n"
        "1,,0.1,,0,10000000,0,20000000,,0.1,1,9.80665\n"
        "2,3.5,0.333333333333,0.0952380952381,-0.001,5000000,2,6000000,4,0.2,2,1e-20\n"
    )


def spectrum(rec: Record, damping: float) -> Spectrum:
    periods = np.array([0.1, 1.0])
    values = {name: i * periods for i, name in enumerate(("sd", "psv", "psa", "sv", "sa"), start=1)}
    return Spectrum(record=rec, damping=damping, method="exact", periods=periods, **values)


def test_components_with_equal_names_are_identified_by_their_id():
    first, second = record(id_="N.A..HNE"), record(id_="N.B..HNE")
    elsewhere = record(source="b.mseed")
    assert component_names([first, first, elsewhere]) == ["HNE", "HNE", "HNE"]
    assert component_names([first, second, elsewhere, first]) == [
        "N.A..HNE", "N.B..HNE", "HNE", "N.A..HNE",
    ]  # fmt: skip


def test_method_table_lists_the_catalogue():
    rows = read(Table.of_results(methods.METHOD, map(parse, catalogue())).csv())
    by_name = {row[0]: dict(zip(rows[0], row, strict=True)) for row in rows[1:]}
    central = by_name["central-difference"]
    assert (central["implicit"], central["stability_limit"], central["rho_inf"]) == (
        "false",
        "2",
        "",
    )
    newmark = by_name["newmark"]
    assert newmark["parameters"] == "beta=0.25 in [0 to 1]; gamma=0.5 in [0.5 to 1]"
    assert (newmark["order"], newmark["implicit"], newmark["stability_limit"]) == (
        "2",
        "true",
        "none",
    )
    assert by_name["collocation"]["parameters"].endswith("in [1 to 10] computed")
    assert all(row["source"] for row in by_name.values())


def test_mode_table():
    modes = SimpleNamespace(
        omega=np.array([2 * math.pi, 4 * math.pi]),
        period=np.array([1.0, 0.5]),
        frequency=np.array([1.0, 2.0]),
        participation=np.array([1.2, -0.2]),
        mass_ratio=np.array([0.75, 0.25]),
    )
    assert buildings.mode_table(modes, np.array([0.05, 0.02])).csv().decode() == (
        "mode,period_s,frequency_hz,damping,participation,mass_ratio,cumulative_mass_ratio\n"
        "1,1,1,0.05,1.2,0.75,0.75\n2,0.5,2,0.02,-0.2,0.25,1\n"
    )
    assert (
        buildings.mode_table(modes, None).csv().decode().splitlines()[1] == "1,1,1,,1.2,0.75,0.75"
    )


@pytest.mark.parametrize("stories", [1, 3])
@pytest.mark.parametrize("rows_at_once", [2, 4096])
def test_history(monkeypatch, stories, rows_at_once):
    monkeypatch.setattr(histories, "_ROWS_AT_ONCE", rows_at_once)
    response_history = history(5, stories)
    response_history = replace(
        response_history,
        displacement=np.where(np.arange(5)[:, None] == 0, -0.0, response_history.displacement),
    )
    stream = io.BytesIO()
    histories.write_history([response_history], stream)
    rows = read(stream.getvalue())
    floors = (("displacement", "displacement_m"), ("velocity", "velocity_m_s"))
    floors += (("absolute_acceleration", "absolute_acceleration_m_s2"),)
    springs = (("drift", "drift_m"), ("shear", "shear_N"), ("damper_force", "damper_force_N"))
    springs += (("total_shear", "total_shear_N"),)
    header, columns = (
        ["time_s", "ground_acceleration_m_s2"],
        [response_history.time, response_history.ground_acceleration],
    )
    for location, quantities in (("floor", floors), ("story", springs)):
        for i in range(stories):
            header += [f"{location}_{i + 1}_{name}" for _, name in quantities]
            columns += [getattr(response_history, attribute)[:, i] for attribute, _ in quantities]
    energies = (
        "input_J", "kinetic_J", "viscous_J", "dampers_J", "strain_J", "hysteretic_J",
        "braces_J", "error",
    )  # fmt: skip
    header += [f"energy_{name}" for name in energies]
    columns += [getattr(response_history.energy, name) for name in (*ENERGY_TERMS, "error")]
    assert rows == [
        header,
        *([cell_text(value) for value in row] for row in zip(*columns, strict=True)),
    ]


UNITS = (
    "m",
    "s",
    "m/s",
    "m/s^2",
    "N",
    "N*m",
    "N*s",
    "N/m",
    "m/N",
    "J",
    "kg",
    "Hz",
    "degree",
    "rad",
)


def declared_columns():
    """Return each declared tuple of columns by its module and name."""
    subjects = [module.name for module in iter_modules(tables.__path__)]
    return {
        (subject, name): value
        for subject in subjects
        for name, value in vars(import_module(f"{tables.__name__}.{subject}")).items()
        if isinstance(value, tuple) and value and name.isupper() and isinstance(value[0], Column)
    }


def test_every_column_has_a_meaning_and_a_unit():
    for name, group in declared_columns().items():
        names = [column.name for column in group if isinstance(column, Column)]
        # `devices` lists the columns of two tables, of attachments and of links.
        assert name[0] == "devices" or len(set(names)) == len(names), name
        assert names, name
    columns = {
        column
        for group in declared_columns().values()
        for column in group
        if isinstance(column, Column)
    }
    # Tables of reports also contain percentages.
    assert {column.unit for column in columns} == {"1", TEXT, "%", *UNITS}
    for column in columns:
        own = [unit for unit in UNITS if column.name.removesuffix("_error").endswith(suffix(unit))]
        assert column.unit in (
            max(own, key=lambda unit: len(suffix(unit))) if own else "1",
            TEXT,
            "%",
        ), column
    table = spectra.result_table([spectrum(record(), 0.05)], additional=["maxima"])
    assert list(table.meanings) == list(table.columns)
    assert table.meanings["sa_m_s2"] == {
        "meaning": "largest absolute acceleration",
        "unit": "m/s^2",
    }
    assert "unit" not in table.meanings["maxima"]
    assert all(meaning["meaning"] for meaning in table.meanings.values())


def test_header_texts_cannot_control_a_terminal_or_be_formulas():
    for text, cell in (
        ("HNE", "HNE"),
        ("-", "-"),
        ("-1.5", "-1.5"),
        ("+3", "+3"),
        ("=1+1", "'=1+1"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("-cmd|' /C calc'!A0", "'-cmd|' /C calc'!A0"),
        ("a\x1b[2Jb", "a\\x1b[2Jb"),
        ("a\x9bb", "a\\x9bb"),
        ("-2+3+cmd|' /C calc'!D2", "'-2+3+cmd|' /C calc'!D2"),
        ("-=1", "'-=1"),
        ("-@SUM(1)", "'-@SUM(1)"),
        ("+1e-3", "+1e-3"),
        ("-.5", "-.5"),
        ("-1e", "'-1e"),
        ("--1", "'--1"),
        ("-1_0", "'-1_0"),
        ("-\u0661", "'-\u0661"),
        ("a,b", "a,b"),
        ('say "x"', 'say "x"'),
        ("two\nlines", "two\\nlines"),
        ("\t=1", "'\\t=1"),
        ("\r1", "'\\r1"),
        ("'=1", "'=1"),
        ("a=1", "a=1"),
        ("", ""),
        ("=", "'="),
        ("b\udcfcro", "b\\xfcro"),
        ("b\udcc3\udcbcro", "b\xfcro"),
        ("a\ud800", "a\\ud800"),
    ):
        assert cell_text(text) == cell
        table = Table((text, "b"), [(text, 1.0)])
        assert (
            table.csv().decode()
            == "\n".join(f"{quoted(cell)},{other}" for other in ("b", "1")) + "\n"
        )


def quoted(text):
    """Return a text quoted by the csv module."""
    stream = io.StringIO()
    csv.writer(stream, lineterminator="").writerow([text, ""])
    return stream.getvalue()[:-1]


@pytest.mark.parametrize(
    ("law", "units", "text"),
    [
        ({"type": "bilinear", "yield_force": 10, "hardening": "5%"}, "N,m",
         "yield_force 10 N, hardening 0.05"),
        ({"type": "polynomial", "coefficients": [400, 0, 3e6]}, "N,mm",
         "coefficients 0.4 N/mm, 0 N/mm^2, 0.003 N/mm^3"),
        # A choice is a word; the default word is omitted.
        ({"type": "gap", "gap": 0.35, "stop_stiffness": 4e5}, "kN,m",
         "gap 0.35 m, stop_stiffness 400 kN/m"),
        ({"type": "gap", "gap": 0.35, "stop_stiffness": 4e5, "sides": "positive"}, "kN,m",
         "gap 0.35 m, stop_stiffness 400 kN/m, sides positive"),
        (
            {
                "type": "multilinear-pinching",
                "backbone": [[0.01, 2e3], [0.03, 3e3], [0.05, 3e3], [0.06, 0.5e3]],
                "negative": {"pinching": {"drift": 0.25, "force": 0.5, "unloading": 0}},
                "pinching": {"drift": 0.5, "force": 0.5, "unloading": 0},
                "degradation": {"strength": {"work": 0.2, "limit": 0}, "capacity": 20},
            },
            "kN,mm",
            "backbone 2 kN at 10 mm, 3 kN at 30 mm, 3 kN at 50 mm, 0.5 kN at 60 mm, pinching.drift "
            "0.5, pinching.force 0.5, pinching.unloading 0, negative.pinching.drift 0.25, "
            "degradation.strength.work 0.2, degradation.capacity 20",
        ),
    ],
)  # fmt: skip
def test_a_law_is_printed_as_in_its_model_file(law, units, text):
    """Sides, groups and parameters with default values are omitted, as in the model file."""
    own = {} if {"coefficients", "backbone"} & law.keys() else {"stiffness": 1000}
    (story,) = load_model({"stories": [{"mass": 1, "law": law, **own}]}).stories
    assert buildings.law_words(story, parse_output_units(units)) == f"{law['type']}: {text}"


def test_dashpots_of_a_model_are_printed_with_their_law():
    power = {"coefficient": 8e3, "exponent": 0.5, "linear_below": 0.01}
    stories = [
        {"mass": 1.0, "stiffness": 1e6} | options
        for options in ({"dashpot": 5e3}, {"dashpot": power}, {})
    ]
    model = load_model({"stories": stories})
    assert [row[-1] for row in buildings.model_table(model).rows] == [
        "5000 v (N; v in m/s)",
        "8000 v^0.5 (N; v in m/s; linear below 0.01 m/s)",
        "",
    ]
    text = f"{8.0 * 1e-3**0.5:.4g} v^0.5 (kN; v in mm/s; linear below 10 mm/s)"
    assert buildings.model_table(model, parse_output_units("kN,mm")).rows[1][-1] == text


def test_quantities_do_not_depend_on_the_evaluation_of_annotations(tmp_path, monkeypatch):
    """A plug-in can declare a result in a module with annotations as texts, also by an alias and
    beside names for type checkers."""
    source = """
from typing import TYPE_CHECKING, Annotated

from tdint.units import Quantity

if TYPE_CHECKING:
    from tdint import Record

Drift = Annotated[float, Quantity("m", "drift")]


class Result:
    record: "Record"
    drift: Drift
    stories: Annotated[int | None, Quantity("1", "stories")]

    @property
    def force(self) -> Annotated[float, Quantity("kN", "force")]:
        return 1.0
"""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "objects_result.py").write_text(source)
    (tmp_path / "texts_result.py").write_text("from __future__ import annotations\n" + source)
    found = declared_by(import_module("texts_result").Result)
    assert found == declared_by(import_module("objects_result").Result)
    assert [(item.name, item.value_type) for item in found] == [
        ("drift", float),
        ("stories", int),
        ("force", float),
    ]
