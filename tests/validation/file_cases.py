"""Cases of the page that require a file: shipped records, or files that `fetch.py` downloads."""

from pathlib import Path

import numpy as np
from fetch import SOURCES
from numpy.typing import NDArray

import tdint
from tdint.assessment.validation.validation import MODEL, NUMERICAL, ROUNDING, ValidationCase
from tdint.ground_motion.record import Record

Array = NDArray[np.float64]

RECORDS = Path(__file__).parents[2] / "records"
INCH = 0.0254
G_BOOK, G = 9.81, 9.80665


def _el_centro() -> Record:
    return tdint.read_record(str(SOURCES["elcentro"].path))


def _spectral_displacements(pairs: list[tuple[float, float]], unit: float) -> Array:
    record = _el_centro()
    found = [
        tdint.spectrum(record, np.array([period]), damping, maxima="samples").sd
        for period, damping in pairs
    ]
    return np.ravel(found) / unit


def _frame() -> Array:
    """Return roof displacement (cm), shears of story 5 and 1 (kN) and base moment (kN m) of
    Chopra's five-story frame."""
    model = tdint.load_model(
        {
            "units": {"length": "m", "force": "kN", "mass": "t"},
            "stories": [{"repeat": 5, "mass": 45, "height": 4, "stiffness": 5482}],
            "damping": {"modal": 0.05},
        }
    )
    history = tdint.run(model, _el_centro(), method="exact", history=True).history
    assert history is not None
    forces = history.shear / 1e3
    moment = 4.0 * forces.sum(axis=1)
    largest = (100.0 * history.displacement[:, 4], forces[:, 4], forces[:, 0], moment)
    return np.array([np.max(np.abs(values)) for values in largest])


def _two_stories() -> Array:
    model = tdint.load_model(
        {
            "stories": [{"mass": 5000, "stiffness": 394784}, {"mass": 2500, "stiffness": 197392}],
            "damping": {"modal": 0.02},
        }
    )
    response = tdint.run(model, _el_centro(), method="exact")
    return np.array([response.stories.peak_displacement[1], response.stories.peak_shear[0] / 1e3])


def el_centro_cases() -> tuple[ValidationCase, ...]:
    """Return Chopra's spectra and frames under El Centro."""
    book = (
        "A. K. Chopra, section 6.4, figures 6.6.2, 6.8.4 and 7.4.3a; OpenSees' sdofTransient "
        "verification has the same"
    )
    pairs = [(0.5, 0.02), (1.0, 0.02), (2.0, 0.02), (2.0, 0.0), (2.0, 0.05), (0.5, 0.05)]
    return (
        ValidationCase(
            "chopra-6",
            "maximum displacements of oscillators under El Centro, at its samples",
            book,
            "in",
            tuple(f"T {period} s, {damping:.0%}" for period, damping in pairs),
            (2.67, 5.97, 7.47, 9.91, 5.37, 2.25),
            lambda: _spectral_displacements(pairs, INCH),
            0.0125,
            ROUNDING,
            remark="printed with two decimals; T 0.5 s, 5 % is read off a figure",
        ),
        ValidationCase(
            "structdyn-spectra",
            "two of these spectral ordinates, computed by StructDyn",
            "StructDyn, tests/test_sdf.py",
            "m",
            ("T 0.5 s, 2 %", "T 2 s, 2 %"),
            tuple(v * G / G_BOOK for v in (0.0679400697200714, 0.1896749378231744)),
            lambda: _spectral_displacements([(0.5, 0.02), (2.0, 0.02)], 1.0),
            1e-6,
            NUMERICAL,
            relative=True,
            remark="corrected for its g of 9.81; StructDyn uses a different method",
        ),
        ValidationCase(
            "chopra-13",
            "five-story frame: roof, shears, base moment",
            "A. K. Chopra, 5th ed. (2020), figures 13.2.7 and 13.2.8",
            "cm, kN, kN m",
            ("u5", "shear of story 5", "base shear", "base moment"),
            (17.383, 155.308, 323.062, 3811.79),
            _frame,
            1.5e-3,
            ROUNDING,
            relative=True,
            remark="the book uses g = 9.81 and a time-stepping method; a separate state-space "
            "solution agrees to 6 digits",
        ),
        ValidationCase(
            "nptel-3.6",
            "two stories: roof displacement and base shear",
            "NPTEL, Introduction to Earthquake Engineering, figures 3.13 and 3.14",
            "m, kN",
            ("u2", "base shear"),
            (0.202, 40.72),
            _two_stories,
            5e-3,
            ROUNDING,
            relative=True,
            remark="the record of the course is rounded differently",
        ),
    )


def berkeley_cases() -> tuple[ValidationCase, ...]:
    """Return spectra that a network published with its record."""
    periods = (0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 5.0)
    published = {
        0.02: (0.025499, 0.099746, 0.13405, 0.14782, 0.11189, 0.10662, 0.099191),
        0.05: (0.024463, 0.086276, 0.11027, 0.12204, 0.10678, 0.10405, 0.09916),
    }

    def computed(damping: float) -> Array:
        record = tdint.read_record(str(SOURCES["berkeley"].path))
        return np.asarray(
            100.0 * tdint.spectrum(record, np.array(periods), damping, maxima="samples").sd
        )

    return tuple(
        ValidationCase(
            f"usgs-1103-{damping:.0%}",
            f"spectral displacements of station 1103 at its samples, damping {damping:.0%}",
            "USGS National Strong Motion Project, 1103.HN2.NP.BE_r.rs2",
            "cm",
            tuple(f"T {t} s" for t in periods),
            numbers,
            lambda damping=damping: computed(damping),
            3e-3,
            ROUNDING,
            relative=True,
            remark="the published spectra are from 12 200 samples with padding, the available "
            "record has 8200: the effect is visible at 5 s",
        )
        for damping, numbers in published.items()
    )


def kaikoura_cases() -> tuple[ValidationCase, ...]:
    """Return the cases that compare the GeoNet files of the shipped records with the values in
    their headers."""
    stated = {
        "WTMC": ((9.7331, 7.9664, 18.0219), (1.01655, 0.68643, 0.39493)),
        "HSES": ((2.3646, 2.5537, 1.5712), (0.29849, 0.27623, 0.09796)),
    }

    def peaks(name: str) -> list[Record]:
        path = str(RECORDS / "kaikoura" / f"{name}.mseed")
        return [
            tdint.read_record(path, component=code, units="m/s^2") for code in ("HN1", "HN2", "HNZ")
        ]

    def velocity(record: Record) -> float:
        steps = 0.5 * record.dt * (record.acceleration[1:] + record.acceleration[:-1])
        return float(np.max(np.abs(np.cumsum(steps))))

    cases = []
    for name, (accelerations, velocities) in stated.items():
        source, quantities = "GeoNet, header of the V2A file", ("HN1", "HN2", "HNZ")
        cases += [
            ValidationCase(
                f"kaikoura-{name}-pga",
                "peak accelerations stated by the network",
                source,
                "m/s^2",
                quantities,
                accelerations,
                lambda name=name: [record.pga for record in peaks(name)],
                1e-9,
                ROUNDING,
            ),
            ValidationCase(
                f"kaikoura-{name}-pgv",
                "peak velocities stated by the network, compared with integrated velocities",
                source,
                "m/s",
                quantities,
                velocities,
                lambda name=name: [velocity(record) for record in peaks(name)],
                6e-2,
                MODEL,
                relative=True,
                remark="the velocities of the network are filtered and not integrated from "
                "these 0.02 s samples",
            ),
        ]
    return tuple(cases)
