"""Process that compiles kernels of a single form, and laws: `python -P -m tdint.kernels.build`.

Each line of the standard input requests an object as JSON: `["MODULE:KERNEL", FORM, FILE]`, or a
law by `MODULE:law.NAME`. FILE is the
file of a module that cannot be imported by its name, and null otherwise. The object files for the
targets in TDINT_KERNELS_TARGETS are written to the standard output, in the format of
`tdint.kernels.building.loading`, each after a line with the number of its bytes. Code that several
kernels share is compiled one time. The process ends when its standard input is closed, so that no
process remains.
"""

from __future__ import annotations

import functools
import gc
import importlib
import importlib.util
import inspect
import itertools
import json
import os
import sys
import threading
from contextlib import suppress
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tdint.kernels.laws.law import DriftLaw


def main() -> None:
    """Compile the kernels that the standard input requests, and write them to the standard output.

    Text that a plug-in prints is written to the standard error output. The function does not
    return. The thread that executes `_listen` ends the process when the standard input is closed.
    An error ends the process with a traceback.
    """
    # The standard output contains only object files.
    output = sys.stdout.buffer
    sys.stdout = sys.stderr
    # numba imports SciPy's linear algebra, which kernels do not use.
    sys.modules["scipy.linalg"] = None  # type: ignore[assignment]

    from tdint.kernels.building.compilable import LAW_PREFIX
    from tdint.kernels.building.compiler import objects_of, objects_of_law
    from tdint.kernels.building.loading import pack
    from tdint.kernels.building.store import identity
    from tdint.kernels.building.target import named
    from tdint.kernels.laws.hooks import hooks_of, properties

    # Internals of numba can change. Without the shortcuts the compilation is slower.
    with suppress(ImportError, AttributeError):
        _take_shortcuts()
    targets = [named(target) for target in os.environ["TDINT_KERNELS_TARGETS"].split(",")]
    # On Windows the import of numpy would wait for the pipe that the thread reads.
    requests: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(requests,), daemon=True).start()
    while True:
        name, form, file = json.loads(requests.get())
        module_name, _, attribute = name.partition(":")
        module = _module(module_name, file) if file else importlib.import_module(module_name)
        if attribute.startswith(LAW_PREFIX):
            law = _law(module, attribute.removeprefix(LAW_PREFIX))
            codes = objects_of_law(hooks_of(law), targets)
            about: dict[str, Any] = {"properties": properties(law)}
        else:
            kernel = getattr(module, attribute)
            codes, symbol = objects_of(kernel.function, kernel.signature, targets)
            about = {"symbol": symbol}
        for code, target in zip(codes, targets, strict=True):
            data = pack(code, {**identity(name, form, target), **about})
            output.write(b"%d\n" % len(data) + data)
        output.flush()


def _take_shortcuts() -> None:
    """Replace functions of numba to avoid repeated and unnecessary work.

    The replacements halve the compile time. They also make the object code independent of the
    kernels that the process has compiled before: labels and variables are numbered separately in
    each function. `tdint.kernels.building.compiler.objects_of` renames the symbols of functions.
    """
    from numba.core import bytecode, codegen, compiler, cpu, ir_utils, types
    from numba.core.types.functions import BaseFunction

    # numba would try all candidates and format an error for each mismatch.
    resolve_call = BaseFunction.get_call_type

    def resolve_once(
        self: Any, context: Any, arguments: tuple[Any, ...], named: dict[str, Any]
    ) -> Any:
        """Return the numba signature of a call from the cache, or determine and store it.

        The method replaces `BaseFunction.get_call_type`. Only calls with positional arguments that
        are numbers are stored. The key contains the argument types and, as a safeguard, their
        classes: a constant (literal type) and a variable of the same number type must have separate
        entries.
        """
        if named or not all(
            isinstance(argument, types.Number | types.Boolean) for argument in arguments
        ):
            return resolve_call(self, context, arguments, named)
        resolved = self.__dict__.setdefault("_resolved", {})
        key = arguments, tuple(map(type, arguments))
        if key not in resolved:
            resolved[key] = resolve_call(self, context, arguments, named)
        return resolved[key]

    # mypy does not allow an assignment to a method.
    setattr(BaseFunction, "get_call_type", resolve_once)  # noqa: B010
    # With a common numbering, previously compiled functions would affect the order of sets of names
    # and therefore the code. Functions are numbered consecutively in the process, so that no two
    # functions have a common symbol.
    function_numbers = itertools.count(1)
    compiling: list[Any] = []  # functions, each called by the one before
    labels = ir_utils._the_max_label
    compile_one = compiler.CompilerBase.compile_extra
    # In a version of numba without these attributes, AttributeError is raised here. The separate
    # numbering and the replacements below are then omitted. The replacement above remains.
    _ = bytecode.FunctionIdentity._unique_ids, labels._value, ir_utils._unique_var_count

    def compile_separately(self: Any, function: Any) -> Any:
        """Compile a function with a numbering of its labels and variables that starts at zero.

        The method replaces `compile_extra` of the compiler of numba (`self`).
        """
        # While numba compiles a function, it also compiles the functions that it calls, with this
        # method.
        identity = bytecode.FunctionIdentity
        numbering_of_caller = identity._unique_ids, labels._value, ir_utils._unique_var_count
        # The first number is part of the symbol of `function` and must be unique in the process.
        # The other numbers are for functions that are inlined into `function` and have no symbol.
        identity._unique_ids = itertools.chain([next(function_numbers)], itertools.count(1))
        labels._value, ir_utils._unique_var_count = 0, 0
        compiling.append(function)
        try:
            return compile_one(self, function)
        finally:
            compiling.pop()
            identity._unique_ids, labels._value, ir_utils._unique_var_count = numbering_of_caller

    compiler.CompilerBase.compile_extra = compile_separately
    set_options = cpu.CPUTargetOptions.finalize

    def copy_of_numba(self: Any, flags: Any, options: Any) -> None:
        """Complete the options of a function; replaces `finalize` of the options (`self`).

        Functions of numba, such as `max`, do not specify this option. They would inherit it from
        the first function of the process that calls them.
        """
        if not flags.is_set("forceinline"):
            flags.forceinline = True
        set_options(self, flags, options)

    cpu.CPUTargetOptions.finalize = copy_of_numba
    optimize = codegen.CPUCodeLibrary._optimize_final_module

    def optimize_whole(self: Any) -> None:
        """Optimize the module of a function that no other function waits for: it contains the code
        of all functions that are called, each of which would otherwise be optimized again in each
        module that contains it.

        The method replaces `_optimize_final_module` of the modules of numba (`self`).
        """
        if len(compiling) <= 1:
            optimize(self)

    codegen.CPUCodeLibrary._optimize_final_module = optimize_whole
    # No code is executed in this process, and modules are not registered for their execution.
    codegen.CPUCodeLibrary._finalize_final_module = lambda self: setattr(self, "_finalized", True)
    codegen.JITCPUCodegen.set_env = lambda *_: None
    _omit_passes()
    # Most objects that numba creates remain in use until the process ends.
    gc.disable()


def _omit_passes() -> None:
    """Let numba execute its passes without events, time measurements, repeated tests, the lifetimes
    of variables, and repeated sizes of types."""
    import llvmlite.binding as llvm
    from llvmlite import ir as llvmlite_ir
    from numba.core import compiler, compiler_machinery, postproc, transforms

    unfinished = compiler.StateDict(func_ir=None, flags=compiler.Flags())
    passes = compiler.DefaultPassBuilder.define_nopython_pipeline(unfinished)

    def run_pass(self: Any, _: int, executed: Any, state: Any) -> None:
        """Execute a pass; replaces `_runPass` of the pass manager (`self`)."""
        executed.analysis = self._analysis
        # Most functions contain no function that could be copied into them.
        is_needed = executed.name() != "inline_closure_likes" or any(
            map(inspect.iscode, state.func_id.code.co_consts)
        )
        if is_needed and executed.run_pass(state):
            postproc.PostProcessor(state.func_ir).run()

    def order_blocks(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
        """Order the blocks of a function; replaces `run` of the post-processor (`self`), which also
        marks the ends of the lifetimes of variables, for the counting of references."""
        self.func_ir.blocks = transforms.canonicalize_cfg(self.func_ir.blocks)

    # llvmlite parses a module each time it is asked for the size of a type.
    size = functools.cache(llvmlite_ir.Type.get_abi_size)
    llvmlite_ir.Type.get_abi_size = lambda self, data, context=None: size(self, data)
    compiler.DefaultPassBuilder.define_nopython_pipeline = lambda state: passes
    compiler_machinery.PassManager._runPass = run_pass
    postproc.PostProcessor.run = order_blocks
    llvm.ffi.lib._lock._cblist.clear()  # events of a lock that no other thread uses


def _module(name: str, file: str) -> Any:
    """Return the module in a file, loaded under the name that it has in the requesting process.

    The package of the module is imported first, because it can import the module. An
    exception of the module ends this process (`main`), so that an incompletely executed module is
    never used.
    """
    if package := name.rpartition(".")[0]:
        try:
            importlib.import_module(package)
        except ModuleNotFoundError as error:
            # The module can belong to a package that is not found by its name. It is then executed
            # without its package.
            if not f"{package}.".startswith(f"{error.name}."):
                raise
    if name not in sys.modules:
        specification = importlib.util.spec_from_file_location(name, file)
        assert specification is not None and specification.loader is not None
        sys.modules[name] = importlib.util.module_from_spec(specification)
        specification.loader.exec_module(sys.modules[name])
    return sys.modules[name]


def _law(module: Any, name: str) -> DriftLaw:
    """Return a law of a module, or the law that follows it until it fractures.

    The law must be a global variable of the module, or be in a global tuple, list, set or
    dictionary (`laws_in`); otherwise SystemExit with a message of one line ends the process.
    """
    from tdint.kernels.building.sources import FRACTURES, laws_in
    from tdint.kernels.laws.fracture import fracturing

    whole = name.removesuffix(FRACTURES)
    law = next((law for law in laws_in(module) if law.name == whole), None)
    if law is None:
        raise SystemExit(
            f"law {whole!r} not found in {module.__file__}; assign it to a variable of this "
            "module, or list it in the tuple LAWS of a plug-in"
        )
    return law if name == whole else fracturing(law)


def _listen(requests: SimpleQueue[bytes]) -> None:
    """Put the lines of the standard input into a queue; end the process with exit code 0, also if
    it is compiling, when the standard input is closed.
    """
    incomplete_line = b""  # without a line break until now
    # sys.stdin is not used, because a thread must not own its lock when Python ends.
    while received := os.read(0, 4096):
        *lines, incomplete_line = (incomplete_line + received).split(b"\n")
        for line in lines:
            requests.put(line)
    os._exit(0)


if __name__ == "__main__":
    main()
