"""From an object file to a function that can be called.

The form of a kernel in a file: a line of JSON that describes the object, then the object.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
from collections.abc import Callable, Sequence
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from tdint.kernels.building.compilable import Argument, ArrayOf, Scalar, Signature
from tdint.kernels.building.target import machine

_FORM = "tdint object 2"
_LONGEST_HEAD = 4096  # bytes; ours have some hundred
_NUMBERS = {"float64": (ctypes.c_double, float), "int64": (ctypes.c_int64, int)}


def pack(code: bytes, about: dict[str, Any]) -> bytes:
    """An object and what is known about it, hashed together."""
    about = {"form": _FORM, **about}
    return json.dumps({**about, "sha256": _hash(about, code)}).encode() + b"\n" + code


def unpack(data: bytes) -> tuple[bytes, dict[str, Any]]:
    """What `pack` packed.

    Raises
    ------
    ValueError
        The data are something else, cut off or damaged.
    """
    head, _, code = data.partition(b"\n")
    if len(head) > _LONGEST_HEAD:  # deep enough it would exhaust the reader's stack
        raise ValueError("not an object of tdint")
    about = json.loads(head)
    if (
        not isinstance(about, dict)
        or about.get("form") != _FORM
        or not isinstance(about.get("symbol"), str)
    ):
        raise ValueError("not an object of tdint")
    if about.pop("sha256", None) != _hash(about, code):
        raise ValueError("cut off or damaged")
    return code, about


def _hash(about: dict[str, Any], code: bytes) -> str:
    return hashlib.sha256(json.dumps(about, sort_keys=True).encode() + b"\n" + code).hexdigest()


class Loaded:
    """A kernel in memory, called with numbers, arrays and other loaded kernels.

    numba's calling convention: where to put the result, where to put an exception (kernels raise
    none), then the arguments, arrays in parts. Python's lock is released during the call.

    Raises
    ------
    TypeError
        When called with an array of another type or order than the signature says.
    """

    def __init__(self, code: bytes, symbol: str, signature: Signature) -> None:
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine())
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        self.address = self._engine.get_function_address(symbol)
        if not self.address:
            raise ValueError(f"no {symbol} in the object")
        result_type: Any = _NUMBERS[signature.returns.name][0]
        types, self._parts = _parts(signature.arguments)
        self._result_type = result_type
        prototype = ctypes.CFUNCTYPE(
            ctypes.c_int32, ctypes.POINTER(result_type), ctypes.c_void_p, *types
        )
        self._function = prototype(self.address)

    def __call__(self, *arguments: Any) -> Any:
        flat: list[Any] = []
        for part, argument in zip(self._parts, arguments, strict=True):
            part(argument, flat)
        result = self._result_type()
        exception = ctypes.c_void_p()
        if self._function(result, ctypes.addressof(exception), *flat):
            raise RuntimeError("a kernel raised an exception")
        return result.value


def _parts(
    arguments: Sequence[Argument],
) -> tuple[list[Any], list[Callable[[Any, list[Any]], None]]]:
    """C types of the flat arguments, and for each argument what puts its parts into a list."""
    types: list[Any] = []
    parts: list[Callable[[Any, list[Any]], None]] = []
    for argument in arguments:
        match argument:
            case ArrayOf(dimensions):
                # meminfo, parent, number of items, bytes of an item, data, shape, strides
                types += [ctypes.c_void_p] * 2 + [ctypes.c_int64] * 2 + [ctypes.c_void_p]
                types += [ctypes.c_int64] * (2 * dimensions)
                parts.append(_table(dimensions))
            case Scalar(name):
                number, convert = _NUMBERS[name]
                types.append(number)
                parts.append(_number(convert))
            case Signature():
                types.append(ctypes.c_int64)
                parts.append(lambda kernel, flat: flat.append(kernel.address))
    return types, parts


def _table(dimensions: int) -> Callable[[Any, list[Any]], None]:
    number = np.dtype(np.float64)

    def put(array: Any, flat: list[Any]) -> None:
        if array.dtype != number or array.ndim != dimensions or not array.flags.carray:
            raise TypeError(
                f"a kernel takes an array of {dimensions} dimensions of float64 in C order that "
                f"can be written; got {array.ndim} of {array.dtype}"
            )
        # An array of nothing has no buffer.
        data = ctypes.addressof(ctypes.c_char.from_buffer(array)) if array.size else None
        flat += (None, None, array.size, 8, data, *array.shape, *array.strides)

    return put


def _number(convert: Callable[[Any], Any]) -> Callable[[Any, list[Any]], None]:
    return lambda value, flat: flat.append(convert(value))
