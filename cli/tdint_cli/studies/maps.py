"""Options and checks of the maps of a campaign."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, BinaryIO

from tdint.errors import UsageError

if TYPE_CHECKING:
    from tdint.studies.store.result_store import Store


@dataclass(frozen=True)
class MapRequest:
    """Options of maps.

    Attributes
    ----------
    is_requested : bool
        Write the GeoJSON map of the buildings and, with `--by`, the map of the districts.
    events : tuple of str
        Events on the maps; all if empty.
    polygons : str | None
        GeoJSON file with the polygons of the districts; by default their buildings are points.
    """

    is_requested: bool = False
    events: tuple[str, ...] = ()
    polygons: str | None = None

    def districts(self, store: Store, by: str) -> Callable[[BinaryIO], None]:
        """Return a function that writes the map of districts to a binary stream.

        Polygons, if there are any, are read and compared with the districts before the function is
        returned, so that errors are reported before any file is written.

        Parameters
        ----------
        by : str
            Column of the inventory; buildings with the same value form a district.

        Raises
        ------
        UsageError
            The polygons cannot be read, or the polygon of a district is missing.
        """
        from tdint.studies.regions.maps import read_polygons, write_districts

        polygons = None
        if self.polygons is not None:
            # The column `by` exists, because the options have been checked. Upper and lower case of
            # column names are equivalent. The cells that the store keeps for a building are in the
            # order of these columns.
            column = [title.lower() for title in store.inventory_columns()].index(by.lower())
            districts = {store.copied_cells(number)[column] for number in store.buildings()}
            polygons = read_polygons(self.polygons, by, sorted(districts))
        return partial(write_districts, store, by=by, polygons=polygons, events=self.events)


def check_map(store: Store, maps: MapRequest, by: str | None, *, complete: bool) -> None:
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
    from tdint.studies.fragility.building_damage import has_losses
    from tdint.studies.fragility.damage_tables import check_column
    from tdint.studies.regions.maps import check_events, is_mapped

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
    check_events(store, maps.events)
    if by is not None:
        check_column(store, by)
        if not has_losses(store):
            raise UsageError(
                f"--geojson --by {by}: a map of districts requires losses; add `damage` with "
                "`losses` to the campaign file"
            )
