"""Keys of linear models of matrices in a model file, without numpy: other models do not load it."""

from __future__ import annotations

from tdint.model.keys.fields import ANY, POSITIVE, Either, EntriesOf, Key, Keys, TextLine

_ROWS = EntriesOf(EntriesOf(ANY, least=1), least=1)
MATRIX = Either((TextLine(), _ROWS))
"""Rows of numbers, or a CSV file."""

_MATRIX_OR_DIAGONAL = Either(
    (TextLine(), EntriesOf(Either((ANY, EntriesOf(ANY, least=1))), least=1))
)
MATRICES = Keys(
    (
        Key("names", EntriesOf(TextLine(), least=1), "names of the rows; default: row_1, ..."),
        Key("mass", _MATRIX_OR_DIAGONAL, "rows, the diagonal, or a CSV file", needed=True),
        Key(
            "inertance",
            _MATRIX_OR_DIAGONAL,
            "rows, the diagonal, or a CSV file: inertia that the ground motion does not load",
        ),
        Key("stiffness", MATRIX, "rows or a CSV file", needed=True),
        Key(
            "damping",
            _MATRIX_OR_DIAGONAL,
            "rows, the diagonal, or a CSV file, instead of `damping` of the model",
        ),
        Key(
            "influence",
            EntriesOf(ANY, least=1),
            "displacements of the rows for a unit displacement of the ground; default: 1",
        ),
    )
)
BASE = Keys(
    (
        Key("rotation", POSITIVE, "stiffness of the rotational spring, force length/rad"),
        Key("translation", POSITIVE, "stiffness of the horizontal spring, force/length"),
    )
)
