"""Axes of the grid: properties of a building and its loads, each with several values.

A value of an axis is a function that changes a `Case` under construction, declared with `value`.
A case is built by one value of each axis, in the order of the axes. A new law is declared in
`grid.springs`; a new damper, damping, load or other property is one more function here. The array
(`grid.covering`), the references and the tests follow these declarations.
"""

import hashlib
import json
import math
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import eigh

from grid.solver import GRAVITY, chain_matrix
from grid.springs import LAWS

AXES = {
    name: {}
    for name in (
        *("stories", "profile", "isolator", "p-delta", "law", "elements", "damper", "damping"),
        *("devices", "record", "scale", "duration", "load", "initial"),
    )
}
"""Functions by the name of the value and the name of the axis."""

RULES = []
"""Functions of a row that return False if it has values that exclude each other. A row maps the
names of axes to names of values; some axes may be missing."""


@dataclass
class Case:
    """Building and load under construction, in SI units.

    Attributes
    ----------
    row : dict of str to str
        Values of all axes.
    seed : int
        Seed of the random numbers.
    mass, height, stiffness, strength : ndarray
        Masses, kg, heights, m, stiffnesses, N/m, and approximate yield forces, N, of the stories.
    isolator : int or None
        Index of an isolator.
    model : dict
        Content of the model file.
    ground : ndarray
        Ground acceleration at the samples, m/s^2; empty without a record.
    interval, duration : float
        Sampling interval and duration, s.
    """

    row: dict
    seed: int
    mass: np.ndarray = field(default=None)
    height: np.ndarray = field(default=None)
    stiffness: np.ndarray = field(default=None)
    strength: np.ndarray = field(default=None)
    isolator: int | None = None
    model: dict = field(default_factory=lambda: {"stories": [], "collapse_drift": 0.9})
    ground: np.ndarray = field(default_factory=lambda: np.zeros(0))
    interval: float = 0.01
    duration: float = 2.0

    def __post_init__(self):
        self.rng = np.random.default_rng(self.seed)

    @property
    def n(self):
        """Number of stories."""
        return len(self.mass)

    @property
    def weight(self):
        """Weight above each story, N."""
        return GRAVITY * np.cumsum(self.mass[::-1])[::-1]

    def omega(self, p_delta=False):
        """Return the circular frequencies, rad/s, with P-delta on request."""
        geometric = self.weight / self.height if p_delta else 0.0
        squares = eigh(
            chain_matrix(self.stiffness - geometric), np.diag(self.mass), eigvals_only=True
        )
        return np.sqrt(np.maximum(squares, 0.0))

    @property
    def digest(self):
        """Hash of the model and the ground motion, to detect references of another case."""
        text = json.dumps([self.model, self.ground.tolist(), self.interval, self.duration])
        return hashlib.sha256(text.encode()).hexdigest()[:8]


def value(axis, name):
    """Return the decorator that declares a value of an axis."""

    def declare(function):
        AXES[axis][name] = function
        return function

    return declare


def rule(function):
    """Declare a rule; see `RULES`."""
    RULES.append(function)
    return function


def is_allowed(row):
    """Return True if no values of a row exclude each other."""
    return all(allows(row) for allows in RULES)


def build(row, seed, change=None):
    """Return the case with the values of a row, and with a change by a last function of it."""
    case = Case(row, seed)
    for axis, values in AXES.items():
        values[row[axis]](case)
    if change:
        change(case)
    # Round all numbers, so that they do not depend on the linear algebra of the machine.
    case.model = _rounded(case.model)
    case.ground = np.array(_rounded(case.ground.tolist()))
    case.duration = case.interval * round(case.duration / case.interval)
    return case


def _rounded(content):
    """Return nested content with six significant digits."""
    if isinstance(content, dict):
        return {key: _rounded(item) for key, item in content.items()}
    if isinstance(content, list | tuple):
        return [_rounded(item) for item in content]
    return float(f"{content:.6g}") if isinstance(content, float) else content


# ---- Masses, heights, stiffnesses and strengths


def _stories(n, period):
    def stories(case):
        case.mass = 1.5e5 * case.rng.uniform(0.9, 1.1, n)
        case.height = case.rng.uniform(3.0, 4.0, n)
        case.stiffness = np.linspace(1.0, 0.6, n) * case.rng.uniform(0.85, 1.15, n)
        case.period = period

    return stories


for _n, _period in ((1, 0.35), (2, 0.45), (3, 0.55), (5, 0.8)):
    value("stories", str(_n))(_stories(_n, _period))


@rule
def _five_stories_are_quick(row):
    """The references of five stories with curved laws take minutes."""
    curved = ("smooth", "curved", "steel", "softening", "degrading")
    return not (row.get("stories") == "5" and row.get("law") in curved)


def _finish_profile(case):
    """Scale the stiffnesses to the period, and choose strengths that the motions exceed."""
    case.stiffness *= (2.0 * math.pi / case.period / case.omega()[0]) ** 2
    shape = 1.0 + 0.5 * np.arange(case.n) / max(case.n - 1, 1)
    case.strength = 0.22 * case.weight * shape * case.rng.uniform(0.85, 1.15, case.n)


def _profile(change):
    def profile(case):
        change(case)
        _finish_profile(case)

    return profile


def _light_roof(case):
    case.mass[-1] *= 0.1


def _soft_story(case):
    case.stiffness[0] *= 0.5


def _stiff_top(case):
    case.stiffness[-1] *= 8.0


value("profile", "uniform")(_profile(lambda case: None))
value("profile", "light roof")(_profile(_light_roof))
value("profile", "soft story")(_profile(_soft_story))
value("profile", "stiff top")(_profile(_stiff_top))


def _isolator(index):
    def isolator(case):
        case.isolator = min(index, case.n - 1)
        case.stiffness[case.isolator] *= 0.2
        case.strength[case.isolator] *= 0.5

    return isolator


value("isolator", "none")(lambda case: None)
value("isolator", "base")(_isolator(0))
value("isolator", "base with rayleigh")(_isolator(0))
value("isolator", "middle")(_isolator(1))
value("isolator", "no heights")(lambda case: None)
value("isolator", "first without rayleigh")(lambda case: None)


@rule
def _isolated_floors(row):
    """A story without Rayleigh damping needs a story above it."""
    without = ("base", "middle", "first without rayleigh")
    return not (row.get("stories") == "1" and row.get("isolator") in without)


@rule
def _gravity_needs_heights(row):
    return not (row.get("isolator") == "no heights" and row.get("p-delta", "off") != "off")


def _gravity(case):
    case.model["p_delta"] = True


value("p-delta", "off")(lambda case: None)
value("p-delta", "on")(_gravity)
value("p-delta", "upper stories")(_gravity)


# ---- Laws of the stories


def _add_stories(case, choose):
    """Add the stories with laws: `choose` returns the declaration and the example of a story."""
    for i in range(case.n):
        spring, name, example = choose(i)
        if i == case.isolator and name != "linear":
            name, example = "bilinear", LAWS["bilinear"].examples["rising"]
            spring = LAWS[name]
        k, strength = float(case.stiffness[i]), float(case.strength[i])
        parameters = example(case.rng, k, strength)
        story = {"mass": float(case.mass[i])}
        if case.row["isolator"] != "no heights":
            story["height"] = float(case.height[i])
        if not spring.defines_stiffness:
            story["stiffness"] = k
        if name != "linear":
            story["law"] = {"type": name, **parameters}
        if i == case.isolator:
            has_rayleigh = case.row["isolator"] == "base with rayleigh"
            story["isolator"] = "rayleigh" if has_rayleigh else True
        if i == 0 and case.row["p-delta"] == "upper stories":
            story["p_delta"] = False
        if i == 0 and case.row["isolator"] == "first without rayleigh":
            story["rayleigh"] = False
        case.model["stories"].append(story)


LAW_GROUPS = {
    "linear": ("linear linear",),
    "smooth": ("tanh weak", "polynomial stiffening", "polynomial unequal"),
    "curved": ("ramberg-osgood steel", "ramberg-osgood soil", "bouc-wen open"),
    "bilinear": ("bilinear rising", "bilinear unequal", "gap stiff"),
    "stops": ("gap one side", "multilinear isotropic", "multilinear kinematic"),
    "peak": ("peak-oriented soft", "trilinear-pinching pinched", "multilinear hysteretic"),
    "flag": ("multilinear takeda", "multilinear flag", "multilinear ring spring"),
    "steel": ("steel isotropic", "bouc-wen sharp", "bouc-wen round"),
    "degrading": ("bouc-wen degrading", "bouc-wen pinched", "multilinear takeda"),
    "falling": ("bilinear falling", "imk deteriorating", "multilinear origin"),
    "softening": ("polynomial softening", "multilinear-pinching unequal", "imk pinched"),
    "failing": ("multilinear-pinching degrading", "imk deteriorating", "imk pinched"),
}
"""Laws of neighboring stories, law and example. A group is one value of the axis, so that the array
does not grow with each law."""


def _example(text):
    """Return a law of `LAW_GROUPS`: its declaration, name, and example."""
    name, _, label = text.partition(" ")
    return LAWS[name], name, LAWS[name].loops[label]


def _grouped(group):
    def grouped(case):
        first = int(case.rng.integers(len(group)))
        _add_stories(case, lambda i: _example(group[(first + i) % len(group)]))

    return grouped


for _label, _group in LAW_GROUPS.items():
    value("law", _label)(_grouped(_group))


@value("law", "every other linear")
def _every_other(case):
    examples = [_example(text) for group in LAW_GROUPS.values() for text in group]
    first = int(case.rng.integers(2))

    def choose(i):
        return examples[0 if (i + first) % 2 else case.rng.integers(len(examples))]

    _add_stories(case, choose)


value("law", "remembering")(_grouped(("steel hardening", "multilinear hysteretic")))


def _with_element(entry):
    """Return the function that adds an element to each story: `entry` returns its parameters."""

    def elements(case):
        for i, story in enumerate(case.model["stories"]):
            first = story.pop("law", {"type": "linear"})
            if "stiffness" in story:
                first["stiffness"] = story.pop("stiffness")
            second = entry(case.rng, float(case.stiffness[i]), float(case.strength[i]))
            story["elements"] = [{"name": "first", **first}, second]

    return elements


value("elements", "one")(lambda case: None)
value("elements", "with friction")(
    _with_element(
        lambda rng, k, F: {
            **{"type": "bilinear", "stiffness": 2.0 * k, "yield_force": rng.uniform(0.2, 0.4) * F},
            "hardening": 0.0,
        }
    )
)
value("elements", "with stop")(
    _with_element(lambda rng, k, F: {"type": "gap", "gap": 2.0 * F / k, "stop_stiffness": 3.0 * k})
)
value("elements", "with polynomial")(
    _with_element(
        lambda rng, k, F: {"type": "polynomial", "coefficients": [0.0, 0.0, 0.1 * k**3 / F**2]}
    )
)


def _rods(slack, **more):
    """Return the function of an element of tension-only rods: their yield force is a third of the
    strength of the story, their slack a multiple of its yield drift."""

    def rods(rng, k, F):
        curve = [[slack * F / k, 0.0]] if slack else []
        curve += [[drift * F / k, force * F] for drift, force in ((slack + 1.0, 0.33),)]
        return {
            **{"type": "multilinear", "rule": "peak", "backbone": curve, "last_slope": 0.01 * k},
            **{"pinching": {"drift": 1.0, "force": 0.0}, **more},
        }

    return rods


value("elements", "with x brace")(_with_element(_rods(0.0, angle=35.0)))
value("elements", "with rod")(_with_element(_rods(0.2, sides="positive", factor=0.9)))


# ---- Dampers, damping, attachments and links


def _coefficient(case, i):
    """Return 4 % of critical damping of a story, N s/m."""
    return float(0.08 * math.sqrt(case.stiffness[i] * case.weight[i] / GRAVITY))


def _power(exponent, below, factor):
    def entry(c):
        power = {"coefficient": factor * c, "exponent": exponent}
        return power | ({"linear_below": below} if below else {})

    return entry


def _braced(exponent, stiffness, **inclination):
    """Return the function of a damper in series with a brace, whose stiffness is that factor times
    the coefficient, 1/s."""
    return lambda c: {
        **{"coefficient": 0.8 * c, "exponent": exponent, "brace": stiffness * c},
        **inclination,
    }


_DAMPERS = {
    "linear": lambda c: c,
    "braced power .35": _braced(0.35, 150.0, angle=30.0),
    "power .35": _power(0.35, 0.005, 0.6),
    "relief": lambda c: {
        **{"coefficient": 0.8 * c, "brace": 40.0 * c, "factor": 0.8},
        "relief": {"force": 0.06 * c, "ratio": 0.1},
    },
    "power 1.5": _power(1.5, 0.0, 2.0),
}


def _damper(entry):
    def damper(case):
        for i, story in enumerate(case.model["stories"]):
            story["dashpot"] = entry(_coefficient(case, i))

    return damper


value("damper", "none")(lambda case: None)
for _label in ("linear", "braced power .35", "power .35", "relief"):
    value("damper", _label)(_damper(_DAMPERS[_label]))

value("damper", "relief 0")(
    _damper(
        lambda c: {
            **{"coefficient": 0.8 * c, "brace": 40.0 * c},
            "relief": {"force": 0.05 * c, "ratio": 0.0},
        }
    )
)


@value("damper", "mixed")
def _mixed_dampers(case):
    for i, story in enumerate(case.model["stories"]):
        entry = list(_DAMPERS.values())[case.rng.integers(len(_DAMPERS))]
        story["dashpot"] = entry(_coefficient(case, i))


def _damping(entry):
    def damping(case):
        case.model["damping"] = entry(case)

    return damping


def _two_ratios(case):
    return {"rayleigh": {"ratio": [0.03, 0.06], "modes": [1, 2]}}


def _coefficients(case):
    omega = float(case.omega()[0])
    return {"rayleigh": {"mass": 0.04 * omega, "stiffness": 0.02 / omega}}


value("damping", "none")(lambda case: None)
value("damping", "two ratios")(_damping(_two_ratios))
value("damping", "tangent")(
    _damping(lambda case: {"rayleigh": {**_coefficients(case)["rayleigh"], "tangent": True}})
)
value("damping", "modal")(_damping(lambda case: {"modal": 0.04}))
value("damping", "modal list")(_damping(lambda case: {"modal": [0.05, 0.02, 0.0][: case.n]}))
value("damping", "first mode")(
    _damping(lambda case: {"modal": {"ratio": 0.05, "modes": 1, "p_delta": False}})
)


@rule
def _second_mode(row):
    return not (row.get("stories") == "1" and row.get("damping") in ("two ratios", "modal list"))


@rule
def _modal_damping_of_all_stories(row):
    modal = ("modal", "modal list", "first mode")
    return not (row.get("isolator") == "first without rayleigh" and row.get("damping") in modal)


def _attachment(floor, share, tuning, law=None, dashpot=None):
    """Return the function that adds an attachment with a share of the mass of a floor, and a
    frequency relative to the first of the building."""

    def attachment(case):
        at = floor(case.n)
        mass = share * float(case.mass[at - 1])
        k = mass * (tuning * float(case.omega()[0])) ** 2
        c = 0.2 * math.sqrt(k * mass)
        entry = {"name": "absorber", "floor": at, "mass": mass, "stiffness": k}
        if law:
            entry["law"] = law(0.3 * GRAVITY * mass)
        case.model["attachments"] = [{**entry, "dashpot": dashpot(c) if dashpot else c}]

    return attachment


def _link(ends, **parts):
    """Return the function that adds a link between two floors; `parts` are functions of stiffness,
    N/m, strength, N, and damper coefficient, N s/m."""

    def link(case):
        k, F, c = float(case.stiffness[0]), float(case.strength[0]), _coefficient(case, 0)
        lower, upper = ends(case.n)
        entry = {"name": "link", "from": lower, "to": upper}
        entry |= {key: part(k, F, c) for key, part in parts.items()}
        case.model.setdefault("links", []).append(entry)

    return link


def _yielding(strength):
    return {"type": "bilinear", "yield_force": strength, "hardening": 0.05}


_linked = _link(
    lambda n: (1, "absorber"), stiffness=lambda k, F, c: 2e-3 * k, dashpot=lambda k, F, c: 2e-3 * c
)
_absorber = _attachment(lambda n: n, 0.05, 1.0)


def _linked_absorber(case):
    _absorber(case)
    _linked(case)


value("devices", "none")(lambda case: None)
value("devices", "linked absorber")(_linked_absorber)
value("devices", "yielding attachment")(
    _attachment(lambda n: 1, 0.1, 1.6, _yielding, lambda c: _power(0.5, 0.01, 0.3)(c))
)
value("devices", "damper from the ground")(
    _link(lambda n: ("ground", n), dashpot=lambda k, F, c: _power(0.35, 0.005, 0.3)(c))
)
value("devices", "yielding link")(
    _link(
        lambda n: ("ground" if n < 3 else 1, n),
        **{"stiffness": lambda k, F, c: 0.3 * k, "law": lambda k, F, c: _yielding(0.2 * F)},
    )
)


def _adjacent_building(law, stop_stiffness):
    """Add a building of one story beside the highest floor, with stops across the gap on one side:
    half of the mass of the floor, 1.7 times the frequency, 5 % damping."""

    def add(case):
        mass, omega = 0.5 * float(case.mass[-1]), 1.7 * float(case.omega()[0])
        stiffness = mass * omega**2
        building = {"name": "neighbor", "floor": "ground", "mass": mass, "stiffness": stiffness}
        case.model["attachments"] = [{**building, "dashpot": 0.1 * mass * omega}]
        stop = {
            "type": law,
            "gap": 0.01,
            "stop_stiffness": stop_stiffness * stiffness,
            "sides": "negative",
        }
        link = {"name": "stop", "from": case.n, "to": "neighbor", "law": stop}
        case.model.setdefault("links", []).append(link)

    return add


value("devices", "adjacent building")(_adjacent_building("gap", 20.0))
value("devices", "contact of hertz")(_adjacent_building("hertz", 200.0))


# ---- Ground motion, forces and initial motion


def _noise(interval, count):
    def record(case):
        times, end = interval * np.arange(count + 1), interval * count
        frequencies = case.rng.uniform(0.3, 12.0, 80)
        phases = case.rng.uniform(0.0, 2.0 * math.pi, 80)
        size = 1.0 / np.sqrt((1.0 - (frequencies / 2.5) ** 2) ** 2 + (0.8 * frequencies / 2.5) ** 2)
        waves = np.cos(2.0 * math.pi * frequencies * times[:, None] + phases) @ size
        waves *= np.minimum(1.0, times / 0.4)
        waves *= np.exp(-np.maximum(0.0, times - 0.6 * end) / (0.15 * end))
        case.ground, case.interval = 4.0 / np.max(np.abs(waves)) * waves, interval

    return record


@value("record", "pulse .02 s")
def _pulse(case):
    times = 0.02 * np.arange(101)
    wave = np.sin(2.0 * math.pi * times / 0.9) * np.exp(-(((times - 0.9) / 0.5) ** 2))
    ripple = np.cos(2.0 * math.pi * times / 0.21) * np.exp(-(((times - 1.1) / 0.6) ** 2))
    shape = wave + case.rng.uniform(0.1, 0.2) * ripple
    case.ground, case.interval = 4.0 / np.max(np.abs(shape)) * shape, 0.02


value("record", "noise .01 s")(_noise(0.01, 200))
value("record", "noise .005 s")(_noise(0.005, 400))


def _scaled(factor):
    def scale(case):
        case.ground = factor * case.ground

    return scale


value("scale", "1")(_scaled(1.0))
value("scale", "0.4")(_scaled(0.4))
value("scale", "-2")(_scaled(-2.0))


def _lasting(seconds):
    def duration(case):
        case.duration = seconds

    return duration


value("duration", "record")(_lasting(2.0))
value("duration", "shorter")(_lasting(1.2))
value("duration", "longer")(_lasting(2.6))


def _harmonic(case, phase, factor):
    """Add a force on the roof and another on the middle floor."""
    omega = float(case.omega(case.row["p-delta"] != "off")[0])
    forces = [
        (case.n, 0.08 * factor, 1.3 * omega),
        (max(1, case.n // 2), 0.05 * factor, 3.1 * omega),
    ]
    case.model["excitation"] = {
        "forces": [
            {
                **{"floor": floor, "amplitude": float(amplitude * case.weight[0])},
                **{"omega": frequency, "phase": phase},
            }
            for floor, amplitude, frequency in forces
        ]
    }


value("load", "record")(lambda case: None)
value("load", "record and cosine")(lambda case: _harmonic(case, "cos", 1.0))


@value("load", "record from a jump")
def _jump(case):
    times = case.interval * np.arange(len(case.ground))
    case.ground = case.ground + 2.0 * np.exp(-times / 0.5)


def _pushed(case):
    """Add forces through points: a blast on the roof and wind on the first floor."""
    omega, weight = float(case.omega()[0]), float(case.weight[0])
    blast = [[0.0, 0.0], [0.0, 0.35], [0.0731, 0.0], [0.31, -0.05], [0.5, 0.0]]
    times = np.sort(case.rng.uniform(0.0, 1.9, 12))
    wind = 0.06 * (1.0 + np.sin(omega * times))
    case.model["excitation"] = {
        "forces": [
            {
                **{"floor": case.n, "start": 0.2137, "scale": 0.9},
                "points": [[time, force * weight] for time, force in blast],
            },
            {"floor": 1, "points": np.stack([times, wind * weight], axis=1).tolist()},
        ]
    }


value("load", "record and points")(_pushed)


def _without_record(case):
    case.ground = np.zeros(0)


@value("load", "sine")
def _sine(case):
    _without_record(case)
    _harmonic(case, "sin", 2.0)


value("load", "none")(_without_record)


@rule
def _unused_record(row):
    """Without a record, the axes of the record have their first values."""
    if row.get("load") not in ("sine", "none"):
        return True
    return all(
        row.get(axis, next(iter(AXES[axis]))) == next(iter(AXES[axis]))
        for axis in ("record", "scale", "duration")
    )


@rule
def _motion_needs_a_cause(row):
    return not (row.get("load") == "none" and row.get("initial") == "rest")


def _initial(drift_factor, velocity):
    def initial(case):
        drifts = case.strength / case.stiffness * case.rng.uniform(0.5, 1.0, case.n)
        signs = case.rng.choice([-1.0, 1.0], case.n if drift_factor < 1.0 else 1)
        speeds = case.rng.uniform(-velocity, velocity, case.n)
        case.model["initial"] = {
            "displacement": np.cumsum(drift_factor * signs * drifts).tolist(),
            "velocity": speeds.tolist(),
        }

    return initial


value("initial", "rest")(lambda case: None)
value("initial", "elastic drift")(_initial(0.5, 0.0))
value("initial", "yielded drift")(_initial(2.0, 0.0))
value("initial", "velocity")(_initial(0.0, 0.4))
value("initial", "drift and velocity")(_initial(0.5, 0.4))
