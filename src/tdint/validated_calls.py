"""Calls from Python: an argument of a wrong type raises an error that names the argument."""

from __future__ import annotations

import ast
import functools
import inspect
import numbers
import os
import re
import reprlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from tdint.errors import TdintError, UsageError

_ARGUMENT_ERRORS = (TypeError, ValueError, AttributeError, IndexError, OverflowError)
"""Errors that Python and numpy raise for an argument of a wrong type."""


class WrongCall(UsageError, TypeError):
    """Call with a missing or an unknown argument."""


@functools.cache
def validated_call(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """Wrap a public function so that errors name the argument of a wrong type.

    Arguments are compared with the signature only after the function has failed, because the
    comparison is slow. If every argument has the declared type, the failure is a bug of tdint, and
    its exception is raised unchanged.

    Parameters
    ----------
    name : str
        Its public name, for messages.
    """

    @functools.wraps(function)
    def wrapper(*arguments: Any, **keywords: Any) -> Any:
        """Call the function; convert an error that an argument causes to a UsageError, and name
        arguments instead of options in messages and notes."""
        try:
            result = function(*arguments, **keywords)
        except TdintError as error:
            error.args = tuple(in_python(text, function) for text in error.args)
            if "message" in vars(error):
                vars(error)["message"] = error.args[0]
            raise
        except _ARGUMENT_ERRORS as error:
            try:
                bound = inspect.signature(function).bind(*arguments, **keywords)
            except TypeError as binding_error:  # a missing or an unknown argument
                raise WrongCall(f"{name}: {binding_error}") from None
            # `_wrong_argument` returns None if all arguments are valid. Then the error is a bug of
            # tdint and is raised unchanged.
            raise _wrong_argument(name, bound) or error from error
        notes = getattr(result, "notes", ())
        if any(_OPTION.search(note) for note in notes):
            return replace(result, notes=tuple(in_python(note, function) for note in notes))
        return result

    # The wrapper gets the public name (`tdint.run`), because pickle imports it by name.
    wrapper.__module__, wrapper.__qualname__, wrapper.__name__ = "tdint", name, name
    return wrapper


_OPTION = re.compile(r"(?<![\w-])--(no-)?([a-z][a-z-]*)")


def in_python(text: str, function: Callable[..., Any]) -> str:
    """Return a message with the names of the arguments of a function instead of options.

    Other options, such as those of a command in the message, are unchanged.
    """
    parameters = inspect.signature(function).parameters

    def argument(option: re.Match[str]) -> str:
        """Return the argument of an option."""
        name = option[2].replace("-", "_")
        if name not in parameters:
            return option[0]
        return f"{name}=False" if option[1] else name

    return _OPTION.sub(argument, text)


def _wrong_argument(function: str, arguments: inspect.BoundArguments) -> UsageError | None:
    """Return an error for the first argument that does not match its annotation.

    If all arguments match, the error is for the first argument with an annotation such as `Any` or
    `AnyModel`: it matches every value, so that the value may still be the cause of the failure.
    Without such an argument, return None.
    """
    unchecked_error = None  # error for the first argument that matches every value
    for parameter in arguments.signature.parameters.values():
        if parameter.name not in arguments.arguments:  # the call did not pass this argument
            continue
        value = arguments.arguments[parameter.name]
        is_variadic = parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
        annotation = parameter.annotation
        annotation_text = (
            annotation if isinstance(annotation, str) else inspect.formatannotation(annotation)
        )
        expression = ast.parse(annotation_text, mode="eval").body
        # The value of *arguments is a tuple, the value of **keywords a dict; check their members.
        values = (
            value.values()
            if isinstance(value, dict) and is_variadic
            else value
            if is_variadic
            else (value,)
        )
        got = reprlib.repr(value)
        if not all(_matches(item, expression) for item in values):
            return UsageError(
                f"{function}: {parameter.name} must be {_as_text(expression)}, got {got}"
            )
        if unchecked_error is None and any(_accepts_any(part) for part in ast.walk(expression)):
            unchecked_error = UsageError(
                f"{function}: invalid value of {parameter.name}, got {got}"
            )
    return unchecked_error


def _accepts_any(annotation: ast.AST) -> bool:
    """Return True if the annotation accepts values that only the function can check.

    The names of such annotations start with `Any`: `Any`, `AnyModel`, `AnyRecord`, ...
    """
    return isinstance(annotation, ast.Name) and annotation.id.startswith("Any")


def _matches(value: Any, annotation: ast.expr) -> bool:
    """Return True if a value matches an annotation, or if the annotation cannot be checked.

    `annotation` is the parsed annotation of the parameter, such as `Sequence[float] | None`.
    """
    match annotation:
        case ast.BinOp():  # the operator | of a union
            return _matches(value, annotation.left) or _matches(value, annotation.right)
        case ast.Constant():  # None
            return value is annotation.value
        case ast.Subscript(value=ast.Name(id="tuple"), slice=ast.Tuple(elts=members)):
            return (
                isinstance(value, tuple)
                and len(value) == len(members)
                and all(map(_matches, value, members))
            )
        case ast.Subscript(value=ast.Name(id="Mapping")):
            return isinstance(value, Mapping)
        case ast.Subscript(value=ast.Name(id="Sequence" | "Iterable"), slice=member):
            # Texts and mappings are iterable in Python, but are not sequences of values here.
            # Members of a generator are not checked, because this would consume the generator.
            is_sequence = isinstance(value, Iterable) and not isinstance(
                value, str | bytes | Mapping
            )
            # An array without axes (a numpy number) is iterable by its type, but not in fact.
            is_sequence = is_sequence and getattr(value, "ndim", 1) > 0
            return is_sequence and (
                not hasattr(value, "__len__") or all(_matches(item, member) for item in value)
            )
        case ast.Subscript(value=ast.Name(id="NDArray")):
            return getattr(value, "ndim", 0) == 1
        case ast.Name(id="Array" | "Numbers"):
            has_one_axis = isinstance(value, list | tuple) or getattr(value, "ndim", 0) == 1
            return (
                has_one_axis
                and len(value) > 0
                and all(isinstance(item, numbers.Real) for item in value)
            )
        case ast.Name(id=name) if name in _SIMPLE_TYPES:
            # In Python, bool is a subclass of int; numpy's bool_ is not a subclass of bool.
            is_bool = type(value).__name__ in ("bool", "bool_")
            if name == "bool":
                return is_bool
            return isinstance(value, _SIMPLE_TYPES[name][0]) and not is_bool
        case ast.Name(id=name):
            # Types are compared by name, because modules imported for annotations only are not
            # loaded at run time. Aliases of callables, such as `Progress`, are not types, so any
            # callable is accepted.
            return (
                _accepts_any(annotation)
                or callable(value)
                or name in [item.__name__ for item in type(value).__mro__]
            )
    return True


_SIMPLE_TYPES: dict[str, tuple[tuple[type, ...], str]] = {
    "float": ((numbers.Real,), "a number"),
    "int": ((numbers.Integral,), "a whole number"),
    "bool": ((bool,), "True or False"),
    "str": ((str,), "a text"),
    "Path": ((os.PathLike,), "a path"),
}
"""Accepted types and description for messages, by the name in an annotation."""


def _as_text(annotation: ast.expr) -> str:
    """Return the description of an annotation for a message, such as `a number or None`."""
    match annotation:
        case ast.BinOp():
            return f"{_as_text(annotation.left)} or {_as_text(annotation.right)}"
        case ast.Subscript(value=ast.Name(id="Sequence" | "Iterable"), slice=member):
            return f"a sequence (each {_as_text(member)})"
        case ast.Name(id="Array" | "Numbers") | ast.Subscript(value=ast.Name(id="NDArray")):
            return "an array of numbers in one row"
        case ast.Name(id=name) if name in _SIMPLE_TYPES:
            return _SIMPLE_TYPES[name][1]
    return ast.unparse(annotation)
