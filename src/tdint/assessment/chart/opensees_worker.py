"""Run OpenSeesPy in a separate process.

`python -m` with the name of the module reads a building and a list of runs from standard input, and
writes their motions and times to standard output. Only the analysis loop of OpenSeesPy is timed.
Exit codes: 3 if OpenSeesPy is not installed, 4 if it is installed but cannot be loaded.
"""

from __future__ import annotations

import ctypes
import math
import os
import pickle
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from tdint.system import die_with_parent

NOT_INSTALLED, NOT_LOADED = 3, 4
SECONDS = 60.0
"""Processor time after which no further run of an integrator is started, s. The runs of a problem
can be limited to a fraction of this time. The limit applies separately to each integrator."""

NOT_RUN = "not-run"
"""Outcome of a run that was not started, because runs with larger steps used `SECONDS`."""

# Libraries in the package openseespylinux that OpenSees needs.
_BUNDLED = ("libquadmath.so.0", "libgfortran.so.4", "libblas.so.3", "liblapack.so.3")
TOLERANCE = 1e-9  # residual divided by the maximum inertia force of the reference solution
ITERATIONS = 50  # maximum Newton iterations per step; converging steps need fewer iterations
_GROUND, _PATTERN = 0, 1  # node of the ground, and tag of the load pattern of the ground motion
_RECORDED = ("disp", "vel", "accel")  # responses of the nodes that OpenSees writes to files
# Difference between the tags of parallel elements of one story; more than the number of stories
_TAG_OFFSET = 100_000
_FOREVER = 1e9  # s; later than the end of any run

Content = dict[str, Any]


def main() -> int:
    """Execute the runs of standard input, write their results, and return the exit code.

    A run is not started if earlier runs of its integrator used the processor time of the problem.
    The results are a list with an entry for each run; an entry contains arrays by name.

    The argument of the process is the ID of the process that started it. On Linux, this process is
    killed when that process ends.
    """
    if len(sys.argv) > 1:
        die_with_parent(int(sys.argv[1]))
    if find_spec("openseespy") is None:
        return NOT_INSTALLED
    # Messages that OpenSees prints on standard output must not be mixed with the results.
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    try:
        ops = load()
    except (ImportError, OSError, RuntimeError) as error:
        sys.stderr.write(f"{error}\n")
        return NOT_LOADED
    problem = pickle.load(sys.stdin.buffer)
    results: list[Content] = []
    seconds_used = {run["integrator"]: 0.0 for run in problem["runs"]}
    for run in problem["runs"]:
        if seconds_used[run["integrator"]] > SECONDS * problem["share"]:
            results.append({"outcome": NOT_RUN})
            continue
        start_time = time.process_time()
        results.append(_run(ops, problem, run))
        seconds_used[run["integrator"]] += time.process_time() - start_time
    pickle.dump(results, output)
    output.close()
    return 0


def load() -> Any:
    """Load OpenSeesPy after its bundled libraries, which may be missing on the system."""
    library_package = find_spec("openseespylinux")
    if library_package is not None and library_package.origin:
        for name in _BUNDLED:
            library = Path(library_package.origin).parent / "lib" / name
            if library.exists():
                ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    import openseespy.opensees as ops

    return ops


def _run(ops: Any, problem: Content, run: Content) -> Content:
    """Run one integrator with one time step, and return its results by name.

    The motion is recorded in a separate run with a call of OpenSees for each step. The times (s)
    are measured in runs with a single call for all steps. They are missing if the first run fails.
    """
    clock_seconds = getattr(time, run["clock"])
    _build(ops, problem, run)
    motion = _integrate(ops, problem, run)
    times = []
    for _ in range(run["repeats"] if motion["outcome"] == "done" else 0):
        _build(ops, problem, run)
        start_time = clock_seconds()
        error_code = ops.analyze(run["steps"], run["h"])
        times.append(clock_seconds() - start_time)
        if error_code != 0:
            motion["outcome"] = "not-converged"
    ops.wipe()
    return motion | {"times": times}


def _build(ops: Any, problem: Content, run: Content) -> None:
    """Define the chain of masses, the loads, the initial state, and the analysis in OpenSees.

    Node 0 is the ground, and node i + 1 is floor i. Element i + 1 is the hysteresis model of story
    i; its parallel elements have the same tag plus `_TAG_OFFSET` or twice that number.
    """
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    story_count, materials = problem["mass"].size, problem["materials"]
    for node in range(story_count + 1):
        ops.node(node, 0.0)
    ops.fix(_GROUND, 1)
    for i in range(story_count):
        ops.mass(i + 1, float(problem["mass"][i]))
        # A story is the hysteresis model in parallel with a dashpot and with P-delta, which do not
        # contribute to Rayleigh damping.
        parallel_terms = (
            ("Viscous", problem["dashpot"][i], 1.0),
            ("Elastic", problem["geometric"][i]),
        )
        for position, (material, *values) in enumerate((materials[i], *parallel_terms)):
            # Each term needs a separate element; a term with a coefficient of 0 is omitted.
            if position == 0 or values[0] != 0.0:
                tag = i + 1 + position * _TAG_OFFSET
                arguments = (v if isinstance(v, str) else float(v) for v in values)
                ops.uniaxialMaterial(material, tag, *arguments)
                ops.element(
                    "zeroLength",
                    tag,
                    i,
                    i + 1,
                    "-mat",
                    tag,
                    "-dir",
                    1,
                    "-doRayleigh",
                    int(position == 0),
                )
    ops.rayleigh(problem["alpha_mass"], 0.0, problem["beta_stiffness"], 0.0)
    _load_floors(ops, problem)
    if problem["ground"].size > 1:
        values = [*problem["ground"].tolist(), 0.0]
        ops.timeSeries("Path", 1, "-dt", problem["interval"], "-values", *values)
        ops.pattern("UniformExcitation", _PATTERN, 1, "-accel", 1)
    for set_node, name in ((ops.setNodeDisp, "u"), (ops.setNodeVel, "v"), (ops.setNodeAccel, "a")):
        for i, value in enumerate(problem[f"{name}_start"]):
            if value != 0.0:
                set_node(i + 1, 1, float(value), "-commit")
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("BandSPD")
    ops.test("NormUnbalance", TOLERANCE * problem["largest"], ITERATIONS)
    # A linear building has a constant matrix, which needs to be factorized only one time.
    ops.algorithm(*("Linear", "-factorOnce") if problem["one_solve"] else ("Newton",))
    ops.integrator(*run["integrator"])
    ops.analysis("Transient")


def _load_floors(ops: Any, problem: Content) -> None:
    """Define the harmonic forces of the problem in OpenSees.

    OpenSees' series Trig is factor sin(omega t + shift). A cosine is therefore a sine with the
    shift pi / 2. A force with omega = 0 is the constant factor sin(shift), because Trig needs a
    period.
    """
    tag = 2  # the ground motion has the tag 1
    # The remaining columns of a row belong to forces from tables, which OpenSees does not run.
    for floor, cosine, sine, omega, *_ in problem["forces"]:
        for factor, shift in ((cosine, 0.5 * math.pi), (sine, 0.0)):
            if factor == 0.0:
                continue
            if omega == 0.0:
                ops.timeSeries("Constant", tag, "-factor", float(factor) * math.sin(shift))
            else:
                period = 2.0 * math.pi / float(omega)
                ops.timeSeries(
                    "Trig", tag, 0.0, _FOREVER, period, "-factor", float(factor), "-shift", shift
                )
            ops.pattern("Plain", tag, tag)
            ops.load(int(floor) + 1, 1.0)
            tag += 1


def _integrate(ops: Any, problem: Content, run: Content) -> Content:
    """Integrate the model that `_build` defined step by step, and return the results by name.

    Accelerations satisfy equilibrium at the end of each step, as the accelerations of tdint do.
    They are computed from OpenSees' displacements, velocities and story forces. OpenSees' own
    accelerations differ if the integrator weights the equation of motion (HHT, generalized-alpha).
    Total shears are the inertia forces of the masses above; they are nan with forces on floors.
    `motion` is relative to the ground, at the samples; peaks are the maxima over all steps.
    """
    node_values, story_force, iterations = _run_steps(ops, problem, run)
    if not node_values:
        return {"outcome": "not-converged"}
    initial_state = (problem["u_start"], problem["v_start"], problem["a_start"])
    u, v, a = (
        np.vstack([start, values]) for start, values in zip(initial_state, node_values, strict=True)
    )
    if not np.all(np.isfinite(u)):
        return {"outcome": "diverged"}
    # The ground acceleration decreases linearly to 0 after the last sample.
    times, ground_samples = run["h"] * np.arange(run["steps"] + 1), problem["ground"].size
    ground_acceleration = np.interp(
        times, problem["interval"] * np.arange(ground_samples + 1), [*problem["ground"], 0.0]
    )
    a[1:] = (
        _equilibrium(problem, times[1:], u[1:], v[1:], story_force) - ground_acceleration[1:, None]
    )
    absolute = a + ground_acceleration[:, None]
    # The shear of a story is the sum of mass times absolute acceleration over all floors above:
    # reverse the floors, sum, and reverse the sums.
    shear = np.cumsum((problem["mass"] * absolute)[:, ::-1], axis=1)[:, ::-1]
    shear *= math.nan if problem["forces"].size else 1.0
    return {
        "outcome": "done",
        "motion": np.array([u, v, a])[:, :: run["per_sample"]],
        "peak_drift": np.max(np.abs(np.diff(u, axis=1, prepend=0.0)), axis=0),
        "peak_absolute_acceleration": np.max(np.abs(absolute), axis=0),
        "peak_total_shear": np.max(np.abs(shear), axis=0),
        "iterations": iterations,
    }


def _run_steps(ops: Any, problem: Content, run: Content) -> tuple[list[Any], Any, int]:
    """Run the time steps; return displacements, velocities and accelerations (empty if a step did
    not converge), the forces of the materials of the stories (N), each of shape (steps, floors),
    and the number of iterations.

    The model in OpenSees is deleted afterwards. OpenSees writes the motion of the nodes to files,
    because queries from Python need more time than the steps.
    """
    floors = problem["mass"].size
    stories = range(1, floors + 1)
    iterations = 0
    with TemporaryDirectory() as directory:
        for name in _RECORDED:
            ops.recorder(
                "Node", "-binary", f"{directory}/{name}", "-node", *stories, "-dof", 1, name
            )
        ops.recorder(
            "Element", "-binary", f"{directory}/force", "-ele", *stories, "material", "1", "stress"
        )
        error_code = completed_steps = 0
        while completed_steps < run["steps"] and (error_code := ops.analyze(1, run["h"])) == 0:
            iterations += 1 if problem["one_solve"] else ops.testIter()
            completed_steps += 1
        ops.wipe()  # closes the files
        if error_code != 0:
            return [], None, iterations
        # OpenSees writes one byte after each row, also in binary files.
        row_type = np.dtype([("nodes", float, (floors,)), ("end", "V1")])
        node_values = [np.fromfile(f"{directory}/{name}", row_type)["nodes"] for name in _RECORDED]
        story_force = np.fromfile(f"{directory}/force", row_type)["nodes"]
    return node_values, story_force, iterations


def _equilibrium(problem: Content, times: Any, u: Any, v: Any, story_force: Any) -> Any:
    """Return the absolute accelerations M^-1 (p - C v - f) at the end of each step, m/s^2, shape
    (steps, floors).

    `story_force` contains the forces of the materials of the stories; f includes P-delta.
    """
    # Damping in proportion to the mass acts on the floors, all other damping on the stories.
    force = -problem["alpha_mass"] * problem["mass"] * v
    for floor, cosine, sine, omega, *_ in problem["forces"]:
        force[:, int(floor)] += cosine * np.cos(omega * times) + sine * np.sin(omega * times)
    drift, drift_rate = (np.diff(values, axis=1, prepend=0.0) for values in (u, v))
    shear = story_force + problem["geometric"] * drift + problem["story_damper"] * drift_rate
    # The story below pulls a floor back, the story above pulls it forward.
    force -= shear - np.hstack([shear[:, 1:], np.zeros((times.size, 1))])
    return force / problem["mass"]


if __name__ == "__main__":
    sys.exit(main())
