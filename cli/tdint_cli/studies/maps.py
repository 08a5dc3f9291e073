"""Polygons and checks of the maps of a campaign."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from tdint.errors import UsageError
from tdint.studies.fragility.building_damage import has_losses
from tdint.studies.fragility.damage_tables import check_column
from tdint.studies.regions.maps import check_events, is_mapped, read_polygons
from tdint.studies.store.result_store import Store


def polygons_of_districts(
    store: Store, file: str | None, by: str
) -> dict[str, dict[str, Any]] | None:
    """Return the polygon of each district from a GeoJSON file; None without a file.

    Parameters
    ----------
    by : str
        Column of the inventory; buildings with the same value form a district. The column exists,
        because the options have been checked.

    Raises
    ------
    UsageError
        The polygons cannot be read, or the polygon of a district is missing.
    """
    if file is None:
        return None
    # Upper and lower case of column names are equivalent. The cells that the store keeps for a
    # building are in the order of these columns.
    column = [title.lower() for title in store.inventory_columns()].index(by.lower())
    districts = {store.copied_cells(number)[column] for number in store.buildings()}
    return read_polygons(file, by, sorted(districts))


def check_map(store: Store, events: Collection[str], by: str | None, *, complete: bool) -> None:
    """Raise UsageError if a requested map cannot be written from a store.

    A map requires coordinates of the buildings, the results of all runs, and known events. A map of
    districts also requires the column of the districts and damage states with losses.

    Parameters
    ----------
    by : str | None
        Column of the districts; None without a map of districts.
    complete : bool
        True if all runs are completed.
    """
    if not is_mapped(store):
        raise UsageError(
            f"{store.name}: the buildings have no coordinates; a map requires an inventory with "
            "the columns Latitude and Longitude"
        )
    if not complete:
        raise UsageError(
            f"{store.name}: not all runs are completed, and a map requires the results of all "
            "ground motions; run `tdint campaign` again first"
        )
    check_events(store, events)
    if by is not None:
        check_column(store, by)
        if not has_losses(store):
            raise UsageError(
                f"--geojson --by {by}: a map of districts requires losses; add `damage` with "
                "`losses` to the campaign file"
            )
