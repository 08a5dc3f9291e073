"""Arguments of the Python interface that represent a model, a record or a number."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import tdint
from tdint.errors import RecordError, UsageError

MODEL = "configs/ten-story.yaml"
SAMPLES = np.sin(np.arange(300) * 0.1)


def record(component: str = "HNE", factor: float = 1.0) -> Any:
    return tdint.make_record(factor * SAMPLES, dt=0.01, units="m/s^2", component=component)


def test_texts_are_accepted_for_numbers() -> None:
    model = tdint.load_model(MODEL)
    assert (
        tdint.run(model, record(), tolerance="1%").dt
        == tdint.run(model, record(), tolerance=0.01).dt
    )
    assert tdint.spectrum(record(), np.array([1.0]), "5%").damping == 0.05  # type: ignore[arg-type]
    assert np.array_equal(*(tdint.pushover(model, size, points=9).drift for size in (0.02, "2%")))
    halves = [tdint.cyclic_test(model, 1, [drift], points=9).path.drift for drift in (0.02, "2%")]
    assert np.array_equal(*halves)
    assert model.replace(damping="2%") == model.replace(damping=0.02)
    response = tdint.run(model, record(), history=True)
    (roof,) = tdint.floor_spectra(response, ["roof"], np.array([1.0]))
    assert roof.floor == 10


WRONG: list[tuple[type[Exception], Callable[[Any], Any]]] = [
    (RecordError, lambda model: tdint.run(model, SAMPLES)),
    (RecordError, lambda model: tdint.run(model, "nowhere")),
    (UsageError, lambda model: tdint.run(model, record(), tolerance="little")),
    (UsageError, lambda model: tdint.run(model, record(), dt="x")),  # type: ignore[arg-type]
    (UsageError, lambda model: tdint.run(model, record(), duration=[1])),  # type: ignore[arg-type]
    (UsageError, lambda model: tdint.run(model, record(), method=5)),  # type: ignore[arg-type]
    (
        UsageError,
        lambda model: tdint.floor_spectra(tdint.run(model, record()), ["roof"], np.array([1.0])),
    ),
    (UsageError, lambda model: tdint.spectrum(record(), ["x"])),  # type: ignore[arg-type]
    (UsageError, lambda model: tdint.spectrum(record(), [1.0], None)),  # type: ignore[arg-type]
    (RecordError, lambda model: tdint.rotated_spectrum((record(), 5), np.array([1.0]))),  # type: ignore[arg-type]
    (RecordError, lambda model: tdint.rotated_spectrum(record(), np.array([1.0]))),
    (RecordError, lambda model: tdint.drift_spectrum(SAMPLES, np.array([1.0]))),  # type: ignore[arg-type]
    (RecordError, lambda model: tdint.constant_ductility(SAMPLES, np.array([1.0]), [2.0])),  # type: ignore[arg-type]
    (RecordError, lambda model: tdint.make_record(SAMPLES, dt=1e300, units="g")),
    (UsageError, lambda model: tdint.pushover(model, 2)),
    (UsageError, lambda model: tdint.pushover(model, None)),  # type: ignore[arg-type]
    (UsageError, lambda model: model.replace(damping=None)),
    (UsageError, lambda model: model.replace(stiffness_factor="stiff")),
    (UsageError, lambda model: tdint.run_case(model)),
    (UsageError, lambda model: tdint.run_sequence(model, [record()])),
    (RecordError, lambda model: tdint.ida(model, [SAMPLES])),  # type: ignore[list-item]
]


@pytest.mark.parametrize(("error", "call"), WRONG)
def test_invalid_arguments_raise_documented_errors(
    error: type[Exception], call: Callable[[Any], Any]
) -> None:
    with pytest.raises(error):
        call(tdint.load_model(MODEL))
