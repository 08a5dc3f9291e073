"""OpenSeesPy in a process of its own: `python -m` with the name of this module reads a building and
a list of runs from standard input and writes their motions and times to standard output.

It knows nothing of tdint but the names of the arrays, so that what is timed is OpenSeesPy's own
analysis loop. Exit code 3: OpenSeesPy is not installed; 4: it is, and cannot be loaded.
"""

from __future__ import annotations

import ctypes
import io
import json
import math
import os
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

NOT_INSTALLED, NOT_LOADED = 3, 4
SECONDS = 60.0
"""Seconds of processor time after which no further run of an integrator is begun; a problem may
have a share of them. The time of one integrator does not count for the others."""

NOT_RUN = "not-run"
"""Outcome of a run that was not begun, because the runs with larger steps took `SECONDS`."""

_BUNDLED = ("libquadmath.so.0", "libgfortran.so.4", "libblas.so.3", "liblapack.so.3")
TOLERANCE = 1e-9  # of what is out of balance, over the largest force of inertia of the reference
ITERATIONS = 50  # of Newton in a step: more than one that converges takes
_GROUND, _PATTERN = 0, 1
_KINDS = ("disp", "vel", "accel")
_BESIDE = 100_000  # stories at most
_FOREVER = 1e9  # s, beyond the end of any run

Content = dict[str, Any]


def main() -> int:
    """Do all runs."""
    if find_spec("openseespy") is None:
        return NOT_INSTALLED
    # What OpenSees prints on standard output must not get into the answer.
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    try:
        ops = load()
    except (ImportError, OSError, RuntimeError) as error:
        sys.stderr.write(f"{error}\n")
        return NOT_LOADED
    with np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False) as content:
        problem = dict(content)
    runs = json.loads(str(problem["runs"]))
    results: Content = {}
    spent = {json.dumps(run["integrator"]): 0.0 for run in runs}
    for number, run in enumerate(runs):
        integrator = json.dumps(run["integrator"])
        if spent[integrator] > SECONDS * float(problem["share"]):
            results[f"{number}_outcome"] = np.array(NOT_RUN)
            continue
        began = time.process_time()
        for name, value in _run(ops, problem, run).items():
            results[f"{number}_{name}"] = value
        spent[integrator] += time.process_time() - began
    stream = io.BytesIO()
    np.savez(stream, **results)
    answer.write(stream.getvalue())
    answer.close()
    return 0


def load() -> Any:
    """OpenSeesPy; the libraries that come along with it first, which the system may lack."""
    spec = find_spec("openseespylinux")
    if spec is not None and spec.origin:
        for name in _BUNDLED:
            library = Path(spec.origin).parent / "lib" / name
            if library.exists():
                ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    import openseespy.opensees as ops

    return ops


def _run(ops: Any, problem: Content, run: Content) -> Content:
    """One integrator with one step: its motion from a march step by step, its times from marches in
    one call."""
    seconds = getattr(time, run["clock"])
    _build(ops, problem, run)
    motion = _march(ops, problem, run)
    times = []
    for _ in range(run["repeats"] if motion["outcome"] == "done" else 0):
        _build(ops, problem, run)
        begin = seconds()
        code = ops.analyze(run["steps"], run["h"])
        times.append(seconds() - begin)
        if code != 0:
            motion["outcome"] = np.array("not-converged")
    ops.wipe()
    return motion | {"times": np.array(times)}


def _build(ops: Any, problem: Content, run: Content) -> None:
    """The chain of masses, its load, its start, and the analysis."""
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    n, materials = problem["mass"].size, json.loads(str(problem["materials"]))
    for node in range(n + 1):
        ops.node(node, 0.0)
    ops.fix(_GROUND, 1)
    for i in range(n):
        ops.mass(i + 1, float(problem["mass"][i]))
        # A story is a spring, and beside it what Rayleigh damping does not have: a dashpot,
        # P-delta.
        beside = (("Viscous", problem["dashpot"][i], 1.0), ("Elastic", problem["geometric"][i]))
        for j, (kind, *numbers) in enumerate((materials[i], *beside)):
            if j == 0 or numbers[0] != 0.0:
                tag = i + 1 + j * _BESIDE
                ops.uniaxialMaterial(
                    kind, tag, *(word if isinstance(word, str) else float(word) for word in numbers)
                )
                ops.element(
                    "zeroLength", tag, i, i + 1, "-mat", tag, "-dir", 1, "-doRayleigh", int(j == 0)
                )
    ops.rayleigh(float(problem["alpha_mass"]), 0.0, float(problem["beta_stiffness"]), 0.0)
    _load_floors(ops, problem)
    if problem["ground"].size > 1:
        values = [*problem["ground"].tolist(), 0.0]
        ops.timeSeries("Path", 1, "-dt", float(problem["interval"]), "-values", *values)
        ops.pattern("UniformExcitation", _PATTERN, 1, "-accel", 1)
    for set_node, name in ((ops.setNodeDisp, "u"), (ops.setNodeVel, "v"), (ops.setNodeAccel, "a")):
        for i, value in enumerate(problem[f"{name}_start"]):
            if value != 0.0:
                set_node(i + 1, 1, float(value), "-commit")
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("BandSPD")
    ops.test("NormUnbalance", TOLERANCE * float(problem["largest"]), ITERATIONS)
    # A building whose matrix never changes is factorized once.
    ops.algorithm(*("Linear", "-factorOnce") if problem["one_solve"] else ("Newton",))
    ops.integrator(*run["integrator"])
    ops.analysis("Transient")


def _load_floors(ops: Any, problem: Content) -> None:
    """Forces cosine cos(omega t) + sine sin(omega t), a pattern per term."""
    tag = 2
    for floor, cosine, sine, omega in problem["forces"]:
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


def _march(ops: Any, problem: Content, run: Content) -> Content:
    """Step by step: the motion every so many steps, the peaks at all steps, the iterations.

    Accelerations are those of equilibrium at the end of each step, from OpenSees' displacements,
    velocities and story forces, as ours are. Its own accelerations differ from them where the
    integrator weights the equation of motion (HHT, generalized-alpha). Total shears are the inertia
    forces of the masses above, without forces on floors.
    """
    n = problem["mass"].size
    iterations = 0
    with TemporaryDirectory() as folder:
        # OpenSees itself writes what nodes do: asked for in Python this takes longer than the
        # steps.
        for name in _KINDS:
            ops.recorder(
                "Node", "-binary", f"{folder}/{name}", "-node", *range(1, n + 1), "-dof", 1, name
            )
        stories = range(1, n + 1)
        ops.recorder(
            "Element", "-binary", f"{folder}/force", "-ele", *stories, "material", "1", "stress"
        )
        code = done = 0
        while done < run["steps"] and (code := ops.analyze(1, run["h"])) == 0:
            iterations += 1 if problem["one_solve"] else ops.testIter()
            done += 1
        ops.wipe()  # and the files are closed
        if code != 0:
            return {"outcome": np.array("not-converged")}
        row = np.dtype(
            [("nodes", float, (n,)), ("end", "V1")]
        )  # and the end of a line, of binary ones, too
        rows = {name: np.fromfile(f"{folder}/{name}", row)["nodes"] for name in _KINDS}
        story_force = np.fromfile(f"{folder}/force", row)["nodes"]
    starts = (problem["u_start"], problem["v_start"], problem["a_start"])
    u, v, a = (
        np.vstack([start, values]) for start, values in zip(starts, rows.values(), strict=True)
    )
    if not np.all(np.isfinite(u)):
        return {"outcome": np.array("diverged")}
    times, size = run["h"] * np.arange(run["steps"] + 1), problem["ground"].size
    ground = np.interp(times, problem["interval"] * np.arange(size + 1), [*problem["ground"], 0.0])
    a[1:] = _equilibrium(problem, times[1:], u[1:], v[1:], story_force) - ground[1:, None]
    absolute = a + ground[:, None]
    shear = np.cumsum((problem["mass"] * absolute)[:, ::-1], axis=1)[:, ::-1]
    shear *= math.nan if problem["forces"].size else 1.0
    peaks = (
        np.max(np.abs(values), axis=0)
        for values in (np.diff(u, axis=1, prepend=0.0), absolute, shear)
    )
    return {
        "outcome": np.array("done"),
        "motion": np.array([u, v, a])[:, :: run["per_sample"]],
        **dict(
            zip(
                ("peak_drift", "peak_absolute_acceleration", "peak_total_shear"), peaks, strict=True
            )
        ),
        "iterations": np.array(iterations),
    }


def _equilibrium(problem: Content, times: Any, u: Any, v: Any, story_force: Any) -> Any:
    """Return the absolute accelerations M^-1 (p - C v - f) at the ends of the steps.

    Parameters
    ----------
    problem : dict
        Arrays of the problem.
    times : ndarray
        Times, s; shape (steps,).
    u, v : ndarray
        Displacements (m) and velocities (m/s) relative to the ground; shape (steps, floors).
    story_force : ndarray
        Forces of the materials of the stories, N; shape (steps, floors).

    Returns
    -------
    ndarray
        m/s^2; shape (steps, floors).
    """
    force = -float(problem["alpha_mass"]) * problem["mass"] * v
    for floor, cosine, sine, omega in problem["forces"]:
        force[:, int(floor)] += cosine * np.cos(omega * times) + sine * np.sin(omega * times)
    drift, rate = (np.diff(values, axis=1, prepend=0.0) for values in (u, v))
    shear = story_force + problem["geometric"] * drift + problem["story_damper"] * rate
    force -= shear - np.hstack([shear[:, 1:], np.zeros((times.size, 1))])
    return force / problem["mass"]


if __name__ == "__main__":
    sys.exit(main())
