"""Shear buildings by central differences with thousands of steps in a sample, and nothing of tdint:
no law, no matrix, no step of it. A second opinion of what is true, for laws of straight branches,
tanh, polynomials, dashpots of powers, P-delta, forces on floors and Rayleigh damping by two
coefficients. Newmark (1959) with beta 0, gamma 1/2; of order 2, kinks of the laws included, since a
law goes along its branches exactly from drift to drift."""

import math

import numpy as np
from numba import njit

KINDS = ("linear", "bilinear", "peak-oriented", "gap", "tanh", "polynomial")
GRAVITY = 9.80665
PEAKS = (
    "peak_drift",
    "peak_absolute_acceleration",
    "peak_total_shear",
    "peak_damper_force",
    "residual_drift",
)


@njit
def spring(kind, p, s, d):
    """Return the force of a story at drift d, N.

    The state `s` contains the drift, the force, the farthest points on both sides (drift, force),
    and the branch of a peak-oriented law (0 elastic, +-1 yielding, +-2 reloading, +-3 unloading).
    """
    k = p[0]
    if kind == 1:  # bilinear: an elastic part beside a perfectly plastic one
        z = s[1] - p[2] * k * s[0] + (1.0 - p[2]) * k * (d - s[0])
        most = (1.0 - p[2]) * p[1]
        s[1] = p[2] * k * d + min(max(z, -most), most)
        s[0] = d
        return s[1]
    if kind == 3:
        return k * d + math.copysign(p[2] * max(abs(d) - p[1], 0.0), d)
    if kind == 4:
        return p[1] * math.tanh(k * d / p[1])
    if kind == 5:
        return p[1] * d + p[2] * d * d + p[3] * d * d * d
    if kind == 0:
        return k * d
    # Peak-oriented: from corner to corner of its branches on the way to d.
    strength, hardening, exponent = p[1], p[2], p[3]
    for _ in range(20):
        way = d - s[0]
        if way == 0.0:
            break
        side = 1.0 if way > 0.0 else -1.0
        branch = s[6]
        far, peak = (s[2], s[3]) if side > 0.0 else (s[4], s[5])
        if branch == 0.0:  # elastic, up to the yield point
            slope, end = k, side * strength / k
        elif branch == side:  # yields on
            slope, end = hardening * k, side * math.inf
        elif branch == 2.0 * side:  # reloads towards the farthest point
            slope, end = (peak - s[1]) / (far - s[0]), far
        else:
            if abs(branch) != 3.0:  # a turn: unloads from here, to the force zero
                if branch == -side:
                    if side > 0.0:
                        s[4], s[5] = s[0], s[1]
                    else:
                        s[2], s[3] = s[0], s[1]
                s[6], s[7] = 3.0 * -side, s[0]
                branch = s[6]
            of_side = branch / 3.0
            far_drift = abs(s[2] if of_side > 0.0 else s[4])
            part = strength / (k * far_drift)
            slope = k * max(
                part**exponent,
                hardening + (1.0 - hardening) * part,
                min(hardening / (1.0 - 0.5 * exponent), 1.0),
            )
            # Down to zero force; up again to where it was left.
            end = s[0] - s[1] / slope if side == -of_side else s[7]
        if (end - d) * side > 0.0:
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
            s[6] = 2.0 * side if side * (far - s[0]) > 1e-12 * abs(far) else side
        else:
            s[6] = side
    return s[1]


@njit
def accelerations(mass, heavy, shear, dampers, alpha, beta_k, v, load, a, total):
    """Of all floors relative to the ground, less that of the ground; and the total shears."""
    n = len(mass)
    for i in range(n):
        rate = v[i] - (v[i - 1] if i else 0.0)
        linear, power, exponent, below = dampers[i]
        device = linear * rate
        if power != 0.0:
            device += power * rate * (rate * rate + below * below) ** (0.5 * (exponent - 1.0))
        heavy[i] = device  # kept for the peaks
        total[i] = shear[i] + device + beta_k[i] * rate
    for i in range(n):
        above = total[i + 1] if i + 1 < n else 0.0
        a[i] = (load[i] - total[i] + above) / mass[i] - alpha * v[i]


@njit
def march(
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
    """Peaks over the stories: rows of `PEAKS`."""
    n = len(mass)
    h = dt / parts
    state = np.zeros((n, 8))
    for i in range(n):
        k, strength = parameters[i, 0], parameters[i, 1]
        if kinds[i] == 2:
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
        part = step / parts - sample
        shaken = ground[sample] * (1.0 - part) + ground[sample + 1] * part
        for i in range(n):
            d = u[i] - (u[i - 1] if i else 0.0)
            shear[i] = spring(kinds[i], parameters[i], state[i], d) - geometric[i] * d
            load[i] = -mass[i] * shaken
        for j in range(len(forces)):
            load[int(forces[j, 0])] += forces[j, 1] * math.sin(forces[j, 2] * t)
        # The rates at the end of the step hang on the accelerations there: twice is to rounding for
        # so small a step.
        for _ in range(3 if step else 1):
            accelerations(mass, device, shear, dampers, alpha, beta_k, v, load, a, total)
            if step:
                for i in range(n):
                    v[i] = half[i] + 0.5 * h * a[i]
        moved = 0.0
        for i in range(n - 1, -1, -1):
            d = u[i] - (u[i - 1] if i else 0.0)
            absolute = a[i] + shaken
            moved += mass[i] * absolute - load[i] - mass[i] * shaken
            peaks[0, i] = max(peaks[0, i], abs(d))
            peaks[1, i] = max(peaks[1, i], abs(absolute))
            peaks[2, i] = max(peaks[2, i], abs(moved))
            peaks[3, i] = max(peaks[3, i], abs(device[i]))
            peaks[4, i] = d
    return peaks


def peaks(model, record, parts, duration):
    """Peaks of a model as a file says it (`damping` none or Rayleigh by two coefficients), by
    name."""
    stories = model["stories"]
    mass = np.array([one["mass"] for one in stories])
    kinds, parameters, dampers = (
        np.zeros(len(mass), np.int64),
        np.zeros((len(mass), 4)),
        np.zeros((len(mass), 4)),
    )
    for i, one in enumerate(stories):
        law = one.get("law", {"type": "linear"})
        kinds[i] = KINDS.index(law["type"])
        own = {
            "linear": (),
            "bilinear": (law.get("yield_force"), law.get("hardening")),
            "peak-oriented": (law.get("yield_force"), law.get("hardening"), law.get("unloading")),
            "gap": (law.get("gap"), law.get("stop_stiffness")),
            "tanh": (law.get("strength"),),
            "polynomial": law.get("coefficients"),
        }[law["type"]]
        parameters[i, 0] = one.get("stiffness", 0.0)
        parameters[i, 1 : 1 + len(own)] = own
        dashpot = one.get("dashpot", 0.0)
        if isinstance(dashpot, dict):
            dampers[i, 1:] = dashpot["coefficient"], dashpot["exponent"], dashpot["linear_below"]
        else:
            dampers[i, 0] = dashpot
    initial = np.where(kinds == KINDS.index("polynomial"), parameters[:, 1], parameters[:, 0])
    heights = np.array([one["height"] for one in stories])
    geometric = GRAVITY * np.cumsum(mass[::-1])[::-1] / heights * bool(model.get("p_delta"))
    rayleigh = model.get("damping", {}).get("rayleigh", {"mass": 0.0, "stiffness": 0.0})
    start = np.zeros((2, len(mass)))
    for row, name in enumerate(("displacement", "velocity")):
        start[row] = model.get("initial", {}).get(name, 0.0)
    loads = [
        (one["floor"] - 1, one["amplitude"], one["omega"])
        for one in model.get("excitation", {}).get("forces", ())
    ]
    found = march(
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
    return dict(zip(PEAKS, found, strict=True))
