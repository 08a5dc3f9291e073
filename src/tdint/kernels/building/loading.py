"""Loading of a function from an object file.

The file of a kernel contains one line of JSON that describes the object, and then the object.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from tdint.kernels.building.compilable import (
    HOOKS,
    LAWS_SYMBOL,
    Argument,
    ArrayOf,
    Scalar,
    Signature,
)
from tdint.kernels.building.target import machine

_FORMAT = "tdint object 3"
# C type and Python type of each number type of a signature
_NUMBERS = {"float64": (ctypes.c_double, float), "int64": (ctypes.c_int64, int)}


def pack(code: bytes, description: dict[str, Any]) -> bytes:
    """Return the contents of an object file: one line of JSON with the description, then the code.

    Parameters
    ----------
    description : dict
        Properties of the object: `symbol`, the name of the function of a kernel, or `properties` of
        a law, and others. The format and the SHA-256 of description and code are added.
    """
    description = {"format": _FORMAT, **description}
    return json.dumps({**description, "sha256": _hash(description, code)}).encode() + b"\n" + code


def unpack(data: bytes) -> tuple[bytes, dict[str, Any]]:
    """Return the code and its description from the contents of a file written by `pack`.

    The description contains the properties passed to `pack` and the format, without the hash.

    Raises
    ------
    ValueError, RecursionError
        The data have a different format, are truncated or corrupt, or a text that is nested too
        deeply for the JSON parser. A search for compiled kernels treats such a file as missing, so
        that the kernel is compiled again; the message is not printed.
    """
    first_line, _, code = data.partition(b"\n")
    description = json.loads(first_line)
    if not isinstance(description, dict) or description.get("format") != _FORMAT:
        raise ValueError("the data are not an object file compiled by tdint: other format")
    if description.pop("sha256", None) != _hash(description, code):
        raise ValueError("the object file is truncated or corrupt")
    return code, description


def _hash(description: dict[str, Any], code: bytes) -> str:
    """Return the SHA-256 of the description (as sorted JSON) and the code, in hexadecimal form."""
    return hashlib.sha256(
        json.dumps(description, sort_keys=True).encode() + b"\n" + code
    ).hexdigest()


_MAX_LAWS = 1000
"""Maximum number of laws in a process."""

_LAWS = (ctypes.c_int64 * (2 * _MAX_LAWS * (len(HOOKS) + 1)))()
"""Table of laws (`tdint.kernels.building.compilable.LAWS_SYMBOL`)."""
llvm.add_symbol(LAWS_SYMBOL, ctypes.addressof(_LAWS))


def load_law(code: float, data: bytes, properties: int) -> Any:
    """Load the object file of a law, and write its functions to the table of laws; return the
    engine that owns their memory.

    Raises
    ------
    RuntimeError, ValueError
        The object cannot be loaded, or does not contain all functions; or the number of the law
        `code` is too large.
    """
    engine = _engine(data)
    addresses = [engine.get_function_address(f"law.{name}") for name in HOOKS]
    if not all(addresses):
        raise ValueError("the object file does not contain all functions of the law")
    row, width = int(2 * code), len(HOOKS) + 1
    if row >= 2 * _MAX_LAWS:
        raise ValueError(f"more than {_MAX_LAWS} laws are registered")
    _LAWS[row * width : (row + 1) * width] = [*addresses, properties]
    return engine


def _engine(code: bytes) -> Any:
    """Load an object file; the returned engine owns its memory."""
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return engine


class Loaded:
    """Kernel in memory, called with numbers, arrays and other loaded kernels.

    The call uses the calling convention of numba: the address of the result, the address of an
    exception (kernels raise no exceptions), then the arguments, with arrays decomposed. The lock of
    the Python interpreter is released during the call.

    Raises
    ------
    TypeError
        The kernel is called with an array of a type or order that does not match the signature.
    ValueError
        The kernel is called with a wrong number of arguments.
    """

    def __init__(self, code: bytes, symbol: str, signature: Signature) -> None:
        """Load an object file into memory and prepare the calls of its function.

        Raises
        ------
        RuntimeError, ValueError
            The object cannot be loaded, or does not contain the function.
        """
        self._engine = _engine(code)
        self.address = self._engine.get_function_address(symbol)
        if not self.address:
            raise ValueError(f"the object file contains no function {symbol}")
        self._result_type: Any = _NUMBERS[signature.returns.name][0]
        self._arguments = signature.arguments
        self._converters = _converters(signature.arguments)

    def __call__(self, *arguments: Any) -> Any:
        """Call the kernel and return its result, a float or an int (`bind`)."""
        if len(arguments) != len(self._converters):
            raise ValueError(f"a kernel of {len(self._converters)} arguments got {len(arguments)}")
        return self.bind(*arguments)()

    def bind(self, *last: Any) -> Callable[..., Any]:
        """Return a function of the first arguments, which are numbers, that calls the kernel with
        the constant last arguments `last`.

        The last arguments are converted to C arguments only one time, and the first arguments are
        written to the same C numbers in each call: the conversion is most of the time of a call.

        Raises TypeError if an array does not match the signature, and ValueError if the number of
        arguments exceeds the signature. The function raises RuntimeError if the compiled function
        returns an error code.
        """
        first_count = len(self._converters) - len(last)
        converted = zip(self._converters[first_count:], last, strict=True)
        numbers: list[Any] = []
        for argument in self._arguments[:first_count]:
            assert isinstance(argument, Scalar)
            c_type, python_type = _NUMBERS[argument.name]
            numbers.append((c_type(), python_type))
        result, exception = self._result_type(), ctypes.c_void_p()
        # Results of `from_param` are passed unchanged, and faster than C numbers.
        arguments = (
            ctypes.byref(result),
            ctypes.byref(exception),
            *(number for number, _ in numbers),
            *(part for convert, argument in converted for part in convert(argument)),
        )
        # In the calling convention of numba, the result is an error code (0 without an error). The
        # first two arguments are the addresses for the result of the kernel and for a description
        # of an exception, which is not read. Without argument types, they are passed unchanged.
        function = ctypes.CFUNCTYPE(ctypes.c_int32)(self.address)

        def call(*first: Any) -> Any:
            """Call the kernel with its first arguments."""
            for (number, convert), value in zip(numbers, first, strict=True):
                number.value = convert(value)
            if function(*arguments):
                raise RuntimeError("a kernel raised an exception")
            return result.value

        call.arrays = last  # type: ignore[attr-defined]  # the addresses remain valid
        return call


def _converters(arguments: Sequence[Argument]) -> list[Callable[[Any], list[Any]]]:
    """Return for each argument of a kernel a function that returns the parts of its value as
    arguments of a C function.

    In the calling convention of numba, an array is passed as several numbers and addresses, its
    parts. A kernel is passed by its address.
    """
    converters: list[Callable[[Any], list[Any]]] = []
    for position, argument in enumerate(arguments, start=1):
        match argument:
            case ArrayOf(dimensions):
                converters.append(partial(_parts, dimensions, position))
            case Scalar(name):
                converters.append(partial(_number, *_NUMBERS[name]))
            case Signature():
                converters.append(lambda kernel: [ctypes.c_int64.from_param(kernel.address)])
    return converters


def _number(c_type: Any, python_type: Any, value: Any) -> list[Any]:
    """Return a number, converted to its Python type, as an argument of a C function."""
    return [c_type.from_param(python_type(value))]


def _parts(dimensions: int, position: int, array: Any) -> list[Any]:
    """Return the parts of an array argument that numba expects: meminfo, parent, number of items,
    bytes per item, address of the data, and one number per dimension for the shape and for the
    strides.

    `position` is the number of the argument in messages, counted from 1.

    Raises TypeError if the array is not a writable array of float64 in C order with the number of
    dimensions of the signature.
    """
    if array.dtype != np.float64 or array.ndim != dimensions or not array.flags.carray:
        access = "a writable" if array.flags.writeable else "a read-only"
        order = "in C order" if array.flags.c_contiguous else "not in C order"
        raise TypeError(
            f"argument {position} must be a writable array of float64 in C order with "
            f"{dimensions} dimensions, got {access} array of {array.dtype} {order} with "
            f"{array.ndim} dimensions; np.array(values, dtype=np.float64, order='C') is one"
        )
    # An empty array has no buffer. The first two parts, meminfo and parent, are not used.
    data = ctypes.addressof(ctypes.c_char.from_buffer(array)) if array.size else None
    address, integer = ctypes.c_void_p.from_param, ctypes.c_int64.from_param
    lengths = map(integer, (*array.shape, *array.strides))
    return [address(None), address(None), integer(array.size), integer(8), address(data), *lengths]
