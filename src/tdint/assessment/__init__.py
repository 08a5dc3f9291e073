"""Assessment of time-integration methods."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.assessment import chart as chart
    from tdint.assessment import examples as examples
    from tdint.assessment import failures as failures
    from tdint.assessment import order as order
    from tdint.assessment import stability as stability
    from tdint.assessment import validation as validation

__getattr__ = modules_on_use(__name__)
