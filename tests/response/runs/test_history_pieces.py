"""Histories in chunks: joined, they equal the complete history bit for bit, and memory is limited
to one chunk."""

import io
import tracemalloc
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest

from building_cases import model, story
from tdint.errors import AnalysisError
from tdint.ground_motion.record import Record
from tdint.model.story_laws import Law
from tdint.output.tables.histories import write_history
from tdint.response.runs.history import History
from tdint.response.runs.outcome import Response
from tdint.response.runs.run import run

ONE = [story(2.0e4, 2.0e7)]
THREE = [
    *ONE,
    story(2.0e4, 2.0e7, Law("bilinear", (4.0e4, 0.05))),
    story(2.0e4, 1.5e7, dashpot=2.0e4),
]
MOTION = Record(3.0 * np.sin(0.31 * np.arange(240)) * np.hanning(240), 0.02, "", "", "HN1", "made")


def run_and_chunks(
    monkeypatch: pytest.MonkeyPatch, rows: int = 7, **options: Any
) -> tuple[Response, Any]:
    """Return a run with its history, and a function that computes the history again in chunks of
    `rows` rows."""
    response = run(model(THREE), MOTION, history=True, **options)
    monkeypatch.setattr("tdint.response.runs.prepared._CHUNK_BYTES", 8 * 26 * rows)
    assert response.history_chunks is not None
    return response, response.history_chunks


def same(first: Any, second: Any) -> bool:
    if is_dataclass(first):
        return all(
            same(getattr(first, field.name), getattr(second, field.name)) for field in fields(first)
        )
    return first is second if first is None else np.array_equal(first, second, equal_nan=True)


@pytest.mark.parametrize(
    "options",
    [
        {"method": "impulse4"},
        {"method": "newmark-average", "dt": 0.005},
        {"method": "moment4", "check": True},
        {"method": "moment4", "dt": 0.06, "duration": 6.0},
        {"method": "park"},
    ],
)
def test_joined_history_chunks_equal_complete_history(
    monkeypatch: pytest.MonkeyPatch, options: dict[str, Any]
) -> None:
    response, pieces = run_and_chunks(monkeypatch, **options)
    assert response.history is not None
    for every in (1, 3, 10, 240, 5000):
        parts = list(pieces(every))
        assert len(parts) > 1 or every >= 10
        assert all(len(piece.time) <= 12 for piece in parts), every
        assert same(History.joined(parts), response.history.every(every)), every


def test_file_written_in_chunks_is_identical(monkeypatch: pytest.MonkeyPatch) -> None:
    response, pieces = run_and_chunks(monkeypatch)
    assert response.history is not None
    at_once, in_pieces = io.BytesIO(), io.BytesIO()
    write_history([response.history.every(3)], at_once)
    write_history(pieces(3), in_pieces)
    assert at_once.getvalue() == in_pieces.getvalue()


@pytest.mark.long
def test_memory_of_history_chunks_does_not_grow_with_steps() -> None:
    """The complete history of these steps would require more than 100 MB."""
    response = run(model(ONE), MOTION, method="newmark-average", dt=1e-5, duration=10.0)
    assert (response.steps, response.history) == (1_000_000, None)
    assert response.history_chunks is not None
    for every in (1, 1000):
        tracemalloc.start()
        try:
            rows = sum(len(piece.time) for piece in response.history_chunks(every))
            _, peak = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert rows == 1_000_000 // every + 1
        assert peak < 6e7, every


def test_history_exceeding_memory_is_refused_with_size(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tdint.methods.workspace.available_memory", lambda: 1e6)
    with pytest.raises(AnalysisError, match=r"1000001 rows .*0\.24 GB .*0\.001 GB"):
        run(model(ONE), MOTION, dt=1e-5, duration=10.0, history=True, method="newmark-average")
