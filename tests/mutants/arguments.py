"""Mutants of the arguments of the public functions (see `inputs.py`).

The public functions are replaced in the modules that define them, before the tests import them. An
argument without a default is only exchanged: without it the call is an error.
"""

import functools
import inspect
import sys
from collections.abc import Callable, Iterator
from types import FunctionType
from typing import Any

import tdint
from mutants.places import Mutant, Place


class Arguments:
    """Patch of `validated_calls.validated_call`; see `inputs.Inputs`."""

    def __init__(self) -> None:
        self.specified: set[Place] = set()
        self.mutant: Mutant | None = None
        for name, function in _functions():
            home = sys.modules[function.__module__]
            setattr(home, function.__name__, self._wrap(function, name))

    def _wrap(self, function: FunctionType, name: str) -> Callable[..., Any]:
        """Return a public function that records its arguments, and changes them."""
        signature = inspect.signature(function)

        @functools.wraps(function)
        def wrapper(*arguments: Any, **keywords: Any) -> Any:
            try:
                bound = signature.bind(*arguments, **keywords)
            except TypeError:
                return function(*arguments, **keywords)
            self.specified |= {(f"tdint.{name}", argument) for argument in bound.arguments}
            mutant = self.mutant
            if mutant is None or mutant.place[0] != f"tdint.{name}":
                return function(*arguments, **keywords)
            _change(bound.arguments, mutant)
            return function(*bound.args, **bound.kwargs)

        return wrapper

    def mutants(self) -> Iterator[Mutant]:
        """Yield the mutants of the arguments of all public functions."""
        for name, function in _functions():
            parameters = list(inspect.signature(function).parameters.values())
            for index, parameter in enumerate(parameters):
                place = f"tdint.{name}", parameter.name
                if parameter.default is not parameter.empty:
                    yield Mutant(place)
                similar = [
                    other.name
                    for other in parameters[index + 1 :]
                    if _kind(other) == _kind(parameter)
                ]
                if similar:
                    yield Mutant(place, similar[0])


def _functions() -> Iterator[tuple[str, FunctionType]]:
    """Yield the public names and the functions, without `validated_call`."""
    for name in tdint.__all__:
        function = getattr(tdint, name)
        if isinstance(function, FunctionType):
            yield name, inspect.unwrap(function, stop=lambda inner: inner.__module__ != "tdint")


def _change(arguments: dict[str, Any], mutant: Mutant) -> None:
    """Ignore an argument, or exchange it with another."""
    (_, name), receiver = mutant.place, mutant.receiver
    if name not in arguments:
        return
    value = arguments.pop(name)
    if receiver in arguments:
        arguments[name] = arguments[receiver]
    if receiver:
        arguments[receiver] = value


def _kind(parameter: inspect.Parameter) -> str:
    """Return the type of an argument, without None."""
    return str(parameter.annotation).removesuffix(" | None")
