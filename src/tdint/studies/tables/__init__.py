"""Tables of this package; each module is imported at its first use."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.studies.tables import campaign as campaign
    from tdint.studies.tables import comparison as comparison
    from tdint.studies.tables import damage_states as damage_states
    from tdint.studies.tables import exports as exports
    from tdint.studies.tables import maps as maps
    from tdint.studies.tables import matching as matching
    from tdint.studies.tables import studies as studies

__getattr__ = modules_on_use(__name__)
