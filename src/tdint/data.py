"""Classes of data whose methods are made when they are first called.

A command makes objects of a third of the classes that it imports; `dataclasses` compiles six methods for each, a fifth
of the time of `tdint run`. `dataclass` is that of `dataclasses`, whose fields and parameters it keeps: `fields`,
`replace`, `asdict`, `match`, pickling and `inspect.signature` see no difference.
"""

from __future__ import annotations

import dataclasses
from dataclasses import MISSING, FrozenInstanceError, fields
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(cls=None, /, *, frozen=False, eq=True, repr=True, kw_only=False):
        """As `dataclasses.dataclass`."""
        if cls is None:
            return lambda decorated: _with_methods(decorated, frozen, eq, repr, kw_only)
        return _with_methods(cls, frozen, eq, repr, kw_only)


def _with_methods(cls: Any, frozen: bool, eq: bool, repr: bool, kw_only: bool) -> Any:
    """The class with its fields, and what stands for its methods until they are called."""
    own = dict(cls.__dict__)
    cls = dataclasses.dataclass(cls, init=False, repr=False, eq=False, kw_only=kw_only)
    cls.__init__ = _Made(cls, "__init__", frozen)
    if repr and "__repr__" not in own:
        cls.__repr__ = _repr
    if eq and "__eq__" not in own:
        cls.__eq__ = _Made(cls, "__eq__", frozen)
    if eq and own.get("__hash__") is None:
        cls.__hash__ = _Made(cls, "__hash__", frozen) if frozen else None
    if frozen:  # `dataclasses` would compile these two for each class
        cls.__setattr__, cls.__delattr__ = _refuse_to_set, _refuse_to_delete
    return cls


class _Made:
    """Stands for a method until somebody asks for it."""

    def __init__(self, owner: type, name: str, frozen: bool) -> None:
        self._owner, self._name, self._frozen = owner, name, frozen

    def __get__(self, instance: object, owner: type | None = None) -> Any:
        method = self._owner.__dict__[self._name]
        if method is self:  # and no other thread has made it meanwhile
            make = {"__init__": _init, "__eq__": _eq, "__hash__": _hash}[self._name]
            method = make(self._owner, self._frozen)
            method.__module__ = self._owner.__module__
            method.__qualname__ = f"{self._owner.__qualname__}.{self._name}"
            setattr(self._owner, self._name, method)
        return method.__get__(instance, owner)


def _compiled(name: str, parameters: str, lines: list[str], names: dict[str, Any]) -> Any:
    made: dict[str, Any] = {}
    exec(f"def {name}({parameters}):\n " + "\n ".join(lines), names, made)
    return made[name]


class _Absent:
    """The default of what a factory makes, in signatures."""

    def __repr__(self) -> str:
        return "<factory>"


_ABSENT = _Absent()


def _init(cls: Any, frozen: bool) -> Any:
    """The `__init__` of a class: parameters in the order of its fields, those by name alone last."""
    names: dict[str, Any] = {"_set": object.__setattr__, "_absent": _ABSENT}
    parameters: dict[bool, list[str]] = {False: ["self"], True: []}
    lines = []
    for field in fields(cls):
        parameter, value = field.name, field.name
        if field.default is not MISSING:
            names[f"_default_{field.name}"] = field.default
            parameter += f"=_default_{field.name}"
        elif field.default_factory is not MISSING:
            names[f"_make_{field.name}"] = field.default_factory
            parameter += "=_absent"
            value = f"_make_{field.name}() if {field.name} is _absent else {field.name}"
        if field.init:
            parameters[bool(field.kw_only)].append(parameter)
        elif "=" not in parameter:
            continue
        else:
            value = (
                f"_default_{field.name}"
                if field.default is not MISSING
                else f"_make_{field.name}()"
            )
        lines.append(
            f"_set(self, {field.name!r}, {value})" if frozen else f"self.{field.name} = {value}"
        )
    if hasattr(cls, "__post_init__"):
        lines.append("self.__post_init__()")
    if parameters[True]:
        parameters[True].insert(0, "*")
    made = _compiled(
        "__init__", ", ".join(parameters[False] + parameters[True]), lines or ["pass"], names
    )
    made.__annotations__ = {field.name: field.type for field in fields(cls) if field.init} | {
        "return": None
    }
    return made


def _eq(cls: Any, _: bool) -> Any:
    compared = [field.name for field in fields(cls) if field.compare]
    both = (f"({''.join(f'{whose}.{name}, ' for name in compared)})" for whose in ("self", "other"))
    same = f"return {' == '.join(both)} if other.__class__ is self.__class__ else NotImplemented"
    return _compiled("__eq__", "self, other", [same], {})


def _hash(cls: Any, _: bool) -> Any:
    values = "".join(f"self.{field.name}, " for field in fields(cls) if field.compare)
    return _compiled("__hash__", "self", [f"return hash(({values}))"], {})


@recursive_repr()
def _repr(self: Any) -> str:
    told = ", ".join(
        f"{field.name}={getattr(self, field.name)!r}" for field in fields(self) if field.repr
    )
    return f"{self.__class__.__qualname__}({told})"


def _refuse_to_set(self: Any, name: str, value: object) -> None:
    raise FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_to_delete(self: Any, name: str) -> None:
    raise FrozenInstanceError(f"cannot delete field {name!r}")
