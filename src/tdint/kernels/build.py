"""A process that compiles kernels of one variant, one after the other: `python -P -m
tdint.kernels.build`.

A line of its standard input asks for one, as JSON: `["MODULE:KERNEL", FILE]`, where FILE is that of
a module that cannot be found by its name, else null. Its objects, for the targets that
TDINT_KERNELS_TARGETS names, go to standard output, each as `tdint.kernels.building.loading` packs
it, behind a line that tells how many bytes follow. What two kernels have in common is compiled
once. The process ends when its standard input does, so that none is left behind.
"""

from __future__ import annotations

import gc
import importlib
import importlib.util
import itertools
import json
import os
import sys
import threading
from contextlib import suppress
from dataclasses import replace
from queue import SimpleQueue
from types import SimpleNamespace
from typing import Any


def main() -> None:
    """Compile the kernels that are asked for."""
    # numba looks for SciPy's linear algebra, which kernels have no use for.
    sys.modules["scipy.linalg"] = None  # type: ignore[assignment]
    variant = os.environ["TDINT_KERNELS_VARIANT"]
    _add_laws(variant)

    from tdint.kernels.building.compiler import objects_of
    from tdint.kernels.building.loading import pack
    from tdint.kernels.building.store import identity
    from tdint.kernels.building.target import named

    with suppress(
        ImportError, AttributeError
    ):  # numba's insides may change: without shortcuts it takes longer
        _take_shortcuts()
    targets = [named(target) for target in os.environ["TDINT_KERNELS_TARGETS"].split(",")]
    # After the imports: on Windows numpy's would wait for the pipe that the thread reads.
    asked: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(asked,), daemon=True).start()
    while True:
        name, file = json.loads(asked.get())
        module_name, _, attribute = name.partition(":")
        kernel = getattr(
            _module(module_name, file) if file else importlib.import_module(module_name), attribute
        )
        codes, symbol = objects_of(kernel.function, kernel.signature, targets)
        for code, target in zip(codes, targets, strict=True):
            data = pack(code, {**identity(name, variant, target), "symbol": symbol})
            sys.stdout.buffer.write(b"%d\n" % len(data) + data)
        sys.stdout.buffer.flush()


def _take_shortcuts() -> None:
    """Spare numba what it does over and over, or for nothing: half of the time."""
    import numba.core.inline_closurecall as inlining
    from numba.core import bytecode, codegen, compiler, ir, ir_utils, types
    from numba.core.types.functions import BaseFunction

    # A function is read anew for each place where it is inlined; numba copies twice what it read.
    inlining.copy = SimpleNamespace(deepcopy=lambda block: block)
    # What an operator of numbers gives: numba tries all that might fit, and lists what does not.
    resolve = BaseFunction.get_call_type

    def resolve_once(
        self: Any, context: Any, arguments: tuple[Any, ...], named: dict[str, Any]
    ) -> Any:
        if named or not all(
            isinstance(argument, types.Number | types.Boolean) for argument in arguments
        ):
            return resolve(self, context, arguments, named)
        resolved = self.__dict__.setdefault("_resolved", {})
        key = arguments, tuple(map(type, arguments))
        if key not in resolved:
            resolved[key] = resolve(self, context, arguments, named)
        return resolved[key]

    setattr(BaseFunction, "get_call_type", resolve_once)  # noqa: B010 (a method, to mypy)
    # The variables of an instruction: mostly told by a type, of which the usual ones are asked for
    # first.
    others = ir.Inst._rec_list_vars

    def variables(self: Any, value: Any) -> list[Any]:
        kind = type(value)
        if kind is ir.Var:
            return [value]
        if kind is ir.Loc or kind is str:
            return []
        if kind is dict:
            return [variable for part in value.values() for variable in variables(self, part)]
        of_others: list[Any] = others(self, value)
        return of_others

    ir.Inst._rec_list_vars = variables
    # Labels and names of variables are numbered in each function from one on, not through all: what
    # was compiled before would show in the order of sets of names, and that in the code. Functions
    # are numbered through, so that no two have a symbol in common.
    number, labels, compile_one = (
        itertools.count(1),
        ir_utils._the_max_label,
        compiler.CompilerBase.compile_extra,
    )
    _ = (
        bytecode.FunctionIdentity._unique_ids,
        labels._value,
        ir_utils._unique_var_count,
    )  # or it is another numba

    def compile_apart(self: Any, function: Any) -> Any:
        identity = bytecode.FunctionIdentity
        outer = identity._unique_ids, labels._value, ir_utils._unique_var_count
        identity._unique_ids = itertools.chain([next(number)], itertools.count(1))
        labels._value, ir_utils._unique_var_count = 0, 0
        try:
            return compile_one(self, function)
        finally:
            identity._unique_ids, labels._value, ir_utils._unique_var_count = outer

    compiler.CompilerBase.compile_extra = compile_apart
    # Nothing is run here, so no part needs machine code in this process.
    codegen.JitEngine.finalize_object = lambda self: None
    codegen.JITCPUCodegen.set_env = lambda *_: None
    # Most of what numba makes stays.
    gc.freeze()
    gc.set_threshold(200_000, 20, 100)


def _module(name: str, file: str) -> Any:
    """The module in a file, under the name that it has in the process that wants the kernel."""
    if name not in sys.modules:
        specification = importlib.util.spec_from_file_location(name, file)
        assert specification is not None and specification.loader is not None
        sys.modules[name] = importlib.util.module_from_spec(specification)
        specification.loader.exec_module(sys.modules[name])
    return sys.modules[name]


def _add_laws(variant: str) -> None:
    """Put the laws of plug-ins that a variant names at their numbers, before what goes by the laws
    is imported."""
    from tdint.kernels.building.compilable import parse
    from tdint.kernels.building.sources import OUTSIDE
    from tdint.kernels.laws import LAWS, linear
    from tdint.kernels.laws.law import DriftLaw

    files = json.loads(os.environ.get("TDINT_KERNELS_PLUGINS", "{}"))
    for name, code in parse(variant).outside.items():
        LAWS.extend([replace(linear.LAW, name="")] * (code + 1 - len(LAWS)))
        values = list(vars(_module(*files[name])).values())
        values += [
            member for value in values if isinstance(value, tuple | list) for member in value
        ]
        OUTSIDE[name] = files[name][0]
        LAWS[code] = next(law for law in values if isinstance(law, DriftLaw) and law.name == name)


def _listen(asked: SimpleQueue[bytes]) -> None:
    """Take what is asked for; who asks may end at any time, and the process with it."""
    text = b""
    while new := os.read(
        0, 4096
    ):  # not sys.stdin, whose lock a thread must not hold when Python ends
        *lines, text = (text + new).split(b"\n")
        for line in lines:
            asked.put(line)
    os._exit(0)


if __name__ == "__main__":
    main()
