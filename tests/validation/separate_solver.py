"""Peak responses of small models by a separate solver, for the cases `feature` of `tdint validate`.

    python tests/validation/separate_solver.py            # print the peaks of all cases
    python tests/validation/separate_solver.py NAME       # of one case

The classical Runge-Kutta method of order 4 with a fixed step integrates the floors, the dampers
with a brace and the Bouc-Wen laws; all other laws are the springs of `separate_laws.py`, which move
along a straight path in each stage. A step in which a spring fractures is divided at the fracture.
Nothing of tdint is used: the models are read as YAML, in SI units. The stored peaks are
those of a step of `STEP`; half of it changes them by less than 1e-6.
"""

import sys
import tomllib
from pathlib import Path

import numpy as np
import yaml

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import separate_laws as laws

CASES = Path(__file__).parents[2] / "src" / "tdint" / "validation_cases.toml"
STEP = 2e-4
"""Time step, s; the samples of the motion and the times of forces are multiples of it."""
SAMPLING = 0.02
GRAVITY = 9.80665


def motion(time):
    """Ground acceleration of the cases (m/s^2), before it is sampled every 0.02 s."""
    envelope = np.where(time < 2.4, np.sin(np.pi * time / 2.4) ** 2, 0.0)
    return 5.0 * envelope * np.sin(2.0 * np.pi * 1.6 * time)


def curve(points, last_slope=0.0):
    """Return a piecewise linear odd function through the origin and points."""
    drifts, forces = [0.0, *(d for d, _ in points)], [0.0, *(f for _, f in points)]

    def force(x):
        beyond = max(abs(x) - drifts[-1], 0.0)
        return np.copysign(np.interp(abs(x), drifts, forces) + last_slope * beyond, x)

    return force


class Scaled:
    """A spring in units of a drift and a force, as a spring in SI units."""

    def __init__(self, spring, drift, force):
        self.spring, self.drift, self.force = spring, drift, force
        self.f = 0.0

    def go(self, x):
        self.spring.go(x / self.drift)
        self.f = self.force * self.spring.f


class Fracturing:
    """A spring whose force is lost when the drift reaches a limit."""

    def __init__(self, spring, limit):
        self.spring, self.limit = spring, limit
        self.is_broken = False
        self.x = self.f = 0.0

    def go(self, x):
        self.spring.go(x)
        self.x, self.f = x, 0.0 if self.is_broken else self.spring.f


class BoucWen:
    """dw = v / dy (1 - |w|^n (beta sign(v w) + 1 - beta)), f = a k d + (1 - a) Fy w."""

    def __init__(self, stiffness, law):
        self.stiffness, self.strength = stiffness, law["yield_force"]
        self.hardening, self.exponent, self.beta = law["hardening"], law["exponent"], law["beta"]
        self.w = 0.0
        self.f = 0.0

    def rate(self, w, v):
        share = self.beta * np.sign(v * w) + 1.0 - self.beta
        return v * self.stiffness / self.strength * (1.0 - abs(w) ** self.exponent * share)

    def go(self, x):
        self.f = self.hardening * self.stiffness * x + (1.0 - self.hardening) * (
            self.strength * self.w
        )


def multilinear(law):
    points, last = [tuple(point) for point in law["backbone"]], law.get("last_slope", 0.0)
    stiffness = points[0][1] / points[0][0]
    rule = law["rule"]
    if rule == "flag":
        lower = curve([(0.0, 0.0), *law["return"]], law.get("return_slope", last))
        return stiffness, laws.Flag(stiffness, curve(points, last), lower)
    if rule == "peak":  # one bend only: Clough's law
        (drift, force), slope = points[0], last
        far = 1e3
        spring = laws.TrilinearCurves(1.0 + slope * drift / force * (far - 1.0), far, 1.0, 0.0)
        return stiffness, Scaled(spring, drift, force)
    springs = {
        "kinematic": lambda: laws.Kinematic(points, last),
        "isotropic": lambda: laws.Isotropic(points, last),
        "origin": lambda: laws.Origin(curve(points, last)),
        "elastic": lambda: laws.Spring(curve(points, last)),
    }
    return stiffness, springs[rule]()


def spring_of(entry):
    """Return the initial stiffness (N/m) and the spring of a story, an element or a link."""
    law = dict(entry.get("law") or entry)
    kind, k = law.get("type", "linear"), entry.get("stiffness", 0.0)
    strength = law.get("yield_force", law.get("strength"))
    if kind == "polynomial":
        k = law["coefficients"][0]
        spring = laws.Spring(lambda x: sum(c * x**i for i, c in enumerate(law["coefficients"], 1)))
    elif kind == "multilinear":
        k, spring = multilinear(law)
    elif kind == "multilinear-pinching":
        points = [tuple(point) for point in law["backbone"]]
        k = points[0][1] / points[0][0]
        pinching = [law["pinching"][name] for name in ("drift", "force", "unloading")]
        spring = laws.Pinching4(points, pinching)
    elif kind == "linear":
        spring = laws.Spring(lambda x: k * x)
    elif kind == "tanh":
        spring = laws.Spring(lambda x: strength * np.tanh(k * x / strength))
    elif kind == "gap":
        size, stop = law["gap"], law["stop_stiffness"]
        spring = laws.Spring(lambda x: k * x + stop * np.copysign(max(abs(x) - size, 0.0), x))
    elif kind == "hertz":
        size, stop = law["gap"], law["stop_stiffness"]
        spring = laws.Spring(
            lambda x: k * x + stop * np.copysign(max(abs(x) - size, 0.0) ** 1.5, x)
        )
    elif kind == "bilinear":
        negative = law.get("negative", {}).get("yield_force")
        spring = laws.Bilinear(k, strength, law["hardening"], negative)
    elif kind == "bouc-wen":
        spring = BoucWen(k, law)
    else:
        drift = strength / k
        spring = Scaled(in_own_units(kind, law, drift), drift, strength)
    if "fracture_drift" in law:
        spring = Fracturing(spring, law["fracture_drift"])
    return k, spring


def in_own_units(kind, law, drift):
    """Return the spring of a law in units of its yield drift (m) and its yield force."""
    if kind == "steel":
        transition = [law["transition"][name] for name in ("R0", "cR1", "cR2")]
        return laws.Steel(law["hardening"], transition)
    if kind == "ramberg-osgood":
        return laws.RambergOsgood(law["alpha"], law["exponent"])
    if kind == "trilinear-pinching":
        return laws.TrilinearCurves(
            law["ultimate_force"] / law["yield_force"],
            law["ultimate_drift"] / drift,
            law["pinching"],
            law["unloading"],
        )
    if kind == "peak-oriented":
        far = 1e3
        return laws.TrilinearCurves(
            1.0 + law["hardening"] * (far - 1.0), far, 1.0, law["unloading"]
        )
    assert kind == "imk", kind
    side = (1.0, law["plastic_drift"] / drift, law["post_capping_drift"] / drift)
    side += (law["capping_ratio"], law["residual_ratio"], law["ultimate_drift"] / drift, 1.0)
    pinching = (law["pinching"]["force"], law["pinching"]["drift"])
    return laws.ImkCurves(side, side, law["deterioration"] / drift, 1.0, pinching)


class Damper:
    """A dashpot between two floors; with a brace, `rate` is the rate of the damper alone."""

    def __init__(self, entry):
        entry = entry if isinstance(entry, dict) else {"coefficient": entry}
        self.c, self.exponent = entry["coefficient"], entry.get("exponent", 1.0)
        self.threshold, self.brace = entry.get("linear_below", 0.0), entry.get("brace")
        self.factor, self.relief = entry.get("factor", 1.0), entry.get("relief")

    def force(self, v):
        return self.c * v * (v * v + self.threshold**2) ** (0.5 * (self.exponent - 1.0))

    def rate(self, force):
        """Return the rate of a damper with a brace, which has no linear part, m/s."""
        size = abs(force)
        if self.relief and size > self.relief["force"]:
            opened = self.relief["force"] / self.c
            return np.copysign(
                opened + (size - self.relief["force"]) / (self.relief["ratio"] * self.c), force
            )
        return np.copysign((size / self.c) ** (1.0 / self.exponent), force)


class Member:
    """Springs and a damper between two floors; floor -1 is the ground."""

    def __init__(self, name, below, above, entry):
        self.name, self.below, self.above = name, below, above
        pairs = [spring_of(element) for element in entry.get("elements", [entry])]
        self.stiffness = sum(k for k, _ in pairs)
        self.springs = [spring for _, spring in pairs]
        self.damper = Damper(entry["dashpot"]) if "dashpot" in entry else None
        self.viscous = 0.0  # Rayleigh damping in proportion to the initial stiffness, N s/m
        self.tangent = 0.0  # the same in proportion to the tangent stiffness, s
        self.gravity = 0.0  # P-delta, N/m

    def change(self, values):
        """Return the difference of a quantity of both floors."""
        return values[self.above] - (values[self.below] if self.below >= 0 else 0.0)

    def add(self, values, change):
        """Add `change` to the values of the upper floor, and subtract it from the lower floor."""
        values[self.above] += change[self.above]
        if self.below >= 0:
            values[self.below] -= change[self.below]


class Structure:
    """The members, masses and loads of a model."""

    def __init__(self, model):
        stories = model["stories"]
        n = len(stories)
        self.members = [Member(f"{i + 1}", i - 1, i, entry) for i, entry in enumerate(stories)]
        self.mass = [entry["mass"] for entry in stories]
        ends = {"ground": -1, **{i + 1: i for i in range(n)}}
        inerters = []  # inertance, kg, and the floors between which it acts
        for entry in model.get("attachments", ()):
            floor = ends[entry["name"]] = len(self.mass)
            self.members.append(Member(entry["name"], ends[entry["floor"]], floor, entry))
            self.mass.append(entry["mass"])
            inerters.append((entry, Member("inerter", -1, floor, {})))
        for entry in model.get("links", ()):
            member = Member(entry["name"], ends[entry["from"]], ends[entry["to"]], entry)
            self.members.append(member)
            inerters.append((entry, member))
            law = entry.get("law", {})
            if "dashpot" in law:  # of a contact: it acts while the stop has a stiffness
                member.tangent = law["dashpot"] / law["stop_stiffness"]
        inerters += zip(stories, self.members, strict=False)
        self.mass = np.array(self.mass)
        self.inertia = np.diag(self.mass)
        for entry, member in inerters:
            way = np.zeros(len(self.mass))
            member.add(way, np.ones(len(self.mass)))
            self.inertia += entry.get("inertance", 0.0) * np.outer(way, way)
        self.mass_part = np.zeros(len(self.mass))
        self.modal = np.zeros((n, n))
        self.damp(model.get("damping", {}), n)
        if model.get("p_delta"):
            weights = GRAVITY * np.cumsum(self.mass[::-1])[::-1]
            for member, weight, entry in zip(self.members, weights, stories, strict=True):
                member.gravity = -weight / entry["height"]
        self.forces = model.get("excitation", {}).get("forces", [])
        self.ground = np.append(motion(np.arange(200) * SAMPLING), 0.0)

    def damp(self, damping, n):
        """Store the damping of the bare building."""
        if "modal" in damping:
            stiffness = np.zeros((n, n))
            for i, member in enumerate(self.members[:n]):
                way = np.zeros(n)
                way[i] = 1.0
                if i:
                    way[i - 1] = -1.0
                stiffness += member.stiffness * np.outer(way, way)
            root = np.sqrt(self.mass[:n])
            squares, shapes = np.linalg.eigh(stiffness / np.outer(root, root))
            shapes = shapes * root[:, None]
            self.modal = shapes @ np.diag(2.0 * damping["modal"] * np.sqrt(squares)) @ shapes.T
            return
        rayleigh = damping["rayleigh"]
        self.mass_part[:n] = rayleigh["mass"] * self.mass[:n]
        for member in self.members[:n]:
            if rayleigh.get("tangent"):
                member.tangent = rayleigh["stiffness"]
            else:
                member.viscous = rayleigh["stiffness"] * member.stiffness

    def load(self, t, is_end):
        """Return the forces on the floors at a time, N; at a jump the value before (`is_end`) or
        after it."""
        shift = -1e-9 if is_end else 1e-9
        position = (t + shift) / SAMPLING
        i = int(position)
        ground = self.ground[i] + (t / SAMPLING - i) * (self.ground[i + 1] - self.ground[i])
        load = -self.mass * ground
        for entry in self.forces:
            if "points" in entry:
                value = 0.0
                for (t0, f0), (t1, f1) in zip(entry["points"], entry["points"][1:], strict=False):
                    if t0 < t + shift < t1:
                        value = f0 + (t - t0) / (t1 - t0) * (f1 - f0)
            else:
                value = entry["amplitude"] * np.cos(entry["omega"] * t)
            load[entry["floor"] - 1] += value
        return load


class Integration:
    """State of a structure, and its peaks."""

    def __init__(self, structure):
        self.structure = structure
        self.u = np.zeros(len(structure.mass))
        self.velocity = np.zeros(len(structure.mass))  # see `derivatives`
        members = structure.members
        self.springs = [member.springs for member in members]
        self.forces = np.zeros(len(members))  # of the braces, along the damper, N
        self.w = np.array([self.wen(i).w if self.wen(i) else 0.0 for i in range(len(members))])
        self.peaks = {}

    def wen(self, i):
        """Return the Bouc-Wen law of a member, or None."""
        spring = self.springs[i][0]
        return spring if isinstance(spring, BoucWen) else None

    def derivatives(self, t, is_end, state, springs):
        """Return the rates of the state; `springs` are in the state of the start of the step and
        are moved. The first rate is the velocity.

        The second part of the state is the velocity plus the sum of the forces a1 f of the stories
        on each floor divided by its mass: its rate contains no tangent stiffness, which jumps.
        """
        u, velocity, braces, w = state
        structure = self.structure
        wen_laws = [self.wen(i) and springs[i][0] for i in range(len(structure.members))]
        forces = []
        v = velocity.copy()
        for i, member in enumerate(structure.members):
            if wen_laws[i]:
                wen_laws[i].w = w[i]
            for spring in springs[i]:
                spring.go(member.change(u))
            forces.append(sum(spring.f for spring in springs[i]))
            member.add(v, -member.tangent * forces[i] / structure.mass)
        total = structure.load(t, is_end) - structure.mass_part * v
        n = len(structure.modal)
        total[:n] -= structure.modal @ v[:n]
        brace_rates, w_rates = np.zeros_like(braces), np.zeros_like(w)
        for i, member in enumerate(structure.members):
            d, rate = member.change(u), member.change(v)
            if wen_laws[i]:
                w_rates[i] = wen_laws[i].rate(w[i], rate)
            force = forces[i] + member.gravity * d + member.viscous * rate
            damper = member.damper
            if damper and damper.brace:
                force += damper.factor * braces[i]
                brace_rates[i] = damper.brace * (damper.factor * rate - damper.rate(braces[i]))
            elif damper:
                force += damper.factor * damper.force(damper.factor * rate)
            member.add(total, np.full(len(u), -force))
        acceleration = np.linalg.solve(structure.inertia, total)
        return v, acceleration, brace_rates, w_rates

    def trial(self, t, h):
        """Return the state, the springs and the velocities after a step."""
        start = (self.u, self.velocity, self.forces, self.w)
        slopes = []
        for part in (0.0, 0.5, 0.5, 1.0):
            state = [x + part * h * slopes[-1][k] for k, x in enumerate(start)] if slopes else start
            springs = laws.copied(self.springs)
            slopes.append(self.derivatives(t + part * h, part == 1.0, state, springs))
        end = [
            x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
            for x, a, b, c, d in zip(start, *slopes, strict=True)
        ]
        springs = laws.copied(self.springs)
        return end, springs, self.derivatives(t + h, True, end, springs)[0]

    def advance(self, t, h):
        """Take a step; divide it where a spring fractures."""
        while True:
            end, springs, v = self.trial(t, h)
            broken = self.breaking(springs)
            part = h
            if broken:
                low, high = 0.0, h
                for _ in range(50):
                    part = 0.5 * (low + high)
                    if self.breaking(self.trial(t, part)[1]):
                        high = part
                    else:
                        low = part
                end, springs, v = self.trial(t, high)
                broken, part = self.breaking(springs), high
            (self.u, self.velocity, self.forces, self.w), self.springs = end, springs
            self.record(v)
            for spring in broken:
                spring.is_broken = True
            if not broken:
                return
            t, h = t + part, h - part

    def breaking(self, springs):
        """Return the springs beyond their fracture drift."""
        return [
            spring
            for group in springs
            for spring in group
            if isinstance(spring, Fracturing)
            and not spring.is_broken
            and abs(spring.x) > spring.limit
        ]

    def record(self, v):
        """Update the peak drifts (m) and damper forces (N) at the velocities `v` (m/s)."""
        for i, member in enumerate(self.structure.members):
            damper, values = member.damper, {"drift": member.change(self.u)}
            if damper:
                rate = damper.factor * member.change(v)
                values["damper_force"] = self.forces[i] if damper.brace else damper.force(rate)
            for name, value in values.items():
                key = f"{name} {member.name}"
                self.peaks[key] = max(self.peaks.get(key, 0.0), abs(value))


def read(value):
    """Return the values of a YAML file with numbers such as 4.0e7, which YAML 1.1 reads as text."""
    if isinstance(value, dict):
        return {key: read(item) for key, item in value.items()}
    if isinstance(value, list):
        return [read(item) for item in value]
    if isinstance(value, str) and value.lstrip("-")[:1].isdigit():
        return float(value)
    return value


def peaks(text, step=STEP):
    """Return the peaks of a model (YAML) by name: `drift 1` and `drift tank` (m), `damper_force 1`
    (N)."""
    model = read(yaml.safe_load(text))
    integration = Integration(Structure(model))
    for j in range(round(model["analysis"]["duration"] / step)):
        integration.advance(j * step, step)
    return integration.peaks


def cases():
    """Return the cases with a model, as mappings of the file."""
    return tomllib.loads(CASES.read_text(encoding="utf-8"))["feature"]


def main():
    for case in cases():
        if len(sys.argv) == 1 or case["name"] in sys.argv:
            found, finer = peaks(case["model"]), peaks(case["model"], 0.5 * STEP)
            print(case["name"])
            for key in case["quantities"]:
                change = finer[key] / found[key] - 1.0
                print(f"    {key:20} {found[key]:.12g}  {change:.1e}", flush=True)


if __name__ == "__main__":
    main()
