"""Read an exposure model of OpenQuake as an inventory of buildings.

An exposure model (NRML 0.4 or 0.5) lists assets: groups of buildings with a location, a taxonomy, a
number of buildings and a structural cost. The assets are in the XML file, or in CSV files
that it names. The taxonomy is a text that describes a building type; a mapping table contains the
columns of an inventory for each taxonomy.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from tdint.csv_table import CsvTable, number, number_error, read_table, stream_table
from tdint.errors import ModelError, ModelFault
from tdint.files import MOST_BYTES, is_file, read_whole, record_digest
from tdint.model.damage_states import COST, NUMBER
from tdint.number_parsing import pluralize

TAXONOMY = "taxonomy"
"""Column of the taxonomy in the mapping table, and in the inventory that is read."""

_STRUCTURAL = "structural"
"""Cost type in exposure models. The structural cost becomes the column `cost` of the inventory."""
_AGGREGATED, _PER_ASSET, _PER_AREA = "aggregated", "per_asset", "per_area"
_COST_TYPES = (_AGGREGATED, _PER_ASSET, _PER_AREA)
_AREA_TYPES = (_AGGREGATED, _PER_ASSET)
_FIELDS = ("id", "lon", "lat", TAXONOMY, NUMBER, _STRUCTURAL, "area")
_OTHER_NAMES: Mapping[str, tuple[str, ...]] = {
    "id": ("asset_id",),
    "lon": ("longitude",),
    "lat": ("latitude",),
    _STRUCTURAL: (f"value-{_STRUCTURAL}",),
}
"""Names of columns in CSV files if the XML file does not assign them (exposureFields)."""

_MAPPING_REQUIREMENTS = (
    f"a mapping table is a CSV file with the column {TAXONOMY} and, for each taxonomy, the columns "
    "of an inventory that the rules need (class and NumberOfStories for the rules capacity)"
)
_REQUIRED = (
    "an exposure model of OpenQuake is an XML file (NRML), or a CSV file with the columns "
    f"{', '.join(_FIELDS[:5])}"
)
_MAX_LISTED = 10
"""Maximum number of taxonomies that a message lists."""


@dataclass
class _ExposureModel:
    """Contents of the XML file of an exposure model.

    Attributes
    ----------
    cost_type, area_type : str
        Types of the structural costs (`_COST_TYPES`) and areas (`_AREA_TYPES`); empty if the file
        does not state them.
    fields : dict
        Column of a CSV file for each field of OpenQuake.
    assets : list of (int, dict)
        Line and values of each asset in the file.
    files : str
        Text of the element `assets`: names of CSV files, separated by white space.
    """

    cost_type: str = ""
    area_type: str = ""
    fields: dict[str, str] = field(default_factory=dict)
    tags: list[str] = field(default_factory=list)
    assets: list[tuple[int, dict[str, str]]] = field(default_factory=list)
    files: str = ""


def read_mapping(source: str) -> CsvTable:
    """Read a mapping table, which contains the columns of an inventory for each taxonomy.

    Raises
    ------
    ModelError
        The table cannot be read, or contains a taxonomy twice.
    """
    table = read_table(source, _MAPPING_REQUIREMENTS)
    table.distinct(TAXONOMY, "taxonomy")
    return table


def stream_exposure(
    source: str, mapping: CsvTable, reserved: Collection[str]
) -> tuple[CsvTable, Iterator[tuple[int, list[str]]]]:
    """Return an exposure model (an XML file, or a CSV file with the assets alone) as the table of
    an inventory without rows, and the line and cells of each asset.

    The columns are `id`, `taxonomy`, the other columns of the mapping table (`read_mapping`),
    `number`, `cost` (of one building, from the structural cost), `Longitude`, `Latitude` and the
    tags of the model. A tag with a reserved name, a column for the derivation of buildings, gets
    the prefix `tag_`.

    Raises
    ------
    ModelError
        A file cannot be read, an asset lacks a value or has one that is out of range, or taxonomies
        are missing in the mapping table. The errors of all assets are reported together.
    """
    large = f"larger than {MOST_BYTES // 1024**2} MiB; list CSV files in its element `assets`"
    # Standard input and pipes, which can be read only one time, contain the CSV file.
    data = read_whole(source, ModelError, {}, large, MOST_BYTES) if is_file(source) else b""
    # An XML file starts with <, after an optional byte-order mark (EF BB BF) and white space.
    if data.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
        record_digest(source, data)
        model = _parse(source, data)
        files = [str(Path(source).parent / name) for name in model.files.split()]
        if bool(files) == bool(model.assets):
            raise ModelError(
                f"{source}: the element `assets` must contain either assets or names of CSV files; "
                f"it contains {'both' if files else 'neither'}"
            )
    else:
        model, files = _ExposureModel(), [source]
    assets = _Assets(source, model, mapping, reserved)
    for name in files:
        assets.read_csv(name)
    for line, values in model.assets:
        assets.add(source, line, values)
    model.assets.clear()
    assets.check()
    table = CsvTable(
        source=files[0] if len(files) == 1 else source,
        header=tuple(title.lower() for title in assets.titles),
        titles=assets.titles,
        header_line=1,
        rows=(),
        needs=_REQUIRED,
        error=ModelError,
    )
    return table, iter(assets.rows)


class _Assets:
    """Assets of an exposure model, converted to rows of an inventory, and their errors.

    Parameters
    ----------
    source : str
        Name of the XML file, or of a CSV file with the assets only.
    mapping : CsvTable
        Mapping table with the columns of an inventory for each taxonomy.
    reserved : collection of str
        Columns of an inventory from which buildings are derived.

    Attributes
    ----------
    rows : list of (int, list of str)
        Line of each asset in its file, and the cells of its row.

    Raises
    ------
    ModelError
        The mapping table has a column that the exposure model also defines.
    """

    def __init__(
        self, source: str, model: _ExposureModel, mapping: CsvTable, reserved: Collection[str]
    ) -> None:
        """Determine the columns of the inventory from the mapping table and the model."""
        self._source, self._model, self._mapping = source, model, mapping
        # Store the cells of the mapping table for each taxonomy, from the columns with a title.
        taxonomy_column = mapping.header.index(TAXONOMY)
        columns = [
            index
            for index, title in enumerate(mapping.titles)
            if title and index != taxonomy_column
        ]
        mapped_titles = [mapping.titles[index] for index in columns]
        self._mapped_cells = {
            taxonomy: [cells[index].strip() if index < len(cells) else "" for index in columns]
            for taxonomy, (_, cells) in zip(mapping.texts(TAXONOMY), mapping.rows, strict=True)
        }
        self.has_cost = bool(model.cost_type)
        cost_titles = [COST] if self.has_cost else []
        own_titles = ["id", TAXONOMY, *mapped_titles, NUMBER, *cost_titles]
        own_titles += ["Longitude", "Latitude"]
        counts = Counter(map(str.lower, own_titles))
        if len(counts) < len(own_titles):
            duplicate = next(name for name, count in counts.items() if count > 1)
            raise ModelError(
                f"{mapping.source}:{mapping.header_line}: column {duplicate} comes from the "
                "exposure model; remove it from the mapping table"
            )
        self._tags = [tag for tag in dict.fromkeys(model.tags) if tag.lower() != TAXONOMY]
        reserved_names = {*counts, *map(str.lower, reserved)}
        tags = [f"tag_{tag}" if tag.lower() in reserved_names else tag for tag in self._tags]
        self.titles = (*own_titles, *tags)
        self.rows: list[tuple[int, list[str]]] = []
        self._faults: list[ModelFault] = []
        # For each taxonomy without a row in the mapping table, the number of its assets.
        self._unmapped: Counter[str] = Counter()

    def read_csv(self, file_name: str) -> None:
        """Read the assets of a CSV file and add their rows or errors. ModelError is raised if the
        file cannot be read, lacks a column, has a cost without a cost type, or has a row with too
        many cells.
        """
        table, rows = stream_table(file_name, _REQUIRED, columns=(), read_first=True)
        field_columns = {name: self._column_index(table, name) for name in _FIELDS}
        # The first five fields are required in any case, cost and area only for some cost types.
        missing = [name for name in _FIELDS[:5] if field_columns[name] is None]
        cost_type, cost_column = self._model.cost_type, field_columns[_STRUCTURAL]
        if cost_type:
            if cost_column is None:
                missing.append(_STRUCTURAL)
            if cost_type == _PER_AREA and field_columns["area"] is None:
                missing.append("area")
        elif cost_column is not None and file_name == self._source:
            # The CSV file was specified without an XML file, which would state the cost type.
            raise ModelError(
                f"{file_name}:{table.header_line}: column {table.titles[cost_column]} can "
                "be the cost of one building or of all buildings of an asset; specify the XML file "
                "of the exposure model instead of this CSV file, because its element costType "
                f"states the meaning (type={_AGGREGATED!r} or {_PER_ASSET!r})"
            )
        if missing:
            table.need(*missing)
        column_indices = {
            tag: table.header.index(tag.lower()) for tag in self._tags if table.has(tag)
        }
        for name, index in field_columns.items():
            if index is not None:
                column_indices[name] = index
        for line, cells in rows:
            if error := table.surplus(cells):
                raise ModelError(f"{file_name}:{line}: {error}")
            # A row may have fewer cells than the header; its last fields are then missing.
            values = {
                name: cells[index].strip()
                for name, index in column_indices.items()
                if index < len(cells)
            }
            self.add(file_name, line, values)

    def _column_index(self, table: CsvTable, field_name: str) -> int | None:
        """Return the index of the column of a field; None if the file does not contain it."""
        # The XML file may assign a column to the field.
        assigned = self._model.fields.get(field_name)
        if assigned is not None:
            table.need(assigned)
        names = [assigned] if assigned else [field_name, *_OTHER_NAMES.get(field_name, ())]
        for name in names:
            if table.has(name):
                return table.header.index(name.lower())
        return None

    def add(self, source: str, line: int, values: Mapping[str, str]) -> None:
        """Convert an asset to a row of the inventory, or report its errors."""
        earlier_fault_count = len(self._faults)

        def fault(name: str, message: str) -> None:
            """Record an error of a field."""
            self._faults.append(ModelFault(source, line, 1, name, message))

        def nonnegative(name: str) -> float:
            """Return the number in a field; report an error if it is negative or no number."""
            text = values.get(name, "")
            value = number(text)
            if not value >= 0.0:
                expected = "zero or a positive number"
                message = f"is missing; give {expected}"
                fault(name, number_error(text, expected) if text else message)
            return value

        name, taxonomy = values.get("id", ""), values.get(TAXONOMY, "")
        if not name:
            fault("id", "is missing")
        for coordinate in ("lon", "lat"):
            if not values.get(coordinate):
                fault(coordinate, "is missing; give degrees")
        building_count = nonnegative(NUMBER)
        cost_cells = []
        if self.has_cost:
            cost, cost_type = nonnegative(_STRUCTURAL), self._model.cost_type
            if cost_type == _PER_AREA:
                cost *= nonnegative("area")
                cost_type = self._model.area_type
            # An aggregated cost is the total of all buildings of the asset, with equal shares.
            if cost_type == _AGGREGATED and cost > 0.0:
                if building_count == 0.0:
                    fault(NUMBER, "must be positive because the structural cost is positive, got 0")
                else:
                    cost /= building_count
            cost_cells = [repr(cost)]
        # The method `check` reports all taxonomies without a row in the mapping table together.
        mapped_cells = self._mapped_cells.get(taxonomy)
        if mapped_cells is None:
            self._unmapped[taxonomy] += 1
            return
        # The row is added only if this asset has no error.
        if len(self._faults) == earlier_fault_count:
            location = [values["lon"], values["lat"]]
            tag_cells = [values.get(tag, "") for tag in self._tags]
            cells = [
                name,
                taxonomy,
                *mapped_cells,
                values[NUMBER],
                *cost_cells,
                *location,
                *tag_cells,
            ]
            self.rows.append((line, cells))

    def check(self) -> None:
        """Raise ModelError if an asset has an error, or the mapping table lacks a taxonomy."""
        if self._faults:
            raise ModelError(self._faults)
        if self._unmapped:
            listed = ", ".join(
                f"{name[:60]!r} ({pluralize(count, 'asset')})"
                for name, count in self._unmapped.most_common(_MAX_LISTED)
            )
            if len(self._unmapped) > _MAX_LISTED:
                listed += ", ..."
            raise ModelError(
                f"{self._mapping.source}: {pluralize(len(self._unmapped), 'taxonomy')} of "
                f"{self._source} not found; add rows for {listed}"
            )


# ---- XML


def _parse(source: str, data: bytes) -> _ExposureModel:
    """Return the contents of an XML file. ModelError is raised if it is not valid XML, contains a
    document type definition (which could reference other files), or is not an exposure model.
    """
    parser, model = expat.ParserCreate(namespace_separator=" "), _ExposureModel()
    path: list[str] = []  # names of the open elements, from the outermost
    texts: list[str] = []  # parts of the text after the last tag, which expat passes separately

    def refuse(*_: object) -> None:
        """Refuse a document type definition, which could reference other files."""
        raise ModelError(
            f"{source}: a document type definition is not allowed; remove the line <!DOCTYPE ...>"
        )

    def start(name: str, attributes: dict[str, str]) -> None:
        """Store the attributes of an element in `model` when its start tag is read."""
        local = name.rpartition(" ")[2]  # expat writes the namespace and a blank before the name
        path.append(local)
        texts.clear()
        if len(path) == 2 and path != ["nrml", "exposureModel"]:
            raise ModelError(
                f"{source}: must contain an exposureModel, got {'/'.join(path)[:60]}; {_REQUIRED}"
            )
        parent = path[-2] if len(path) > 1 else ""
        last_asset = model.assets[-1][1] if model.assets else {}
        if local == "costType" and attributes.get("name") == _STRUCTURAL:
            model.cost_type = _known_type(source, parser.CurrentLineNumber, attributes, _COST_TYPES)
        elif local == "area" and parent == "conversions":
            model.area_type = _known_type(source, parser.CurrentLineNumber, attributes, _AREA_TYPES)
        elif local == "field":
            # The element <field oq="area" input="sqm"/> assigns the column sqm to the field area.
            # In <field oq="value" type="structural" input="cost"/> the name of the field is the
            # cost type, here structural, because the fields of all cost types are named value.
            oq_field = attributes.get("oq", "")
            field_name = attributes.get("type", "") if oq_field == "value" else oq_field
            model.fields[field_name] = attributes.get("input", "")
        elif local == "asset":
            model.assets.append((parser.CurrentLineNumber, dict(attributes)))
        elif local == "location" and parent == "asset":
            last_asset |= {name: attributes.get(name, "") for name in ("lon", "lat")}
        elif local == "cost" and attributes.get("type") == _STRUCTURAL:
            last_asset[_STRUCTURAL] = attributes.get("value", "")
        elif local == "tags":
            # Tags must not overwrite fields of the asset.
            last_asset.update({tag: text for tag, text in attributes.items() if tag not in _FIELDS})

    def end(_: str) -> None:
        """Store the text of an element when its end tag is read."""
        text, local = "".join(texts), path.pop()
        texts.clear()
        if local == "assets" and not model.assets:
            model.files = text
        if local == "tagNames":
            model.tags += text.split()

    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = texts.append
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        raise ModelError(f"{source}:{error.lineno}: invalid XML: {reason}") from None
    if model.cost_type == _PER_AREA and not model.area_type:
        raise ModelError(
            f"{source}: structural costs are per area, but the file does not state the type of the "
            f"areas; add <area type=...> with {' or '.join(_AREA_TYPES)} to <conversions>"
        )
    return model


def _known_type(
    source: str, line: int, attributes: Mapping[str, str], allowed: Sequence[str]
) -> str:
    """Return the type of costs or areas of an element; raise ModelError if it is unknown."""
    text = attributes.get("type", "")
    if text not in allowed:
        raise ModelError(
            f"{source}:{line}: type must be one of {', '.join(allowed)}, got {text[:40]!r}"
        )
    return text
