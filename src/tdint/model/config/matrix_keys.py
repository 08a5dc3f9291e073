"""Keys of linear models of matrices in a model file, without numpy: other models do not load it."""

from __future__ import annotations

from tdint.model.config.keys import keys
from tdint.model.keys.fields import ANY, Either, EntriesOf, Keys, TextLine

_ROWS = EntriesOf(EntriesOf(ANY, least=1), least=1)
MATRIX = Either((TextLine(), _ROWS))
"""Rows of numbers, or a CSV file."""

_MATRIX_OR_DIAGONAL = Either(
    (TextLine(), EntriesOf(Either((ANY, EntriesOf(ANY, least=1))), least=1))
)
MATRICES = Keys(
    keys(
        "matrices",
        mass=_MATRIX_OR_DIAGONAL,
        inertance=_MATRIX_OR_DIAGONAL,
        stiffness=MATRIX,
        damping=_MATRIX_OR_DIAGONAL,
    )
)
BASE = Keys(keys("base"))
