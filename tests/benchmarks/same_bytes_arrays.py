"""Print the results of calls of the Python interface, with each float to the last bit.

    python same_bytes_arrays.py runs MODEL | spectra | statics | studies

same_bytes.py runs this program with the Python of each source tree and compares the outputs. The
current directory must contain configs and records.
"""

import csv
import io
import subprocess
import sys
from dataclasses import fields, is_dataclass

import numpy as np

import tdint

IGNORED_FIELDS = {
    "wall_time", "solver_time", "time_loop", "model", "case", "record", "method", "building",
}  # fmt: skip
"""Fields of results that contain times or arguments of the call."""
MAIN = "from tdint_cli.main import main; main()"
PERIODS = np.geomspace(0.05, 5.0, 40)  # s


def print_value(name, value, depth=0):
    """Print a result with a line for each array and number, and recursively for its parts.

    Parameters
    ----------
    name : str
        Name of the value at the start of the line, for example `run.stories`.
    value : object
        Result. Parts of other types than arrays, numbers, texts, containers and data classes are
        ignored.
    depth : int
        Number of data classes that contain the value. From the fourth on, data classes are ignored.
    """
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
        flat = np.atleast_1d(value).astype(np.float64).ravel()
        print(name, value.shape, value.dtype, *(number.hex() for number in flat.tolist()))
    elif isinstance(value, float | int | str | bool | None | np.generic):
        print(name, value.hex() if isinstance(value, float) else value)
    elif isinstance(value, list | tuple):
        for i, item in enumerate(value):
            print_value(f"{name}[{i}]", item, depth)
    elif isinstance(value, dict):
        for key, item in value.items():
            print_value(f"{name}[{key}]", item, depth)
    elif depth < 4 and is_dataclass(value):
        for field in fields(value):
            if field.name not in IGNORED_FIELDS:
                print_value(f"{name}.{field.name}", getattr(value, field.name), depth + 1)


def print_result(name, call):
    """Print the result of a function without arguments, or the exception that it raises."""
    try:
        print_value(name, call())
    except Exception as error:
        print(name, type(error).__name__, error)


def model(name):
    """Return a model of configs."""
    return tdint.load_model(f"configs/{name}.yaml")


def record():
    """Return the ground motion of all calls with one component."""
    return tdint.read_record("records/near-fault.mseed", component="HN1", units="m/s^2")


def runs(name):
    """Print the responses of a model of configs with all methods."""
    table = subprocess.run(
        [sys.executable, "-c", MAIN, "methods"], capture_output=True, text=True, check=True
    ).stdout
    names = dict.fromkeys(row["name"] for row in csv.DictReader(io.StringIO(table)))
    motion, building = record(), model(name)
    for method in [*names, "impulse4:rho_inf=0", "moment4:rho_inf=0.5"]:
        # A default argument fixes the value of the loop variable.
        print_result(
            method,
            lambda at=method: tdint.run(
                building, motion, method=at, dt=0.01, duration=8.0, history=True
            ),
        )


def spectra():
    """Print a processed ground motion, and elastic and inelastic spectra."""
    motion, pair = record(), tdint.read_horizontals("records/near-fault.mseed", units="m/s^2")
    print_result("read", lambda: motion)
    print_result(
        "processed", lambda: tdint.process(motion, baseline="linear", pad=10.0, highpass=0.1)
    )
    for damping in (0.0, 0.05, 0.2):
        print_result(
            f"spectrum {damping}", lambda at=damping: tdint.spectrum(motion, PERIODS, damping=at)
        )
    print_result("rotated", lambda: tdint.rotated_spectrum(pair, PERIODS, percentiles=[0, 50, 100]))
    print_result(
        "ductility", lambda: tdint.constant_ductility(motion, PERIODS, [2.0, 4.0], damping=0.05)
    )
    print_result(
        "strength", lambda: tdint.constant_strength(motion, PERIODS, [0.1, 0.3], damping=0.05)
    )
    print_result("drift", lambda: tdint.drift_spectrum(motion, PERIODS, damping=0.05))


def statics():
    """Print modes, pushover and cyclic tests of models, and stability of methods."""
    for name in (
        "ten-story",
        "ten-story-bilinear",
        "collapse-prone-frame",
        "three-story-concrete",
        "base-isolated",
    ):
        building = model(name)
        print_result(f"{name} modes", lambda at=building: tdint.modes(at))
        print_result(f"{name} pushover", lambda at=building: tdint.pushover(at, "2%"))
        print_result(
            f"{name} cyclic", lambda at=building: tdint.cyclic_test(at, 1, ["1%", "4%"], points=50)
        )
    for method in ("impulse4", "moment4", "newmark-average", "bathe", "houbolt"):
        print_result(
            method,
            lambda at=method: tdint.stability(at, np.geomspace(0.01, 10.0, 30), damping=0.05),
        )


def studies():
    """Print an incremental dynamic analysis, a checked run, floor spectra and scaled cases."""
    frame, motion = model("collapse-prone-frame"), record()
    print_result("ida", lambda: tdint.ida(frame, [motion], jobs=1))
    response = tdint.run(frame, motion, check=True, history=True)
    print_result("check", lambda: response)
    print_result("floors", lambda: tdint.floor_spectra(response, np.array([0.2, 0.5, 1.0])))
    case = tdint.prepare(frame, motion)
    for factor in (0.5, 2.0, 4.0):
        print_result(f"scaled {factor}", lambda at=factor: tdint.run_case(case.scaled(at)))


if __name__ == "__main__":
    {"runs": runs, "spectra": spectra, "statics": statics, "studies": studies}[sys.argv[1]](
        *sys.argv[2:]
    )
