"""Studies of many runs: campaigns, IDA, fragility, and ground motions for them."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.studies import campaign as campaign
    from tdint.studies import fragility as fragility
    from tdint.studies import ida as ida
    from tdint.studies import motions as motions
    from tdint.studies import recordings as recordings
    from tdint.studies import regions as regions
    from tdint.studies import sensitivity as sensitivity
    from tdint.studies import store as store

__getattr__ = modules_on_use(__name__)
