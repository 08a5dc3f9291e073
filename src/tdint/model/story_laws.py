"""Hysteretic laws by name, built-in and of plug-ins, and the law of a story with its parameters."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass
from functools import cache
from typing import Any

from tdint.errors import UsageError
from tdint.kernels.laws import LAWS as _LAWS
from tdint.kernels.laws.law import DriftLaw, LawParameter
from tdint.model import plugins

CODES: dict[str, int] = {name: code for code, name in enumerate(_LAWS.names())}
"""Number of each law in the tables of the kernels."""


class _LawsByName(Mapping[str, DriftLaw]):
    """Laws by name. A law is imported when it is first used."""

    def __getitem__(self, name: str) -> DriftLaw:
        """Return the law with a name, and import it if necessary."""
        law: DriftLaw = _LAWS[CODES[name]]
        return law

    def __iter__(self) -> Iterator[str]:
        return iter(CODES)

    def __len__(self) -> int:
        return len(CODES)


LAWS: Mapping[str, DriftLaw] = _LawsByName()
"""Hysteretic laws by the name in a model file: laws of `tdint.kernels.laws` and of plug-ins."""


def register_law(law: DriftLaw, where: str | plugins.Origin = "") -> None:
    """Register a hysteretic law, so that models can use it.

    The law is compiled into the time loops of the models that contain it. Its functions must be
    defined in a module with a file. The module, or the module of the plug-in that lists the law,
    must contain the law as a variable, or in a tuple, list, set or dictionary, so that the
    compiling process can import the law.

    Parameters
    ----------
    law : DriftLaw
        See `tdint.kernels.laws.law`.
    where : str or Origin
        Origin of the law for messages. Default: its name.

    Raises
    ------
    UsageError
        The argument is not a law, its name is invalid or in use, it has no file, or `kinked` does
        not agree with its functions.
    """
    if not isinstance(law, DriftLaw):
        raise UsageError(
            f"{where or law!r}: a law must be a tdint.plugin.DriftLaw, not {type(law).__name__}"
        )
    origin = (
        where if isinstance(where, plugins.Origin) else plugins.Origin(where or f"law {law.name!r}")
    )
    where = origin.where
    plugins.check_name(law.name, LAWS, "law", where)
    module_name = law.functions.__module__
    if module_name == "__main__" or getattr(sys.modules.get(module_name), "__file__", None) is None:
        raise UsageError(
            f"{where}: the law must be defined in a module file, so that other processes can "
            "import it"
        )
    # The other declarations are verified before the first run, with the parameters of the model.
    with plugins.faults_of(where):
        has_branches = law.functions().switch is not None
    if has_branches != law.kinked:
        raise UsageError(
            f"{where}: law {law.name} must declare `kinked=True` if and only if it has branches; "
            + (
                "it has `switch`: declare `kinked=True`"
                if has_branches
                else "it has no `switch`: add `switch` and `enter`, or declare only `curved=True`"
            )
        )
    # Imported here, because commands without plug-ins do not need this module.
    from tdint.kernels.building.sources import OUTSIDE, module_of_law

    # The compiling process imports the law from the module in `OUTSIDE`. The number of the
    # law is its index in `_LAWS`.
    OUTSIDE[law.name] = module_of_law(law, (module_name, origin.module))
    CODES[law.name] = len(_LAWS)
    _LAWS.append(law)
    origin.keep_code("law", law)


@cache
def laws() -> Mapping[str, DriftLaw]:
    """Return all hysteretic laws by name, also from entry points `tdint.laws`."""

    def register(plugin: Any, origin: plugins.Origin) -> None:
        """Register the laws of an entry point."""
        for law in plugins.declared(plugin, "LAWS", DriftLaw, origin.where):
            register_law(law, origin)

    plugins.installed("tdint.laws", register)
    return LAWS


@dataclass(frozen=True)
class Law:
    """Hysteretic law of a story with its parameters.

    Attributes
    ----------
    name : str
        A key of `LAWS`.
    parameters : tuple of float
        Values in SI units in the order of `LAWS[name].parameters`. A `many` parameter is the last
        one and is flattened. The last parameters may be omitted if they have defaults.
    fracture : tuple of float
        Drifts where the law loses its force permanently, m: positive and negative; 0 without
        fracture.
    fracture_ratio : tuple of float
        The same drifts over the story height, which they follow; 0 for a drift that is a length.
    """

    name: str
    parameters: tuple[float, ...]
    fracture: tuple[float, float] = (0.0, 0.0)
    fracture_ratio: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Append the defaults of parameters that are omitted at the end."""
        declared_parameters = LAWS[self.name].parameters if self.name in LAWS else ()
        if any(item.many for item in declared_parameters):
            return
        values = list(self.parameters)
        by_name: dict[str, Any] = {}
        first = 0
        for item in declared_parameters:
            end = first + (2 * item.points or 1)
            if end > len(values):
                numbers = default_numbers(item, by_name)
                if first < len(values) or numbers is None:
                    return
                values += numbers
            by_name.setdefault(item.name, tuple(values[first:end]))
            first = end
        object.__setattr__(self, "parameters", tuple(values))

    @property
    def values(self) -> dict[str, float]:
        """Parameters by the names that `vary` accepts after `stories[N].law.`, in SI units.

        Names instead of numbers and points that the model does not specify are omitted.
        """
        return {
            name: value
            for (name, _, _, declaration), value in zip(
                named_parameters(self), self.parameters, strict=True
            )
            if not (declaration.choices or (declaration.open_ended and math.isinf(value)))
        }

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the function that restores the pickled law in another process, and its arguments.

        A law of a plug-in is pickled with the path and the SHA-256 of the plug-in, so that the
        other process can load it.
        """
        plugin = plugins.home_of(LAWS.get(self.name), "LAWS")
        if plugin:
            path, digest = plugin
            code = CODES[self.name]
            return _restore_law, (astuple(self), code, path, digest)
        return Law, tuple(astuple(self))


def _restore_law(fields: tuple[Any, ...], code: int, file: str, digest: str) -> Law:
    """Restore a law of a plug-in in another process, and load the plug-in (path `file`, SHA-256
    `digest`) if necessary.

    Raises
    ------
    UsageError
        The plug-in is missing or has changed; this process uses another version of the law; or the
        law does not have the number `code` in this process, because plug-ins were loaded in another
        order.
    """
    name = fields[0]
    if name in LAWS:
        plugins.require_version(LAWS[name], "LAWS", file, digest)
    else:
        module = plugins.module_of(plugins.same_file(file, digest))
        for law in plugins.declared(module, "LAWS", DriftLaw, file):
            register_law(law, plugins.Origin(file, module.__name__))
    if CODES[name] != code:
        raise UsageError(
            f"{file}: the law {name!r} of this plug-in is number {CODES[name]} of the laws in this "
            f"process, but number {code} in the process that created the model; load all plug-ins "
            "in the same order in every process"
        )
    return Law(*fields)


def default_numbers(
    parameter: LawParameter, earlier: Mapping[str, tuple[float, ...]]
) -> tuple[float, ...] | None:
    """Return the default of a parameter that is omitted, or None if it is required.

    `earlier` contains the numbers of the parameters before it, by name.
    """
    default = parameter.without if parameter.default is None else parameter.default
    if default is None:
        return None
    if parameter.choices:
        return (float(parameter.choices.index(str(default))),)
    if isinstance(default, str):
        return earlier[default]
    return (default,) * (2 * parameter.points or 1)


def of_samples(function: Callable[[Sequence[float]], Any], *numbers: Any) -> Any:
    """Return a function of a sequence of numbers, or its results for all samples as an array.

    In a building of many samples (`Model.changed`), numbers are arrays over the samples. The
    functions of a law are for single numbers, and arrays would change the last bits of powers.
    """
    if not any(getattr(number, "shape", ()) for number in numbers):
        return function(numbers)
    import numpy as np  # not needed to read a model

    columns = np.broadcast_arrays(*numbers)
    return np.array(list(map(function, zip(*(column.tolist() for column in columns), strict=True))))


LINEAR = Law("linear", ())

SUM_OF_ELEMENTS = Law("elements", ())
"""Value of `Story.law` of a story with several elements. It is not a law: its name is not a key of
`LAWS`, so that a function that ignores the elements fails."""


def four_points(points: Sequence[Sequence[float]]) -> tuple[float, ...]:
    """Complete a backbone curve of two to four points to four points, without changing the curve.

    The points are added as in the vulnerability toolkit of GEM: to two points, points at 1/3 and
    2/3 between the two; to three points, the midpoint of the last two.

    Parameters
    ----------
    points : sequence of (float, float)
        Drift and force of each point, in any units.

    Returns
    -------
    tuple of eight floats
        Drift and force of the first point, of the second point, and so on.
    """
    (*first_points, second_last, last) = points
    added_count = 4 - len(points)
    fractions = [j / (added_count + 1) for j in range(1, added_count + 1)]
    # Interpolate drift and force linearly between the last two points.
    added_points = [
        [a + fraction * (b - a) for a, b in zip(second_last, last, strict=True)]
        for fraction in fractions
    ]
    return tuple(
        number for point in (*first_points, second_last, *added_points, last) for number in point
    )


_POINT_DIMENSIONS = {"drift": (0, 1), "force": (1, 0)}  # exponents of force and length


def named_parameters(law: Law) -> list[tuple[str, int, float, LawParameter]]:
    """Return for each number in the parameters of a law its name, the exponents of force and length
    in its unit, and the declaration of the parameter. Numbers of a list or of points have an index
    in the name, such as `backbone[1].drift`.
    """
    numbers: list[tuple[str, int, float, LawParameter]] = []
    for parameter in LAWS[law.name].parameters:
        path = parameter.path
        if parameter.points:
            numbers += [
                (f"{path}[{k}].{coordinate}", *dimension, parameter)
                for k in range(1, parameter.points + 1)
                for coordinate, dimension in _POINT_DIMENSIONS.items()
            ]
        elif parameter.many:
            # A list is the last parameter, so that it contains all remaining numbers. Number k is
            # the coefficient of drift^k and has the unit force / length^k.
            count = len(law.parameters) - len(numbers)
            numbers += [(f"{path}[{k}]", 1, -k, parameter) for k in range(1, count + 1)]
        else:
            numbers.append((path, parameter.force, parameter.length, parameter))
    return numbers
