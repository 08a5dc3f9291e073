"""Exposure models of OpenQuake as inventories: equality with an inventory that was written by hand,
definitions of costs and areas, and refused input."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from facts import states
from tdint.errors import ModelError
from tdint.model.capacity import read_classes
from tdint.studies.regions.inventory import InventoryRow, derive_all, read_inventory

CONFIGS = Path(__file__).parents[3] / "configs"
MAPPING = """\
taxonomy,class,NumberOfStories
MUR/H:1,masonry,1
CR/H:3,concrete-frame,3
"""
HEAD = """\
<?xml version="1.0" encoding="UTF-8"?>
<nrml xmlns="http://openquake.org/xmlns/nrml/0.5">
<exposureModel id="e" category="buildings">
<description>two groups</description>
<conversions>
<costTypes>
<costType name="contents" type="aggregated" unit="USD"/>
<costType name="structural" type="per_asset" unit="USD"/>
</costTypes>
<area type="per_asset" unit="SQM"/>
</conversions>
<tagNames>district class</tagNames>
"""
ASSETS = """\
<asset id="a1" taxonomy="MUR/H:1" number="5" area="100">
<location lon="-122.27" lat="37.80"/>
<costs><cost type="contents" value="9"/><cost type="structural" value="1000"/></costs>
<tags district="north" class="residential"/>
</asset>
<asset id="a2" taxonomy="CR/H:3" number="2.5" area="300">
<location lon="-122.26" lat="37.81"/>
<costs><cost type="structural" value="900"/></costs>
<tags district="south"/>
</asset>
"""
TAIL = "</exposureModel>\n</nrml>\n"
TABLE = """\
id,lon,lat,taxonomy,number,structural,area,district,class,storeys
a1,-122.27,37.80,MUR/H:1,5,1000,100,north,residential,1
a2,-122.26,37.81,CR/H:3,2.5,900,300,south,,3
"""
BY_HAND = """\
id,class,NumberOfStories,number,cost,Longitude,Latitude,district
a1,masonry,1,5,1000,-122.27,37.80,north
a2,concrete-frame,3,2.5,900,-122.26,37.81,south
"""


def in_xml(text: str = ASSETS) -> str:
    return f"{HEAD}<assets>\n{text}</assets>\n{TAIL}"


def in_csv(*names: str, fields: str = "") -> str:
    return f"{HEAD}<assets>{' '.join(names)}</assets>\n{fields}{TAIL}"


@pytest.fixture(autouse=True)
def _inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mapping.csv").write_text(MAPPING)


def read(source: str) -> list[InventoryRow]:
    classes = read_classes(str(CONFIGS / "capacity-classes.csv"))
    rows, faults = read_inventory(source, 1.0, classes=classes, mapping="mapping.csv")
    assert not faults
    return list(rows)


def cells(row: InventoryRow) -> dict[str, str]:
    return dict(zip(row.columns, json.loads(row.cells), strict=True))


def assets_in_all_forms() -> dict[str, list[InventoryRow]]:
    """Return the same assets from XML and CSV files, from two CSV files, and with renamed
    columns."""
    head, first, second = TABLE.splitlines()
    texts = {
        "exposure.xml": in_xml(),
        "one.csv": TABLE,
        "first.csv": f"{head}\n{first}\n",
        "second.csv": f"{head}\n{second}\n",
        "named.csv": TABLE.replace("structural", "COST_USD").replace("number", "BUILDINGS"),
        "by-one.xml": in_csv("one.csv"),
        "by-two.xml": in_csv("\n  first.csv\n", "second.csv"),
        "by-names.xml": in_csv(
            "named.csv",
            fields='<exposureFields><field oq="number" input="BUILDINGS"/><field oq="value" '
            'type="structural" input="COST_USD"/></exposureFields>\n',
        ),
        "old.xml": in_xml().replace("nrml/0.5", "nrml/0.4"),
    }
    for name, text in texts.items():
        Path(name).write_text(text)
    return {name: read(name) for name in texts if name.endswith("xml")}


def test_exposure_model_equals_inventory() -> None:
    """Buildings, places, numbers and costs are the same in each form of the model. A tag with the
    name of a column that the rules read gets a prefix."""
    Path("inventory.csv").write_text(BY_HAND)
    classes = read_classes(str(CONFIGS / "capacity-classes.csv"))
    expected = list(read_inventory("inventory.csv", 1.0, classes=classes)[0])
    for name, rows in assets_in_all_forms().items():
        assert [row.id for row in rows] == ["a1", "a2"], name
        for row, other in zip(rows, expected, strict=True):
            assert (row.facts, row.latitude, row.longitude) == (
                other.facts,
                other.latitude,
                other.longitude,
            )
            found, written = cells(row), cells(other)
            assert {key: float(found[key]) for key in ("number", "cost")} == {
                key: float(written[key]) for key in ("number", "cost")
            }
            assert found["district"] == written["district"]
        assert [cells(row)["tag_class"] for row in rows] == ["residential", ""]
        assert [cells(row)["taxonomy"] for row in rows] == ["MUR/H:1", "CR/H:3"]


@pytest.mark.parametrize(
    ("cost", "area", "values"),
    [
        ("per_asset", "per_asset", (5 * 1000.0, 2.5 * 900.0)),
        ("aggregated", "per_asset", (1000.0, 900.0)),
        ("per_area", "per_asset", (5 * 100 * 1000.0, 2.5 * 300 * 900.0)),
        ("per_area", "aggregated", (100 * 1000.0, 300 * 900.0)),
    ],
)
def test_asset_values_by_type_of_cost_and_area(
    cost: str, area: str, values: tuple[float, float]
) -> None:
    """The value of an asset (number times cost of a building) follows the definitions of OpenQuake:
    for all its buildings, per building, or per area, which is the area of all buildings or of one
    building."""
    old = '<costType name="structural" type="per_asset"'
    text = in_xml().replace(old, old.replace("per_asset", cost))
    Path("e.xml").write_text(text.replace('<area type="per_asset"', f'<area type="{area}"'))
    found = [float(cells(row)["cost"]) * float(cells(row)["number"]) for row in read("e.xml")]
    assert found == pytest.approx(values, rel=1e-15)


@pytest.mark.parametrize(
    ("cost", "area", "value", "size", "expected"),
    [
        ("aggregated", "per_asset", 4e6, 1, 100000.0),
        ("per_area", "aggregated", 1200.0, 6000, 180000.0),
        ("per_area", "per_asset", 1200.0, 150, 180000.0),
    ],
)
def test_r3_cost_of_one_building(cost, area, value, size, expected):
    old = '<costType name="structural" type="per_asset"'
    text = in_xml().replace(old, old.replace("per_asset", cost))
    text = text.replace('<area type="per_asset"', f'<area type="{area}"')
    text = text.replace('number="5" area="100"', f'number="40" area="{size}"')
    text = text.replace('type="structural" value="1000"', f'type="structural" value="{value}"')
    Path("e.xml").write_text(text)
    found = cells(next(iter(read("e.xml"))))
    assert float(found["cost"]) == pytest.approx(expected)
    if cost == "per_area":
        assert float(found["cost"]) * float(found["number"]) == pytest.approx(7200000.0)


def test_mapping_by_structural_type_without_costs() -> None:
    """The mapping table has the columns that the rules need; without a structural cost there is no
    column of costs."""
    Path("mapping.csv").write_text(
        "Taxonomy,StructureType,NumberOfStories,YearBuilt,PlanArea\nMUR/H:1,URM,1,1930,120\n"
        "CR/H:3,C1,3,1975,400\n"
    )
    text = in_xml().replace('<costType name="structural" type="per_asset" unit="USD"/>', "")
    Path("e.xml").write_text(text)
    rows, faults = read_inventory("e.xml", 1.0, mapping="mapping.csv")
    assert not faults and "cost" not in cells(rows[0])
    assert [len(derived.building.stories) for derived in derive_all(rows, "mdof-lu")] == [1, 3]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (in_xml().replace("CR/H:3", "CR/H:9"), "1 taxonomy of e.xml not found; ... 'CR/H:9'"),
        (in_xml().replace('number="5"', 'number="-5"'), "e.xml:14:1: number: must be zero or a"),
        (in_xml().replace('number="5"', ""), "e.xml:14:1: number: is missing"),
        (in_xml().replace('value="900"', 'value="x"'), "e.xml:19:1: structural: must be zero or"),
        (in_xml().replace('lat="37.81"', ""), "e.xml:19:1: lat: is missing"),
        (in_xml().replace('lat="37.81"', 'lat="97"'), "e.xml:19:8: Latitude: must be a number"),
        (in_xml().replace('id="a2"', 'id="a1"'), "'a1' is already on line 14"),
        (in_xml().replace("per_asset", "per_building", 1), "e.xml:8: type must be one of aggreg"),
        (in_xml("").replace("\n</assets>", "</assets>"), "either assets or names of CSV files"),
        (in_xml().replace("exposureModel", "fragilityModel"), "must contain an exposureModel, got"),
        (in_xml().replace("</nrml>", ""), "invalid XML"),
        ('<!DOCTYPE x [<!ENTITY y "z">]>' + in_xml().partition("\n")[2], "document type"),
        (in_csv("none.csv"), "none.csv: file not found"),
        (TABLE, "e.xml:1: column structural ... cost ... all buildings"),
        (TABLE.replace(",number,structural", ",storeys,x"), "e.xml:1: no column number"),
    ],
)
def test_invalid_exposure_models_are_refused(text: str, message: str) -> None:
    Path("e.xml").write_text(text)
    classes = read_classes(str(CONFIGS / "capacity-classes.csv"))
    with pytest.raises(ModelError) as caught:
        _, faults = read_inventory("e.xml", 1.0, classes=classes, mapping="mapping.csv")
        raise ModelError(faults)
    assert states(str(caught.value), message)


def test_aggregated_cost_of_zero_buildings_is_refused() -> None:
    text = in_xml().replace('structural" type="per_asset', 'structural" type="aggregated')
    Path("e.xml").write_text(text.replace('number="5"', 'number="0"'))
    with pytest.raises(ModelError, match="number: must be positive"):
        read("e.xml")


@pytest.mark.parametrize(
    ("mapping", "message"),
    [
        (MAPPING.replace("masonry", "brick"), "mapping.csv:2:2: class: unknown 'brick'"),
        (MAPPING.replace(",3", ",0"), "mapping.csv:3:3: NumberOfStories: must be a whole number"),
        (MAPPING + "MUR/H:1,masonry,2\n", "mapping.csv:4: taxonomy 'MUR/H:1' is already on line 2"),
        (MAPPING.replace("class", "kind"), "mapping.csv:1: no column class"),
        (MAPPING.replace("taxonomy", "type"), "mapping.csv:1: no column taxonomy"),
        (
            MAPPING.replace("Stories\n", "Stories,number\n"),
            "mapping.csv:1: column number ... remove it",
        ),
    ],
)
def test_invalid_mapping_tables_are_refused(mapping: str, message: str) -> None:
    Path("e.xml").write_text(in_xml())
    Path("mapping.csv").write_text(mapping)
    with pytest.raises(ModelError) as caught:
        read("e.xml")
    assert states(str(caught.value), message)
