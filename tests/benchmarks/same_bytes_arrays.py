"""What calls of the Python interface give, each float to the last bit: for same_bytes.py, by each
tree's own Python."""

import csv
import io
import subprocess
import sys
from dataclasses import fields, is_dataclass

import numpy as np

import tdint

LEFT_OUT = {
    "wall_time",
    "solver_time",
    "time_loop",
    "model",
    "case",
    "record",
    "method",
    "building",
}
"""Fields that hold times or what a call was given."""
MAIN = "from tdint_cli.main import main; main()"
PERIODS = np.geomspace(0.05, 5.0, 40)


def show(name, thing, depth=0):
    """Print what a result holds, a line for each array and number."""
    if isinstance(thing, np.ndarray) and thing.dtype.kind in "fiub":
        flat = np.atleast_1d(thing).astype(np.float64).ravel()
        print(name, thing.shape, thing.dtype, *(value.hex() for value in flat.tolist()))
    elif isinstance(thing, float | int | str | bool | None | np.generic):
        print(name, thing.hex() if isinstance(thing, float) else thing)
    elif isinstance(thing, list | tuple):
        for i, one in enumerate(thing):
            show(f"{name}[{i}]", one, depth)
    elif isinstance(thing, dict):
        for key, one in thing.items():
            show(f"{name}[{key}]", one, depth)
    elif depth < 4 and is_dataclass(thing):
        for field in fields(thing):
            if field.name not in LEFT_OUT:
                show(f"{name}.{field.name}", getattr(thing, field.name), depth + 1)


def tried(name, call):
    """Show what a call gives, or what it is refused with."""
    try:
        show(name, call())
    except Exception as fault:
        print(name, type(fault).__name__, fault)


def model(name):
    return tdint.load_model(f"configs/{name}.yaml")


def record():
    return tdint.read_record("records/near-fault.mseed", component="HN1", units="m/s^2")


def runs(name):
    """All methods on a model."""
    listed = subprocess.run(
        [sys.executable, "-c", MAIN, "methods"], capture_output=True, text=True, check=True
    ).stdout
    names = dict.fromkeys(row["method"] for row in csv.DictReader(io.StringIO(listed)))
    motion, building = record(), model(name)
    for method in [*names, "impulse4:rho_inf=0", "moment4:rho_inf=0.5"]:
        tried(
            method,
            lambda at=method: tdint.run(
                building, motion, method=at, dt=0.01, duration=8.0, history=True
            ),
        )


def spectra():
    motion, both = record(), tdint.read_horizontals("records/near-fault.mseed", units="m/s^2")
    tried("read", lambda: motion)
    tried("processed", lambda: tdint.process(motion, baseline="linear", pad=10.0, highpass=0.1))
    for damping in (0.0, 0.05, 0.2):
        tried(f"spectrum {damping}", lambda at=damping: tdint.spectrum(motion, PERIODS, damping=at))
    tried("rotated", lambda: tdint.rotated_spectrum(both, PERIODS, percentiles=[0, 50, 100]))
    tried("ductility", lambda: tdint.constant_ductility(motion, PERIODS, [2.0, 4.0], damping=0.05))
    tried("strength", lambda: tdint.constant_strength(motion, PERIODS, [0.1, 0.3], damping=0.05))
    tried("drift", lambda: tdint.drift_spectrum(motion, PERIODS, damping=0.05))


def statics():
    for name in (
        "ten-story",
        "ten-story-bilinear",
        "collapse-prone-frame",
        "three-story-concrete",
        "base-isolated",
    ):
        building = model(name)
        tried(f"{name} modes", lambda of=building: tdint.modes(of))
        tried(f"{name} pushover", lambda of=building: tdint.pushover(of, "2%"))
        tried(
            f"{name} cyclic", lambda of=building: tdint.cyclic_test(of, 1, ["1%", "4%"], points=50)
        )
    for method in ("impulse4", "moment4", "newmark-average", "bathe", "houbolt"):
        tried(
            method,
            lambda at=method: tdint.stability(at, np.geomspace(0.01, 10.0, 30), damping=0.05),
        )


def studies():
    frame, motion = model("collapse-prone-frame"), record()
    tried("ida", lambda: tdint.ida(frame, [motion], jobs=1))
    response = tdint.run(frame, motion, check=True, history=True)
    tried("check", lambda: response)
    tried("floors", lambda: tdint.floor_spectra(response, np.array([0.2, 0.5, 1.0])))
    case = tdint.prepare(frame, motion)
    for factor in (0.5, 2.0, 4.0):
        tried(f"scaled {factor}", lambda at=factor: tdint.run_case(case.scaled(at)))


if __name__ == "__main__":
    {"runs": runs, "spectra": spectra, "statics": statics, "studies": studies}[sys.argv[1]](
        *sys.argv[2:]
    )
