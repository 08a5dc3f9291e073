"""Tables of this package; each module is imported at its first use."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.assessment.tables import assessment as assessment

__getattr__ = modules_on_use(__name__)
