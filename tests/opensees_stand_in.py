"""Stand-in for OpenSees that follows its manual for the commands of tdint and masses in a row, for
machines without OpenSees."""
# ruff: noqa: N802 (its names)

from pathlib import Path
from typing import ClassVar

import numpy as np


class Domain:
    """Masses in a row, springs and dashpots between them, loads, and time steps."""

    recorded: ClassVar = {}

    def constraints(self, *_):
        """Ignore commands that do not change results."""

    numberer = system = constraints

    def wipe(self):
        for file, rows in self.recorded.items():
            Path(file).write_bytes(b"".join(row.tobytes() + b"\n" for row in rows))
        self.masses, self.materials, self.series, self.applied, self.recorded = {}, {}, {}, [], {}
        self.links = []
        self.nodes, self.time, self.ground = 0, 0.0, lambda t: 0.0

    def model(self, *arguments):
        assert arguments == ("basic", "-ndm", 1, "-ndf", 1)

    def node(self, tag, x):
        assert (tag, x) == (self.nodes, 0.0)
        self.motion = np.zeros((3, tag))
        self.nodes += 1

    def fix(self, *arguments):
        assert arguments == (0, 1)

    def mass(self, tag, value):
        self.masses[tag] = value

    def uniaxialMaterial(self, material, tag, *numbers):
        self.materials[tag] = (material, *numbers)

    def element(self, element_type, tag, first, second, *arguments):
        at = arguments.index("-dir")
        assert (element_type, first) == ("zeroLength", second - 1) and self.nodes > second
        assert arguments[0] == "-mat" and arguments[at:] == (
            "-dir",
            1,
            "-doRayleigh",
            int(tag == second),
        )
        if tag == second:
            self.links.append([])
        self.links[second - 1].append(self.materials[arguments[1]])

    def recorder(self, recorder_type, form, file, word, *arguments):
        if recorder_type == "Element":
            assert (form, word, arguments[-3:]) == ("-binary", "-ele", ("material", "1", "stress"))
            assert arguments[:-3] == tuple(range(1, self.nodes))
            self.recorded[file] = []
            return
        assert (recorder_type, form, word, arguments[:-1]) == (
            "Node",
            "-binary",
            "-node",
            (*range(1, self.nodes), "-dof", 1),
        )
        self.recorded[file] = []

    def rayleigh(self, mass, current, initial, committed):
        assert current == committed == 0.0
        self.proportions = mass, initial

    def timeSeries(self, series_type, tag, *arguments):
        options = {
            word: arguments[i + 1 :] for i, word in enumerate(arguments) if isinstance(word, str)
        }
        if series_type == "Path":
            values = np.array(options["-values"])
            self.series[tag] = lambda t: np.interp(
                t, options["-dt"][0] * np.arange(values.size), values
            )
        elif series_type == "Constant":
            self.series[tag] = lambda t: options["-factor"][0]
        else:
            (start, end, period), (size,), (shift,) = (
                arguments[:3],
                options["-factor"][:1],
                options["-shift"],
            )
            self.series[tag] = lambda t: (
                size * np.sin(2.0 * np.pi * (t - start) / period + shift) * (t <= end)
            )

    def pattern(self, pattern_type, tag, *arguments):
        self.loading = arguments[0]
        if pattern_type == "UniformExcitation":
            assert arguments[:2] == (1, "-accel")
            self.ground = self.series[arguments[2]]

    def load(self, tag, size):
        self.applied.append((tag - 1, size, self.series[self.loading]))

    def __getattr__(self, name):
        """Return functions such as `nodeDisp(node, 1)` and `setNodeVel(node, 1, value,
        "-commit")`."""
        if name.startswith("__"):  # import statements of Python 3.13 read `__spec__`
            raise AttributeError(name)
        row = next(
            i for i, quantity in enumerate(("Disp", "Vel", "Accel")) if name.endswith(quantity)
        )
        if name.startswith("set"):
            return lambda tag, direction, value, _: self.motion.__setitem__(
                (row, tag - direction), value
            )
        return lambda tag, direction: self.motion[row, tag - direction]

    def test(self, test_type, tolerance, most):
        self.tolerance, self.most = tolerance, most

    def testIter(self):
        return self.iterations

    def algorithm(self, algorithm_type, *_):
        self.one_solve = algorithm_type == "Linear"

    def integrator(self, scheme_name, *numbers):
        """Set the weights of the end of the step for inertia and other forces, beta and gamma."""
        if scheme_name == "Newmark":
            self.scheme = 1.0, 1.0, numbers[1], numbers[0]
        else:
            inertia, other = (1.0, *numbers) if scheme_name == "HHT" else numbers
            self.scheme = inertia, other, 0.25 * (1.0 + inertia - other) ** 2, 0.5 + inertia - other

    def analysis(self, kind):
        """Create the matrices and the initial state of the springs after the definition of the
        model."""
        self.m = np.array([self.masses[tag] for tag in range(1, self.nodes)])
        self.drifts = np.eye(self.m.size) - np.eye(self.m.size, k=-1)
        steel = [
            numbers if kind == "Steel01" else (np.inf, *numbers, 0.0)
            for (kind, *numbers), *_ in self.links
        ]
        self.yields, self.k, self.hardening = np.array(steel).T
        dashpots, beside = (
            np.array(
                [
                    sum(size[0] for kind, *size in link[1:] if kind == material)
                    for link in self.links
                ]
            )
            for material in ("Viscous", "Elastic")
        )
        self.geometric = self.drifts.T @ np.diag(beside) @ self.drifts
        alpha, beta = self.proportions
        self.c = (
            alpha * np.diag(self.m)
            + self.drifts.T @ np.diag(dashpots + beta * self.k) @ self.drifts
        )
        self.inner = self.springs(self.drifts @ self.motion[0], 0.0 * self.m, 0.0 * self.m)[1]

    def springs(self, drift, before, inner):
        """Return forces, N, inelastic forces, N, and tangents, N/m, of the springs.

        Parameters
        ----------
        drift, before : ndarray
            Drifts now and at the start of the step, m.
        inner : ndarray
            Inelastic forces at the start of the step, N.
        """
        soft, limit = (1.0 - self.hardening) * self.k, (1.0 - self.hardening) * self.yields
        tried = inner + soft * (drift - before)
        inner = np.clip(tried, -limit, limit)
        return (
            self.hardening * self.k * drift + inner,
            inner,
            self.hardening * self.k + soft * (abs(tried) < limit),
        )

    def analyze(self, count, h):
        return next((code for code in (self.step(h) for _ in range(count)) if code), 0)

    def step(self, h):
        """Compute a step of h seconds by Newmark, with equilibrium at weighted times."""
        inertia, other_weight, beta, gamma = self.scheme
        u0, v0, a0 = self.motion
        at = self.time + other_weight * h
        load = -self.m * self.ground(at)
        for floor, size, series in self.applied:
            load[floor] += size * series(at)
        u, before = u0.copy(), self.drifts @ u0
        for solves in range(self.most + 1):
            a = (u - u0 - h * v0) / (beta * h * h) - (0.5 / beta - 1.0) * a0
            v = v0 + h * ((1.0 - gamma) * a0 + gamma * a)
            shear, _, tangent = self.springs(
                self.drifts @ (u0 + other_weight * (u - u0)), before, self.inner
            )
            out = (
                load
                - self.m * (a0 + inertia * (a - a0))
                - self.c @ (v0 + other_weight * (v - v0))
                - self.drifts.T @ shear
            )
            out -= self.geometric @ (u0 + other_weight * (u - u0))
            if solves and (self.one_solve or np.linalg.norm(out) <= self.tolerance):
                break
            matrix = (
                inertia / (beta * h * h) * np.diag(self.m)
                + other_weight * gamma / (beta * h) * self.c
            )
            tangent = self.drifts.T @ np.diag(tangent) @ self.drifts + self.geometric
            u = u + np.linalg.solve(matrix + other_weight * tangent, out)
        else:
            return -3
        shear, self.inner, _ = self.springs(self.drifts @ u, before, self.inner)
        self.motion, self.time, self.iterations = np.array([u, v, a]), self.time + h, solves
        for file, row in zip(
            self.recorded, (*self.motion, shear), strict=False
        ):  # in the order of disp, vel, accel, stress
            self.recorded[file].append(row)
        return 0
