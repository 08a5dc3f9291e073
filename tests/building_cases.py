"""Buildings and motions that several tests use, defined by numbers."""

import numpy as np

from tdint.ground_motion.record import Record
from tdint.model.definition import (
    Analysis,
    Excitation,
    Force,
    Initial,
    ModalDamping,
    Model,
    RayleighCoefficients,
    RayleighRatio,
)
from tdint.model.story import Story
from tdint.model.story_laws import Law

LINEAR = Law("linear", ())
FIVE_PERCENT = RayleighRatio((0.05, 0.05), (1, 3))


def story(mass, stiffness, law=LINEAR, height=3.5, dashpot=0.0):
    return Story(mass=mass, height=height, stiffness=stiffness, law=law, dashpot=dashpot)


def model(
    stories, *, damping=None, forces=(), displacement=None, velocity=None, p_delta=False, **analysis
):
    """Return a model without a record."""
    n = len(stories)
    return Model(
        name="test",
        source="test",
        text=b"",
        stories=tuple(stories),
        damping=damping,
        p_delta=p_delta,
        excitation=Excitation(None, tuple(forces)),
        initial=Initial(tuple(displacement or (0.0,) * n), tuple(velocity or (0.0,) * n)),
        analysis=Analysis(analysis.get("method"), analysis.get("dt"), analysis.get("duration")),
        collapse_drift=0.10,
    )


def ten_linear(damping=FIVE_PERCENT):
    """Return ten equal linear stories with damping ratios of 5 % in modes 1 and 3."""
    return model([story(2e5, 3.5e8) for _ in range(10)], damping=damping)


def ten_bilinear(damping=FIVE_PERCENT):
    """Return ten bilinear stories with 3 % hardening; the yield force of the base is 0.15 of the
    weight, with a triangular pattern above."""
    weights = np.arange(1, 11) / 55.0
    yields = 0.15 * 10 * 2e5 * 9.81 * np.cumsum(weights[::-1])[::-1]
    return model(
        [story(2e5, 3.5e8, Law("bilinear", (float(fy), 0.03))) for fy in yields], damping=damping
    )


def oscillator(omega, xi=0.0, **more):
    """Return one story of unit mass."""
    return model([story(1.0, omega**2, dashpot=2.0 * xi * omega)], **more)


def noise(samples=801, dt=0.01, seed=7, peak=4.0):
    """Return a seeded random ground motion (m/s^2) that starts and ends at zero and is smooth
    enough to be resolved."""
    generator = np.random.default_rng(seed)
    t = np.arange(samples) * dt
    total = np.zeros(samples)
    for frequency in np.linspace(0.3, 6.0, 25):
        total += generator.normal() * np.sin(2.0 * np.pi * (frequency * t + generator.uniform()))
    total *= np.sin(np.pi * t / t[-1]) ** 2
    return Record(total * (peak / np.max(np.abs(total))), dt, "", "XX.TEST..HN1", "HN1", "test")


__all__ = [
    "LINEAR", "Force", "Law", "ModalDamping", "RayleighCoefficients", "RayleighRatio", "model",
    "noise", "oscillator", "story", "ten_bilinear", "ten_linear",
]  # fmt: skip
