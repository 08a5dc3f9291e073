"""Files with accelerograms under a free header, written by the tests, with their right values.

Each case is a kind of file that data centers and programs write; the texts are made up.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tdint.units import STANDARD_GRAVITY

CENTIMETERS, METERS = 0.01, 1.0


def accelerogram(samples, peak, seed=1):
    """Return a smooth motion between small ends, with the peak `peak`."""
    source = np.random.default_rng(seed)
    t = np.arange(samples)
    frequencies = 0.03 * np.exp(source.normal(0.0, 0.5, 40))
    waves = np.sin(2.0 * np.pi * np.outer(t, frequencies) + source.uniform(0.0, 6.0, 40))
    values = waves.sum(axis=1) * (t / samples + 0.01) * np.exp(-5.0 * t / samples)
    return values * peak / np.max(np.abs(values))


def lines(values, width, form):
    """Return rows of `width` numbers in the form of `%`."""
    texts = [form % value for value in values]
    return "".join("".join(texts[i : i + width]) + "\n" for i in range(0, len(texts), width))


def printed(values, form):
    """Return the numbers as they are read from their text."""
    return np.array([float((form % value).replace("D", "E")) for value in values])


def column(values, form="%.6f"):
    """Return one number per line."""
    return lines(values, 1, form)


@dataclass(frozen=True)
class Case:
    """File with the options of the user and the right motion.

    Attributes
    ----------
    text : str
        Content of the file.
    values : ndarray
        Samples in the units of the file; rows for several components.
    dt : float
        Sampling interval, s.
    unit : float
        Unit of the samples, m/s^2.
    units : str or None
        Units that the user specifies.
    layout : dict
        Layout that the user specifies.
    is_stated : bool
        The file states the number of samples.
    """

    text: str
    values: Any
    dt: float
    unit: float = CENTIMETERS
    units: str | None = None
    layout: dict[str, Any] = field(default_factory=dict)
    is_stated: bool = True


GAL = accelerogram(1187, 182.0)
G = printed(accelerogram(1000, 0.2, seed=2), "%.6f")
THREE = np.round([accelerogram(800, peak, seed) for seed, peak in enumerate((2.0, 1.5, 0.9))], 5)
F8 = np.round(GAL, 2)
FULL = np.round(accelerogram(643, 150.0, seed=3) + 400.0, 6)
E14 = printed(accelerogram(900, 4.2, seed=4), "%14.7E")
BLOCKS = (
    "MADE UP BUILDING, ROOF\n090 DEGREES\nSAMPLES/SEC=200 DATA TYPE=AC\n"
    "NO OF POINTS=  1187, UNITS=CM/SEC**2, CM/SEC, AND CM\n"
)
VELOCITY = np.cumsum(F8) * 0.005
IN_G = {"unit": STANDARD_GRAVITY, "units": "g"}

CASES = {
    "network": Case(
        "064ABC\nSITE: SOIL\nCOMP. NS\nACCELERATION          UNIT: CM/SEC/SEC\n"
        "NO. OF POINTS:  1187  EQUALLY SPACED INTERVALS OF:  0.005  SEC\n"
        f"PEAK VALUE:  {F8[np.argmax(np.abs(F8))]:9.3f}   AT    3.71 SEC\n\n"
        + lines(F8, 8, "%13.6E "),
        F8,
        0.005,
    ),
    "without blanks": Case(
        "Time Increment (s)            : 0.01\nNumber of Data                : 900\n"
        f"PGA (m/s/s)                   : {np.max(np.abs(E14)):.7E}\n"
        "Acceleration time series in m/s/s\n" + lines(E14, 5, "%14.7E"),
        E14,
        0.01,
        METERS,
    ),
    "full fields": Case(
        "Offset record\nUNITS: GAL\nNUMBER OF POINTS 643\nSAMPLING RATE 200 HZ\n"
        + lines(FULL, 8, "%10.6f"),
        FULL,
        0.005,
    ),
    "three blocks": Case(
        BLOCKS + "".join(lines(part, 10, "%8.2f") for part in (F8, VELOCITY, VELOCITY / 9)),
        F8,
        0.005,
    ),
    "three blocks with blank lines": Case(
        BLOCKS + "\n".join(lines(part, 10, "%8.2f") for part in (F8, VELOCITY, VELOCITY / 9)),
        F8,
        0.005,
    ),
    "named blocks": Case(
        BLOCKS
        + lines(F8, 10, "%8.2f")
        + "VELOCITY DATA\n"
        + lines(VELOCITY, 10, "%8.2f")
        + "DISPLACEMENT DATA\n"
        + lines(VELOCITY / 9, 10, "%8.2f"),
        F8,
        0.005,
    ),
    "peak with unit": Case(
        "  1187 POINTS OF ACC DATA EQUALLY SPACED AT   .010 SEC.\n"
        f"PEAK ACCELERATION = {F8[np.argmax(np.abs(F8))]:.4f} CMS/SEC/SEC AT 1.0 SEC\n"
        + lines(F8, 8, "%10.2f"),
        F8,
        0.01,
    ),
    "end mark": Case(
        "NO. OF POINTS: 1187 INTERVALS OF: 0.01 SEC\nACCELERATION UNIT: CM/SEC/SEC\n"
        + lines(F8, 8, "%10.2f")
        + "\x1a",
        F8,
        0.01,
    ),
    "header of numbers": Case(
        "RECORD 7\nNUMBER OF POINTS: 1187\nTIME STEP: 0.01 S\nUNITS: CM/SEC/SEC\n"
        "    1    2 1994    1   17    4   30   55\n    0    0    3    1\n" + lines(F8, 8, "%10.2f"),
        F8,
        0.01,
    ),
    "D exponents": Case(
        "Number of points = 900, time step = 0.02 s\nunits: m/s2\n"
        + lines(E14, 5, "%15.7E").replace("E", "D"),
        E14,
        0.02,
        METERS,
    ),
    "interval in ms": Case(
        "Sampling interval (ms): 5\nACC. [mg]\n" + lines(F8, 6, "%9.2f"),
        F8,
        0.005,
        1e-3 * STANDARD_GRAVITY,
        is_stated=False,
    ),
    "text at the end": Case(
        lines(F8, 8, "%10.2f") + "*** end ***\n",
        F8,
        0.02,
        units="gal",
        layout={"step": 0.02},
        is_stated=False,
    ),
    "no header": Case(
        lines(E14, 5, "%15.7E"), E14, 0.02, METERS, "m/s^2", {"step": 0.02}, is_stated=False
    ),
    "numbered lines": Case(
        "ACCELERATION IN GAL, DT=0.01 SEC\n"
        + "".join(
            f"{number:5d} {line}\n"
            for number, line in enumerate(lines(F8, 8, "%9.2f").splitlines(), start=1)
        ),
        F8,
        0.01,
        is_stated=False,
    ),
    "one line": Case(
        "number of samples = 1187, units: gal, dt = 0.01 s\n" + lines(F8, 2000, "%9.2f"), F8, 0.01
    ),
    "count and step": Case("1000 0.01\n" + column(G), G, 0.01, **IN_G),
    "step and count": Case("0.01 1000\n" + column(G), G, 0.01, **IN_G),
    "step and count in two lines": Case("0.01\n1000\n" + column(G), G, 0.01, **IN_G),
    "count": Case("1000\n" + column(G), G, 0.02, **IN_G, layout={"step": 0.02}),
    "name, count and step": Case("made-up motion\n1000 0.0100\n" + column(G), G, 0.01, **IN_G),
    "count, step, name": Case("1000 0.0100\nmade-up motion\n" + column(G), G, 0.01, **IN_G),
    "three numbers above rows": Case(
        "Made-up motion\n 1000 0.0100 321\n" + lines(G, 5, " %13.6E"), G, 0.01, **IN_G
    ),
    "count and step above times": Case(
        " 1000  0.01\n" + "".join(f"{(i + 1) * 0.01:8.3f} {a:14.6E}\n" for i, a in enumerate(G)),
        G,
        0.01,
        **IN_G,
    ),
    "text above names": Case(
        "The Nowhere earthquake of May 5, 2005.\nSource: none\nTime[s] Accel[g]\n"
        + "".join(f"{i * 0.01:.4f}\t{a:.6f}\n" for i, a in enumerate(G)),
        G,
        0.01,
        STANDARD_GRAVITY,
        is_stated=False,
    ),
    "pairs": Case(
        "MADE UP\nUNITS: GAL\n"
        + lines(np.stack((0.01 * np.arange(1187)[:1184], F8[:1184]), axis=1).ravel(), 8, "%9.2f"),
        F8[:1184],
        0.01,
        is_stated=False,
    ),
    "columns by count": Case(
        "Test of Mr. X\nNumber of samples: 800\ntime step: 0.01 s\nUNITS: m/s2\n"
        + lines(THREE.T.ravel(), 3, "%10.5f"),
        THREE[1:],
        0.01,
        METERS,
        layout={"column": ("2", "3")},
    ),
    "columns without a header": Case(
        lines(THREE.T.ravel(), 3, "%10.5f"),
        THREE,
        0.01,
        METERS,
        "m/s^2",
        {"step": 0.01},
        is_stated=False,
    ),
}
