"""Pictures of what a building has to bear: its modes, and demands over its height or of its parameters."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.output.figures.demands import floor_spectra as floor_spectra
    from tdint.output.figures.demands import mode_shapes as mode_shapes
    from tdint.output.figures.demands import story_profiles as story_profiles
    from tdint.output.figures.demands import tornado as tornado

__getattr__ = modules_on_use(__name__)
