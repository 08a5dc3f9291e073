"""Hysteresis models of stories (drift laws), one file for each law.

The number of a law is its index in the sequence `LAWS`. Row CODE of the table `law_parameters`
contains the number of the law of each story. Compiled code selects the law by this number
(`tdint.kernels.laws.selection`). The laws of plug-ins are appended to the sequence
(`tdint.model.story_laws.register_law`).
"""

from __future__ import annotations

from collections import UserList
from collections.abc import Iterator
from importlib import import_module
from typing import Any

# The order must not change, because the position of a law is its number.
NAMES = (
    "linear",
    "bilinear",
    "peak-oriented",
    "bouc-wen",
    "gap",
    "tanh",
    "polynomial",
    "trilinear-pinching",
    "imk",
    "multilinear-pinching",
    "multilinear",
    "ramberg-osgood",
    "steel",
    "hertz",
)
"""Names of the laws of tdint in the order of their numbers."""


UNAVAILABLE = {
    "friction": "friction that depends on the velocity is not available, because the force of a "
    "law depends on the drift only; use bilinear with the sliding force as yield_force and "
    "hardening 0 for a constant friction"
}
"""Reasons by the names of laws that other programs have and tdint lacks."""

_PERFECTLY_PLASTIC = "bilinear with hardening 0"
_BY_RULE = "multilinear with rule: "
OTHER_NAMES = {
    **dict.fromkeys(
        ("elastoplastic", "elasticplastic", "elasticperfectlyplastic", "elasticpp", "epp"),
        _PERFECTLY_PLASTIC,
    ),
    **dict.fromkeys(("perfectlyplastic", "coulomb", "coulombfriction"), _PERFECTLY_PLASTIC),
    "frictionpendulum": "bilinear with hardening, the sliding force as yield_force",
    **dict.fromkeys(("takeda", "modifiedtakeda"), "peak-oriented with unloading"),
    **dict.fromkeys(("clough", "qhyst", "stiffnessdegrading"), "peak-oriented"),
    **dict.fromkeys(("originoriented", "origincentered"), f"{_BY_RULE}origin"),
    **dict.fromkeys(("flagshaped", "selfcentering", "ringspring"), f"{_BY_RULE}flag"),
    **dict.fromkeys(("elasticmultilinear", "nonlinearelastic"), f"{_BY_RULE}elastic"),
    **dict.fromkeys(("iwan", "masing"), f"{_BY_RULE}kinematic"),
    "hardening": f"{_BY_RULE}isotropic",
    "hysteretic": f"{_BY_RULE}peak",
    "kentpark": f"{_BY_RULE}peak, with the points of its envelope",
    **dict.fromkeys(("imkpeakoriented", "imkpinching", "ibarrakrawinkler"), "imk"),
    "lignoskrawinkler": "imk",
    "elastic": "linear",
    "steel01": "bilinear",
    **dict.fromkeys(("steel02", "menegottopinto", "steelmpf"), "steel"),
    **dict.fromkeys(("pinching4", "stewart"), "multilinear-pinching"),
    "davidenkov": "ramberg-osgood",
    "bwbn": "bouc-wen",
    **dict.fromkeys(("stop", "hook", "pounding"), "gap"),
    **dict.fromkeys(("maxwell", "kelvin"), "a dashpot of the story, with a brace in series or not"),
}
"""What a model file contains for laws with other names, in small letters without other characters.
The glossary explains them."""


class Laws(UserList[Any]):
    """Sequence of laws. The module of a law of tdint is imported when the law is first used, so
    that a run loads only the laws of its building. The module has the name of the law, with "_" for
    "-".
    """

    def names(self) -> Iterator[str]:
        """Yield the names of all laws without importing them."""
        for item in self.data:
            yield item if isinstance(item, str) else item.name

    def __getitem__(self, number: Any) -> Any:
        """Return the law with a number; its module is imported at the first access.

        The number of a law that can fracture is the number of the law plus FRACTURING.
        """
        if not isinstance(number, slice):
            whole = int(number)
            if number != whole:
                from tdint.kernels.laws.fracture import fracturing

                return fracturing(self[whole])
            number = whole
        item = self.data[number]
        if isinstance(item, str):
            item = import_module(f"tdint.kernels.laws.{item.replace('-', '_')}").LAW
            self.data[number] = item
        return item


LAWS = Laws(NAMES)
"""Laws by number: the laws of tdint, then the laws of plug-ins."""

OURS = len(NAMES)
"""Number of built-in laws. Laws with this number or a larger one belong to plug-ins."""

LINEAR = NAMES.index("linear")
"""Number of the linear law in row CODE of `law_parameters`."""
