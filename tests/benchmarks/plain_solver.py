"""Reference solver for shear buildings that uses no code of tdint.

The solver uses central differences (Newmark 1959 with beta = 0 and gamma = 1/2) with thousands of
steps per sampling interval. It supports piecewise linear laws, tanh, polynomials, power-law
dashpots, P-delta, forces on floors, and Rayleigh damping given by two coefficients. Its order is 2
also at kinks of the laws, because a law follows its branches exactly from one drift to the next.
"""

import math

import numpy as np
from numba import njit

KINDS = ("linear", "bilinear", "peak-oriented", "gap", "tanh", "polynomial")
"""Types of laws; the index is the number of a law in the compiled functions."""
GRAVITY = 9.80665  # m/s^2
PEAKS = (
    "peak_drift",
    "peak_absolute_acceleration",
    "peak_total_shear",
    "peak_damper_force",
    "residual_drift",
)
"""Results, in the order of the rows of `integrate`."""


@njit
def spring(kind, p, s, d):
    """Return the force of a story at drift d, N, and update the state of the story.

    Parameters
    ----------
    kind : int
        Index of the law in `KINDS`.
    p : ndarray, shape (4,)
        Initial stiffness and up to three other parameters, in the order of the model file.
    s : ndarray, shape (8,)
        State, changed in place: drift, m; force, N; drift and force of the farthest point on the
        positive side and on the negative side; branch of a peak-oriented law (0 elastic, +-1
        yielding, +-2 reloading, +-3 unloading; the sign is the direction of loading); drift at
        which unloading started, m.
    d : float
        New drift, m.
    """
    k = p[0]
    if kind == 1:  # bilinear: a linear spring parallel to an elastoplastic spring
        z = s[1] - p[2] * k * s[0] + (1.0 - p[2]) * k * (d - s[0])
        limit = (1.0 - p[2]) * p[1]
        s[1] = p[2] * k * d + min(max(z, -limit), limit)
        s[0] = d
        return s[1]
    if kind == 3:  # gap: the stop stiffness is added beyond the gap
        return k * d + math.copysign(p[2] * max(abs(d) - p[1], 0.0), d)
    if kind == 4:
        return p[1] * math.tanh(k * d / p[1])
    if kind == 5:
        return p[1] * d + p[2] * d * d + p[3] * d * d * d
    if kind == 0:
        return k * d
    # Peak-oriented: follow the branches from the old drift to d. Each pass of the loop ends at the
    # end of a branch or at d; 20 passes exceed the number of branches between two drifts.
    strength, hardening, exponent = p[1], p[2], p[3]
    for _ in range(20):
        distance = d - s[0]
        if distance == 0.0:
            break
        side = 1.0 if distance > 0.0 else -1.0  # direction of the drift
        branch = s[6]
        far, peak = (s[2], s[3]) if side > 0.0 else (s[4], s[5])
        if branch == 0.0:  # elastic, up to the yield point
            slope, end = k, side * strength / k
        elif branch == side:  # continues to yield
            slope, end = hardening * k, side * math.inf
        elif branch == 2.0 * side:  # reloads towards the farthest point
            slope, end = (peak - s[1]) / (far - s[0]), far
        else:
            if abs(branch) != 3.0:  # reversal of the drift: unload from this point
                if branch == -side:  # the story was yielding: this is the new farthest point
                    if side > 0.0:
                        s[4], s[5] = s[0], s[1]
                    else:
                        s[2], s[3] = s[0], s[1]
                s[6], s[7] = 3.0 * -side, s[0]
                branch = s[6]
            loaded_side = branch / 3.0  # side on which the story was loaded before
            far_drift = abs(s[2] if loaded_side > 0.0 else s[4])
            inverse_ductility = strength / (k * far_drift)
            # Unloading stiffness k (yield drift / farthest drift)^exponent, with the lower bounds
            # of the law in tdint.
            slope = k * max(
                inverse_ductility**exponent,
                hardening + (1.0 - hardening) * inverse_ductility,
                min(hardening / (1.0 - 0.5 * exponent), 1.0),
            )
            # Unloading ends at zero force; loading again ends at the drift of the reversal.
            end = s[0] - s[1] / slope if side == -loaded_side else s[7]
        if (end - d) * side > 0.0:  # d is on this branch
            s[1] += slope * (d - s[0])
            s[0] = d
            break
        s[1] += slope * (end - s[0])
        s[0] = end
        if branch == 0.0:
            s[6] = side
        elif abs(branch) == 3.0:
            if side == -branch / 3.0:
                s[1] = 0.0
            far = s[2] if side > 0.0 else s[4]
            # Reload towards the farthest point, or yield if it has been reached.
            s[6] = 2.0 * side if side * (far - s[0]) > 1e-12 * abs(far) else side
        else:
            s[6] = side
    return s[1]


@njit
def accelerations(mass, device, shear, dampers, alpha, beta_k, v, load, a, total):
    """Compute the accelerations of all floors from the equation of motion.

    Parameters
    ----------
    mass : ndarray, shape (n,)
        Masses, kg.
    device : ndarray, shape (n,)
        Result: forces of the dashpots of the stories, N.
    shear : ndarray, shape (n,)
        Forces of the laws with P-delta, N.
    dampers : ndarray, shape (n, 4)
        Linear coefficient, coefficient and exponent of a power law, and the drift rate (m/s) below
        which the power law is nearly linear.
    alpha : float
        Coefficient of mass-proportional damping, 1/s.
    beta_k : ndarray, shape (n,)
        Coefficient of stiffness-proportional damping times the initial stiffness, N s/m.
    v, load : ndarray, shape (n,)
        Velocities relative to the ground, m/s, and external forces including -mass times ground
        acceleration, N.
    a : ndarray, shape (n,)
        Result: accelerations relative to the ground, m/s^2.
    total : ndarray, shape (n,)
        Result: sum of all story forces, N.
    """
    n = len(mass)
    for i in range(n):
        rate = v[i] - (v[i - 1] if i else 0.0)
        linear, power, exponent, linear_below = dampers[i]
        device[i] = linear * rate
        if power != 0.0:
            # power |rate|^exponent sign(rate), regularized near rate = 0
            squared_rate = rate * rate + linear_below * linear_below
            device[i] += power * rate * squared_rate ** (0.5 * (exponent - 1.0))
        total[i] = shear[i] + device[i] + beta_k[i] * rate
    for i in range(n):
        above = total[i + 1] if i + 1 < n else 0.0
        a[i] = (load[i] - total[i] + above) / mass[i] - alpha * v[i]


@njit
def integrate(
    kinds,
    parameters,
    mass,
    geometric,
    dampers,
    alpha,
    beta_k,
    start,
    forces,
    ground,
    dt,
    parts,
    samples,
):
    """Integrate a building and return its peaks, shape (5, n): rows of `PEAKS`, columns of stories.

    Parameters
    ----------
    kinds, parameters : ndarray
        Index in `KINDS` and parameters of the law of each story; see `spring`.
    mass : ndarray, shape (n,)
        Masses, kg.
    geometric : ndarray, shape (n,)
        P-delta: weight above the story divided by its height, N/m.
    dampers, alpha, beta_k
        See `accelerations`.
    start : ndarray, shape (2, n)
        Initial displacements, m, and velocities, m/s.
    forces : ndarray, shape (forces, 3)
        Index of the floor, amplitude, N, and circular frequency, rad/s, of sine forces.
    ground : ndarray
        Ground acceleration at the samples, m/s^2, with a zero at the end.
    dt : float
        Sampling interval, s.
    parts, samples : int
        Time steps per sampling interval, and number of sampling intervals.
    """
    n = len(mass)
    h = dt / parts
    state = np.zeros((n, 8))
    for i in range(n):
        k, strength = parameters[i, 0], parameters[i, 1]
        if kinds[i] == 2:  # the first farthest points of a peak-oriented law are its yield points
            state[i, 2], state[i, 3], state[i, 4], state[i, 5] = (
                strength / k,
                strength,
                -strength / k,
                -strength,
            )
    u, v, a = start[0].copy(), start[1].copy(), np.zeros(n)
    shear, device, total, load = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    half, peaks = np.zeros(n), np.zeros((5, n))
    for step in range(samples * parts + 1):
        if step:
            for i in range(n):
                half[i] = v[i] + 0.5 * h * a[i]
                u[i] += h * half[i]
                v[i] = half[i] + 0.5 * h * a[i]
        t = step * h
        sample = min(step // parts, len(ground) - 2)
        fraction = step / parts - sample
        ground_now = ground[sample] * (1.0 - fraction) + ground[sample + 1] * fraction
        for i in range(n):
            d = u[i] - (u[i - 1] if i else 0.0)
            shear[i] = spring(kinds[i], parameters[i], state[i], d) - geometric[i] * d
            load[i] = -mass[i] * ground_now
        for j in range(len(forces)):
            load[int(forces[j, 0])] += forces[j, 1] * math.sin(forces[j, 2] * t)
        # The damping forces depend on the velocities at the end of the step, and these on the
        # accelerations. For such a short step, the iteration converges to rounding in two passes.
        for _ in range(3 if step else 1):
            accelerations(mass, device, shear, dampers, alpha, beta_k, v, load, a, total)
            if step:
                for i in range(n):
                    v[i] = half[i] + 0.5 * h * a[i]
        # Total shear of a story: inertia forces and loads of all floors above it.
        total_shear = 0.0
        for i in range(n - 1, -1, -1):
            d = u[i] - (u[i - 1] if i else 0.0)
            absolute = a[i] + ground_now
            total_shear += mass[i] * absolute - load[i] - mass[i] * ground_now
            peaks[0, i] = max(peaks[0, i], abs(d))
            peaks[1, i] = max(peaks[1, i], abs(absolute))
            peaks[2, i] = max(peaks[2, i], abs(total_shear))
            peaks[3, i] = max(peaks[3, i], abs(device[i]))
            peaks[4, i] = d
    return peaks


def peaks(model, record, parts, duration):
    """Return the peaks of a model by name (`PEAKS`), arrays over the stories.

    Parameters
    ----------
    model : dict
        Content of a model file in SI units. `damping` is missing, or Rayleigh damping with two
        coefficients.
    record : Record
        Ground motion.
    parts : int
        Time steps per sampling interval.
    duration : float
        Duration, s, a multiple of the sampling interval.
    """
    stories = model["stories"]
    mass = np.array([story["mass"] for story in stories])
    kinds = np.zeros(len(mass), np.int64)
    parameters, dampers = np.zeros((len(mass), 4)), np.zeros((len(mass), 4))
    for i, story in enumerate(stories):
        law = story.get("law", {"type": "linear"})
        kinds[i] = KINDS.index(law["type"])
        values = {
            "linear": (),
            "bilinear": (law.get("yield_force"), law.get("hardening")),
            "peak-oriented": (law.get("yield_force"), law.get("hardening"), law.get("unloading")),
            "gap": (law.get("gap"), law.get("stop_stiffness")),
            "tanh": (law.get("strength"),),
            "polynomial": law.get("coefficients"),
        }[law["type"]]
        parameters[i, 0] = story.get("stiffness", 0.0)
        parameters[i, 1 : 1 + len(values)] = values
        dashpot = story.get("dashpot", 0.0)
        if isinstance(dashpot, dict):
            dampers[i, 1:] = dashpot["coefficient"], dashpot["exponent"], dashpot["linear_below"]
        else:
            dampers[i, 0] = dashpot
    # The initial stiffness of a polynomial is its first coefficient.
    initial = np.where(kinds == KINDS.index("polynomial"), parameters[:, 1], parameters[:, 0])
    heights = np.array([story["height"] for story in stories])
    geometric = GRAVITY * np.cumsum(mass[::-1])[::-1] / heights * bool(model.get("p_delta"))
    rayleigh = model.get("damping", {}).get("rayleigh", {"mass": 0.0, "stiffness": 0.0})
    start = np.zeros((2, len(mass)))
    for row, name in enumerate(("displacement", "velocity")):
        start[row] = model.get("initial", {}).get(name, 0.0)
    loads = [
        (force["floor"] - 1, force["amplitude"], force["omega"])
        for force in model.get("excitation", {}).get("forces", ())
    ]
    results = integrate(
        *(
            kinds,
            parameters,
            mass,
            geometric,
            dampers,
            rayleigh["mass"],
            rayleigh["stiffness"] * initial,
            start,
        ),
        *(np.array(loads).reshape(-1, 3), np.append(record.acceleration, 0.0), record.dt, parts),
        round(duration / record.dt),
    )
    return dict(zip(PEAKS, results, strict=True))
