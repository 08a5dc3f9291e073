"""Random buildings for tests.

- `random_building`: free vibration; conservative, or with dissipation by hysteretic laws only.
- `piecewise_building`: random ground motion, with laws that are linear on each branch.
- `any_building`: all laws, and all other options of a model file.
"""

from dataclasses import replace

import numpy as np

from building_cases import LINEAR, Law, ModalDamping, RayleighCoefficients, model, noise, story
from tdint import load_model, make_record
from tdint.model.building import assemble

BEND = 0.02
"""Approximate drift at which the tangent stiffness of the laws changes, m."""


def _polynomial(rng, k):
    """Return a hardening polynomial law with a positive tangent at all drifts."""
    cubic = rng.uniform(0.1, 3.0) * k / BEND**2
    return Law("polynomial", (k, rng.uniform(-1.0, 1.0) * np.sqrt(k * cubic), cubic))


def _gap(rng, k):
    return Law("gap", (BEND * rng.uniform(0.2, 1.0), k * rng.uniform(1.0, 30.0)))


CONSERVATIVE = {
    "polynomial": _polynomial,
    "gap": _gap,
    "tanh": lambda rng, k: Law("tanh", (BEND * k * rng.uniform(0.5, 2.0),)),
    "linear": lambda rng, k: Law("linear", ()),
}
HYSTERETIC = {
    "bilinear": lambda rng, k: Law(
        "bilinear", (BEND * k * rng.uniform(0.2, 1.0), rng.uniform(0.0, 0.3))
    ),
    "peak-oriented": lambda rng, k: Law(
        "peak-oriented",
        (BEND * k * rng.uniform(0.2, 1.0), rng.uniform(0.01, 0.3), rng.uniform(0.0, 0.9)),
    ),
    "linear": lambda rng, k: Law("linear", ()),
}


def random_building(rng, laws):
    """Return a building in free vibration and its first period, s.

    It has one to eight stories with laws sampled from `laws`, sometimes P-delta, and initial drifts
    of up to three times `BEND`.
    """
    n = int(rng.integers(1, 9))
    masses = 1e5 * rng.uniform(0.5, 2.0, n)
    springs = 1e8 * rng.uniform(0.5, 2.0, n) * np.linspace(1.5, 0.7, n)
    names = rng.choice(list(laws), n)
    stories = [
        story(m, k, laws[name](rng, k), height=3.0)
        for m, k, name in zip(masses, springs, names, strict=True)
    ]
    drifts = BEND * rng.uniform(-3.0, 3.0, n)
    rates = rng.uniform(-0.5, 0.5, n)
    built = model(
        stories,
        displacement=tuple(np.cumsum(drifts)),
        velocity=tuple(np.cumsum(rates)),
        p_delta=bool(rng.random() < 0.4),
    )
    return built, 2.0 * np.pi / assemble(built).modes().omega[0]


def _imk(rng, k, strength):
    """Return a random imk law with the stiffness k, N/m, and the yield force `strength`, N."""
    drift = strength / k
    hardening = (
        drift * rng.uniform(2.0, 6.0),
        drift * rng.uniform(10.0, 30.0),
        rng.uniform(1.0, 1.3),
    )
    side = (strength, *hardening, rng.uniform(0.0, 0.4), 100.0 * drift, 1.0)
    pinching = rng.uniform(0.2, 0.8, 2) if rng.random() < 0.5 else (1.0, 1.0)
    capacity = drift * rng.uniform(20.0, 200.0) if rng.random() < 0.7 else np.inf
    return Law("imk", (*side, *side, *4 * [capacity], 1.0, *pinching))


def _trilinear(rng, k, strength):
    """Return a random trilinear-pinching law with the stiffness k, N/m, and the yield force
    `strength`, N."""
    ultimate = (strength * rng.uniform(1.0, 2.0), strength / k * rng.uniform(4.0, 12.0))
    return Law(
        "trilinear-pinching", (strength, *ultimate, rng.uniform(0.2, 1.0), rng.uniform(0.0, 0.4))
    )


PIECEWISE = {
    "bilinear": lambda rng, k, f: Law("bilinear", (f, rng.uniform(0.0, 0.3))),
    "peak-oriented": lambda rng, k, f: Law(
        "peak-oriented", (f, rng.uniform(0.0, 0.2), rng.uniform(0.0, 0.5))
    ),
    "gap": lambda rng, k, f: Law(
        "gap", (f / k * rng.uniform(0.5, 1.5), f / (f / k) * rng.uniform(1.0, 20.0))
    ),
    "trilinear-pinching": _trilinear,
    "imk": _imk,
}
SMOOTH = {
    "linear": lambda rng, k, f: LINEAR,
    "tanh": lambda rng, k, f: Law("tanh", (1.5 * f,)),
    "polynomial": lambda rng, k, f: Law(
        "polynomial", (k, 0.0, rng.uniform(0.05, 0.5) * k * (k / f) ** 2)
    ),
    "bouc-wen": lambda rng, k, f: Law("bouc-wen", (f, rng.uniform(0.02, 0.2), 2.0, 0.5)),
}
"""Functions by the name of a law that return a random law from a generator, a stiffness k, N/m, and
an approximate strength f, N. `PIECEWISE` has the same structure."""


def _frame(rng, n):
    """Return masses and springs of n stories with a period that is typical of frames."""
    period = rng.uniform(0.1, 0.25) * n**0.75 + 0.1
    masses = 1e5 * rng.uniform(0.7, 1.4, n)
    springs = (
        (2.0 * np.pi / period) ** 2 * masses.mean() * (n + 1) ** 2 / 2.5 * np.linspace(1.5, 0.7, n)
    )
    return masses, springs * rng.uniform(0.8, 1.2, n)


def _shaken(rng, masses, springs, strengths, laws, samples):
    """Return a random building and a ground motion.

    Parameters
    ----------
    rng : Generator
        Random generator of NumPy.
    masses, springs, strengths : ndarray
        Masses, kg, stiffnesses, N/m, and strengths, N, of the stories.
    laws : dict
        Laws that are sampled; `PIECEWISE` or `SMOOTH`.
    samples : int
        Number of samples of the ground motion.
    """
    names = rng.choice(list(laws), len(springs))
    stories = [
        story(
            m,
            k,
            laws[name](rng, k, f),
            height=3.2,
            dashpot=rng.uniform(0.01, 0.06) * np.sqrt(m * k),
        )
        for m, k, f, name in zip(masses, springs, strengths, names, strict=True)
    ]
    motion = noise(samples=samples, peak=rng.uniform(3.0, 8.0), seed=int(rng.integers(1 << 30)))
    return model(stories), motion


def piecewise_building(rng, samples=601):
    """Return a building of one to seven stories with laws sampled from `PIECEWISE`, and a motion
    that exceeds the drifts at their kinks by far. A third of the buildings are isolated, and two of
    five have P-delta."""
    n = int(rng.integers(1, 7))
    isolated = rng.random() < 0.35
    masses, springs = _frame(rng, n)
    above = np.cumsum(masses[::-1])[::-1]
    strengths = rng.uniform(0.08, 0.3) * 9.81 * above * rng.uniform(0.8, 1.2, n)
    if isolated:
        masses = np.append(1e5, masses)
        springs = np.append(
            (2.0 * np.pi / rng.uniform(0.8, 1.5)) ** 2 * masses.sum(), 5.0 * springs
        )
        strengths = np.append(rng.uniform(0.03, 0.08) * 9.81 * masses.sum(), 3.0 * strengths)
    built, motion = _shaken(rng, masses, springs, strengths, PIECEWISE, samples)
    return replace(built, p_delta=bool(rng.random() < 0.4)), motion


def shaken_building(rng, laws=tuple(SMOOTH), samples=601):
    """Return a building of one to six stories with smooth laws, and a motion that exceeds the
    drifts of their curvature."""
    n = int(rng.integers(1, 7))
    masses, springs = _frame(rng, n)
    strengths = rng.uniform(0.08, 0.3) * 9.81 * np.cumsum(masses[::-1])[::-1]
    return _shaken(rng, masses, springs, strengths, {name: SMOOTH[name] for name in laws}, samples)


METHODS = (
    "impulse4", "newmark-average", "bathe", "generalized-alpha", "gauss4", "impulse", "park",
    "wilson",
)  # fmt: skip
LAWS = ("linear", "bilinear", "peak-oriented", "tanh", "polynomial", "bouc-wen")


def random_law(name, generator, stiffness, strength):
    """Return a law with random parameters.

    Parameters
    ----------
    name : str
        Name of the law, one of `LAWS`.
    generator : Generator
        Random generator of NumPy.
    stiffness, strength : float
        Initial stiffness, N/m, and approximate strength, N.
    """
    hardening = float(generator.uniform(0.01, 0.1))
    return {
        "linear": LINEAR,
        "bilinear": Law("bilinear", (strength, hardening)),
        "peak-oriented": Law(
            "peak-oriented", (strength, hardening, float(generator.uniform(0.0, 0.5)))
        ),
        "tanh": Law("tanh", (1.5 * strength,)),
        "polynomial": Law(
            "polynomial", (stiffness, 0.0, float(generator.uniform(-5.0, 200.0)) * stiffness)
        ),
        "bouc-wen": Law("bouc-wen", (strength, hardening, 2.0, 0.5)),
    }[name]


def checked_building(seed, samples=501, step=0.01):
    """Return a random building, a ground motion and the name of a method for a seed.

    The building has one to eight stories, with the same law or with different laws. The ground
    motion is smooth for even seeds and irregular for odd seeds. `samples` and `step` (s) are its
    number of samples and its sampling interval.
    """
    generator = np.random.default_rng(seed)
    n = int(generator.integers(1, 9))
    mass = 2e5
    omega = 2.0 * np.pi / (0.1 + n * generator.uniform(0.08, 0.16))
    stiffness = mass * (omega / (2.0 * np.sin(np.pi / (4 * n + 2)))) ** 2
    base = generator.uniform(0.1, 0.4) * n * mass * 9.81
    peak = generator.uniform(2.0, 6.0)
    name = (*LAWS, "mixed")[seed % 7]
    stories = []
    for i in range(n):
        k = float(stiffness * generator.uniform(0.8, 1.2))
        law_name = str(generator.choice(LAWS)) if name == "mixed" else name
        law = random_law(law_name, generator, k, float(base * (1.0 - 0.7 * (i / n) ** 2)))
        stories.append(story(float(mass * generator.uniform(0.8, 1.2)), k, law))
    damping = [RayleighCoefficients(0.3, 0.001), ModalDamping((0.05,)), None][seed % 3]
    record = noise(samples, step, seed=seed, peak=peak)
    if seed % 2:
        rough = (
            0.3
            * peak
            * generator.normal(size=samples)
            * np.sin(np.pi * np.linspace(0.0, 1.0, samples)) ** 2
        )
        record = replace(record, acceleration=record.acceleration + rough)
    method = "exact" if name == "linear" and seed % 14 == 0 else METHODS[seed % len(METHODS)]
    return (
        replace(model(stories, damping=damping, p_delta=seed % 5 == 0), collapse_drift=1e9),
        record,
        method,
    )


ANY_LAW = (
    *("linear", "bilinear", "bouc-wen", "tanh", "polynomial", "gap"),
    *("peak-oriented", "trilinear-pinching", "imk", "multilinear-pinching"),
)
DEGRADING = ("imk", "multilinear-pinching")


def _shaking(rng, dt, duration, peak):
    """Return the samples of a random ground motion, m/s^2.

    It consists of two hundred harmonics that are amplified near a random frequency of the ground,
    with an envelope that increases and decays.

    Parameters
    ----------
    rng : Generator
        Random generator of NumPy.
    dt, duration : float
        Sampling interval and duration, s.
    peak : float
        Peak acceleration, m/s^2.
    """
    t = np.arange(round(duration / dt) + 1) * dt
    ground = rng.uniform(1.0, 5.0)
    frequency = rng.uniform(0.2, min(15.0, 0.4 / dt), 200)
    ratio = frequency / ground
    amplitude = 1.0 / np.sqrt((1.0 - ratio**2) ** 2 + (0.8 * ratio) ** 2)
    phase = rng.uniform(0.0, 2.0 * np.pi, 200)
    motion = (amplitude * np.cos(2.0 * np.pi * frequency * t[:, None] + phase)).sum(axis=1)
    motion *= np.minimum(1.0, t / (0.15 * duration)) * np.exp(
        -np.maximum(0.0, t - 0.5 * duration) / (0.2 * duration)
    )
    return motion * peak / np.abs(motion).max()


def _law_entry(rng, name, strength, k):
    """Return the entry of a model file for a law that yields at about the given strength, N, with
    stiffness k, N/m."""
    drift = strength / k

    def times_drift(low, high):
        """Return a random multiple of the yield drift, m."""
        return drift * float(rng.uniform(low, high))

    def choice(*values):
        """Return one of some values at random."""
        return float(rng.choice(values))

    def between(low, high):
        """Return a random value of an interval."""
        return float(rng.uniform(low, high))

    if name == "bilinear":
        return {"yield_force": strength, "hardening": choice(0, 0.02, 0.05, 0.1)}
    if name == "bouc-wen":
        curve = {
            "hardening": choice(0, 0.03, 0.1),
            "exponent": choice(1, 1.5, 2, 5),
            "beta": choice(0.5, 0.7, 1.0),
        }
        return {"yield_force": strength, **curve}
    if name == "tanh":
        return {"strength": 1.5 * strength}
    if name == "polynomial":
        return {"coefficients": [k, 0.0, k * between(-0.02, 0.5) / (4.0 * drift) ** 2]}
    if name == "gap":
        return {"gap": 1.5 * drift, "stop_stiffness": 3.0 * k}
    if name == "peak-oriented":
        return {
            "yield_force": strength,
            "hardening": choice(0, 0.02, 0.05),
            "unloading": choice(0, 0.3, 0.5),
        }
    if name == "trilinear-pinching":
        backbone = {"ultimate_force": 1.5 * strength, "ultimate_drift": times_drift(4, 10)}
        return {
            "yield_force": strength,
            **backbone,
            "pinching": choice(0.2, 0.5, 0.8, 1),
            "unloading": choice(0, 0.2, 0.4),
        }
    if name == "imk":
        law = {
            "yield_force": strength,
            "plastic_drift": times_drift(4, 12),
            "post_capping_drift": times_drift(15, 40),
        }
        law |= {
            "capping_ratio": between(1, 1.3),
            "residual_ratio": between(0.05, 0.4),
            "ultimate_drift": 100.0 * drift,
        }
        if rng.random() < 0.8:
            law["deterioration"] = times_drift(20, 200)
        if rng.random() < 0.6:
            law["pinching"] = {"force": between(0.2, 0.8), "drift": between(0.2, 0.8)}
        return law
    if name == "multilinear-pinching":
        backbone = [[drift, strength], [times_drift(4, 8), 1.2 * strength]]
        backbone += [
            [times_drift(*to), between(*part) * strength]
            for to, part in (((12, 20), (0.8, 1.1)), ((40, 60), (0.1, 0.4)))
        ]
        law = {"backbone": backbone}
        law["pinching"] = {
            "drift": between(0.2, 0.8),
            "force": between(0.1, 0.6),
            "unloading": between(-0.1, 0.3),
        }
        if rng.random() < 0.8:
            most = {
                "stiffness": (0.5, 0.3, 0.1, 0.7),
                "drift": (0.2, 0.1, 0.05, 0.2),
                "strength": (0.2, 0.1, 0.05, 0.3),
            }
            law["degradation"] = {
                limit_name: {
                    "peak": between(0, peak),
                    "work": between(0, work),
                    "limit": between(low, high),
                }
                for limit_name, (peak, work, low, high) in most.items()
            } | {"capacity": between(5, 20)}
        return law
    return {}


def any_building(seed, laws=None):
    """Return a model as the mapping of a model file, and a ground motion of 8 to 14 s.

    The model has one to ten stories, with period and strength of usual frames. Without `laws`, one
    third of the seeds have degrading laws (`DEGRADING`), one third a single law of `ANY_LAW`, and
    one third all laws. 40 % have P-delta, 30 % a force on a floor, 25 % an initial motion; 20 % of
    the stories have a damper.
    """
    rng = np.random.default_rng(990_000 + seed)
    n = int(rng.integers(1, 11))
    masses, heights = rng.uniform(50e3, 300e3, n), rng.uniform(2.8, 4.5, n)
    springs = np.linspace(1.0, 0.5, n) * rng.uniform(0.7, 1.3, n)
    period = float(rng.uniform(0.08, 0.14) * n + 0.15)
    matrix = (
        np.diag(springs + np.append(springs[1:], 0.0))
        - np.diag(springs[1:], 1)
        - np.diag(springs[1:], -1)
    )
    springs *= (2.0 * np.pi / period) ** 2 / np.linalg.eigvalsh(
        matrix / np.sqrt(np.outer(masses, masses))
    )[0]
    weights = np.cumsum(masses[::-1])[::-1] * 9.80665
    dt = float(rng.choice([0.005, 0.01, 0.02, 0.0125, 0.004]))
    motion = _shaking(rng, dt, float(rng.uniform(8.0, 14.0)), float(rng.uniform(2.0, 6.0)))
    base = rng.uniform(0.1, 0.35)
    laws = laws or (DEGRADING, (ANY_LAW[seed // 3 % len(ANY_LAW)],), ANY_LAW)[seed % 3]
    stories = []
    for i in range(n):
        name, k = str(rng.choice(laws)), float(springs[i])
        strength = float(
            base * weights[i] * (1.0 + 0.5 * i / max(n - 1, 1)) * rng.uniform(0.8, 1.2)
        )
        law = _law_entry(rng, name, strength, k)
        story_entry = {"mass": float(masses[i]), "height": float(heights[i]), "stiffness": k}
        if law:
            story_entry["law"] = {"type": name, **law}
        if name in ("polynomial", "multilinear-pinching"):
            del story_entry["stiffness"]  # the law defines the stiffness
        if rng.random() < 0.2:
            viscous = float(0.05 * np.sqrt(k * weights[i] / 9.80665))
            # of every other building's dampers a power law, as strong at 0.1 m/s
            power = {"coefficient": viscous * 0.1**0.6, "exponent": 0.4, "linear_below": 0.001}
            story_entry["dashpot"] = power if seed % 6 in (1, 2) else viscous
        stories.append(story_entry)
    model = {"stories": stories, "collapse_drift": 0.9}
    draw = rng.random()
    if draw < 0.5:
        model["damping"] = float(rng.choice([0.02, 0.05]))
    elif draw < 0.7:
        ratios = rng.uniform(0.01, 0.08, n).tolist()
        model["damping"] = {"modal": ratios if n > 1 else ratios[0]}
    elif draw < 0.9:
        omega = 2.0 * np.pi / period
        model["damping"] = {"rayleigh": {"mass": 0.05 * omega * 0.1, "stiffness": 0.04 / omega}}
    if rng.random() < 0.4:
        model["p_delta"] = True
    if rng.random() < 0.3:
        force = {"floor": int(rng.integers(1, n + 1)), "phase": "sin"}
        force["amplitude"] = float(0.1 * base * weights[0] * rng.uniform(0.2, 1.0))
        force["omega"] = float(rng.uniform(0.3, 4.0) * 2.0 * np.pi / period)
        model["excitation"] = {"forces": [force]}
    if rng.random() < 0.25:
        drifts, rates = rng.uniform(-0.01, 0.01, n), rng.uniform(-0.3, 0.3, n)
        model["initial"] = {"displacement": np.cumsum(drifts).tolist(), "velocity": rates.tolist()}
    return model, make_record(motion, dt=dt, units="m/s^2")


def degrading_building(number):
    """Return a building with stories that lose strength and stiffness at reversals, without dampers
    and floor forces."""
    definition, record = any_building(number, DEGRADING)
    for story_entry in definition["stories"]:
        story_entry.pop("dashpot", None)
    definition.pop("excitation", None)
    if isinstance(definition.get("damping"), dict) and "modal" in definition["damping"]:
        definition["damping"] = 0.03
    return load_model(definition), record
