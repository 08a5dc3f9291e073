"""OpenSees results for models of this project: python tests/validation/opensees.py writes
opensees.json again.

The models are defined here for OpenSeesPy, independent of tdint: ten equal stories (Elastic and
Steel01) and ten unequal stories, Rayleigh damping from the initial stiffness, average acceleration
with Newton's method, 0.01 s, records/firm-soil.mseed HN1. The maximum drifts at the steps are
stored. `pip install openseespy` is only required to write them again, not for the comparison.
"""

import json
import math
import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HERE = Path(__file__).parent
KEPT = HERE / "opensees.json"
RECORD = HERE.parents[1] / "records" / "firm-soil.mseed"
DT = 0.01


@dataclass(frozen=True)
class Frame:
    """A shear building: masses (kg), stiffnesses (N/m), yield forces (N; nan: none), hardening,
    damping ratio in the first and third mode."""

    what: str
    mass: Array
    stiffness: Array
    yield_force: Array
    hardening: float = 0.0
    ratio: float = 0.05

    def rayleigh(self) -> tuple[float, float]:
        """Return the factors of mass and stiffness of Rayleigh damping."""
        upper = np.append(self.stiffness[1:], 0.0)
        k = np.diag(self.stiffness + upper) - np.diag(upper[:-1], 1) - np.diag(upper[:-1], -1)
        root = 1.0 / np.sqrt(self.mass)
        omega = np.sqrt(np.linalg.eigvalsh(k * np.outer(root, root)))
        first, third = omega[0], omega[2]
        return 2.0 * self.ratio * first * third / (first + third), 2.0 * self.ratio / (
            first + third
        )


def problems() -> dict[str, Frame]:
    """Return the models by name."""
    ten = np.full(10, 200e3)
    springs = np.full(10, 3.5e8)
    steps = np.arange(10)
    uneven = Frame(
        "ten different yielding stories",
        ten * (1.0 - 0.03 * steps),
        springs * (1.2 - 0.07 * steps),
        3.0e6 * (1.0 - 0.06 * steps),
        0.05,
    )
    return {
        "linear": Frame("ten equal stories", ten, springs, np.full(10, math.nan)),
        "yielding": Frame(
            "ten equal stories with a yield force of 2500 kN",
            ten,
            springs,
            np.full(10, 2.5e6),
            0.03,
        ),
        "uneven": uneven,
    }


def ours(frame: Frame) -> Array:
    """Return the largest drifts at the steps as tdint computes them, m."""
    import tdint

    stories = []
    for mass, stiffness, yields in zip(frame.mass, frame.stiffness, frame.yield_force, strict=True):
        story: dict[str, Any] = {"mass": float(mass), "stiffness": float(stiffness)}
        if not math.isnan(yields):
            story["law"] = {
                "type": "bilinear",
                "yield_force": float(yields),
                "hardening": frame.hardening,
            }
        stories.append(story)
    by_mass, by_stiffness = frame.rayleigh()
    model = tdint.load_model(
        {"stories": stories, "damping": {"rayleigh": {"mass": by_mass, "stiffness": by_stiffness}}}
    )
    record = tdint.read_record(str(RECORD), component="HN1", units="m/s^2")
    history = tdint.run(model, record, method="newmark-average", dt=DT, history=True).history
    assert history is not None
    return np.max(np.abs(history.drift), axis=0)


def kept() -> dict[str, Any]:
    """Return the stored results of OpenSees and its version."""
    return dict(json.loads(KEPT.read_text(encoding="utf-8")))


def recomputed_peaks() -> dict[str, list[float]]:
    """Return peak drifts by name, computed with OpenSeesPy, or an empty dictionary if it cannot be
    loaded."""
    if find_spec("openseespy") is None:
        return {}
    done = subprocess.run(
        [sys.executable, __file__, "--print"], capture_output=True, text=True, check=False
    )
    answers = [
        line for line in done.stdout.splitlines() if line.startswith("{")
    ]  # OpenSees also prints other lines
    found = json.loads(answers[0]) if answers else {}
    return {name: peaks["peak_drift_m"] for name, peaks in found.items() if name != "version"}


def _peak_drifts(ops: Any, frame: Frame, ground: Array) -> list[float]:
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    n = frame.mass.size
    for node in range(n + 1):
        ops.node(node, 0.0)
    ops.fix(0, 1)
    for i in range(n):
        ops.mass(i + 1, float(frame.mass[i]))
        if math.isnan(frame.yield_force[i]):
            ops.uniaxialMaterial("Elastic", i + 1, float(frame.stiffness[i]))
        else:
            ops.uniaxialMaterial(
                "Steel01",
                i + 1,
                float(frame.yield_force[i]),
                float(frame.stiffness[i]),
                frame.hardening,
            )
        ops.element("zeroLength", i + 1, i, i + 1, "-mat", i + 1, "-dir", 1, "-doRayleigh", 1)
    by_mass, by_stiffness = frame.rayleigh()
    ops.rayleigh(float(by_mass), 0.0, float(by_stiffness), 0.0)
    ops.timeSeries("Path", 1, "-dt", DT, "-values", *ground.tolist(), 0.0)
    ops.pattern("UniformExcitation", 1, 1, "-accel", 1)
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("BandSPD")
    ops.test("NormUnbalance", 1e-9 * float(np.max(frame.mass) * np.max(np.abs(ground))), 50)
    ops.algorithm("Newton")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.analysis("Transient")
    peaks = np.zeros(n)
    for _ in range(ground.size - 1):
        if ops.analyze(1, DT) != 0:
            raise RuntimeError("OpenSees did not converge")
        np.maximum(
            peaks, np.abs(np.diff([ops.nodeDisp(node, 1) for node in range(n + 1)])), out=peaks
        )
    return peaks.tolist()


def main() -> None:
    """Compute the results again; with --print, they are printed instead of stored."""
    from obspy import read

    from tdint.assessment.chart.opensees_worker import load

    ops = load()
    ground = np.asarray(
        next(trace.data for trace in read(str(RECORD)) if trace.stats.channel == "HN1"), float
    )
    result: dict[str, Any] = {"version": f"OpenSeesPy, OpenSees {ops.version()}"}
    for name, frame in problems().items():
        result[name] = {"what": frame.what, "peak_drift_m": _peak_drifts(ops, frame, ground)}
    if "--print" in sys.argv:
        print(json.dumps(result))
    else:
        KEPT.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
