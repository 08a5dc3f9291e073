"""Decorators of a process that compiles, based on numba, and the compilation of kernels to object
files.

Only the functions of `tdint.kernels.build` import this module.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from inspect import unwrap
from typing import Any

import llvmlite.binding as llvm
import numba
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.types.containers import BaseTuple
from numba.core.types.misc import unliteral
from numba.extending import intrinsic

from tdint.kernels.building.compilable import (
    F8,
    HOOKS,
    LAWS_SYMBOL,
    Argument,
    ArrayOf,
    Scalar,
    Signature,
    grouped,
)
from tdint.kernels.building.target import Target, native

# Reference counting is disabled: the arrays outlive the call, and kernels allocate no arrays. With
# it, the time of a step would be three times the current time, because counting is atomic.
_OPTIONS = {
    "error_model": "numpy",
    "fastmath": {"contract"},
    "nogil": True,
    "_nrt": False,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "forceinline": False,  # otherwise inherited from the function that calls
}

REDUCED = True
"""False disables all that removes machine code without a change of results (`_used_parts`,
`_complete`, `_closed`, `_set_loop_options`). Only a test sets it, before the first compilation."""

_MATH = {*dir(math), "rint", "sincos", "memcpy", "memmove", "memset"}
"""Functions of the C library (mathematics and memory) that an object file may call."""

_TARGET_LINES = re.compile(r"^target (datalayout|triple) = .*\n", re.MULTILINE)
"""Lines of a module that specify the machine for which numba has generated it."""

_PYTHON_OBJECTS = re.compile(r"^@(_ZN08NumbaEnv|\.const\.pickle).*\n", re.MULTILINE)
"""Python objects in the text of a module: pointers without references, and pickled exceptions with
the file that raises them."""

_EXCEPTION = re.compile(r"@\.const\.picklebuf\.\w+")
"""Exception that the calling convention passes to the caller in addition to the error code."""

_COMDAT = re.compile(r" comdat(\([^)]*\))?(?= )")
"""Mark of a function of which the linker keeps one definition, in the text of a module."""

_BODY = re.compile(r'(?<=@)"?((?<=")[^"]+|[\w.$-]+)"?\(.*(?= \x23\d+ \{$| \{$)', re.MULTILINE)
"""Definition of a function up to the place of its attributes, in the text of a module. The hash of
the sources would omit the text after a number sign, which is therefore written as a code."""

_DEFINED = re.compile(r'^(?:define [^@]*)?@"?((?<=")[^"]+|[\w.$-]+)"?(?= =|\()', re.MULTILINE)
_SYMBOL = re.compile(r'([@$])"?((?<=")[^"]+|[\w.$-]+)"?')
"""Names in the text of a module, with or without quotation marks: `_DEFINED` finds the definitions,
`_SYMBOL` every use (`@name`, or `$name` of a group of definitions)."""


_PROBE = "\n".join(
    f'module asm "{line}"'
    for line in (
        "__chkstk:",
        *("pushq %rcx", "pushq %rax", "leaq 24(%rsp), %rcx"),
        *(
            "1:",
            "cmpq $4096, %rax",
            "jb 2f",
            "subq $4096, %rcx",
            "testq %rcx, (%rcx)",
            "subq $4096, %rax",
            "jmp 1b",
        ),
        *("2:", "subq %rax, %rcx", "testq %rcx, (%rcx)", "popq %rax", "popq %rcx", "retq"),
    )
)
"""Function that compilers on Windows call before an array is placed on the stack. It accesses each
page in order, because the system allocates the pages in order. `rax` contains the size, and no
register is changed. The function is not part of a library that is loaded in every process."""


def inline(function: Callable[..., Any]) -> Any:
    """Mark a function so that LLVM copies its code into each caller.

    numba compiles it once for each combination of argument types, as for `outlined`.
    """
    return _compiled_once(function, _OPTIONS | {"forceinline": True})


def outlined(function: Callable[..., Any]) -> Any:
    """Mark a function so that callers call it, unless LLVM finds its copy shorter than the call."""
    return _compiled_once(function, _OPTIONS)


def _compiled_once(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Return a function that numba compiles once for each combination of argument types.

    Literal types of constant arguments, which contain the values, are replaced by ordinary types,
    so that the function is not compiled again for each value.
    """
    compiled = numba.njit(**options)(function)
    get_call_template = compiled.get_call_template
    compiled.get_call_template = lambda arguments, named: get_call_template(
        tuple(map(unliteral, arguments)), named
    )
    return compiled


def indirect_caller(signature: Signature) -> Any:
    """Return a compiled function (address, *arguments) that calls a kernel at its address.

    Named tuples among the arguments are passed as their fields.
    """
    returns, arguments = _type(signature.returns), tuple(map(_type, signature.arguments))

    @intrinsic
    def call(typing_context, address, argument_types):
        """Return the numba signature of a call of the kernel, and the function that generates the
        code of the call.

        numba executes this function while it compiles `call_at`. The arguments are numba types, not
        values. `argument_types` can differ from the types of the kernel, for example an integer for
        a floating-point number.
        """

        def generate(context, builder, _, values):
            """Generate the LLVM code of the call and return its result in this code.

            `values` are the address and the tuple of the arguments in the generated code.
            """
            convention = context.call_conv
            function_type = convention.get_function_type(returns, arguments)
            function = builder.inttoptr(values[0], function_type.as_pointer())
            passed = _fields(builder, values[1], argument_types)
            converted = [
                _used_parts(builder, context.cast(builder, value, value_type, argument))
                for (value, value_type), argument in zip(passed, arguments, strict=True)
            ]
            # The status, the first result, is ignored, because a kernel raises no exception.
            _, result = convention.call_function(builder, function, returns, arguments, converted)
            return result

        return returns(address, argument_types), generate

    @numba.njit(**_OPTIONS)
    def call_at(address, *arguments):
        """Call the kernel at `address` with the arguments of the signature."""
        return call(address, arguments)

    return call_at


def _used_parts(builder: Any, value: Any) -> Any:
    """Return an array in the generated code without the parts that `_complete` computes; other
    values are returned unchanged.

    A call would pass nine numbers of each table instead of three: 12 % of the time of a step with
    one story. Parts 4 and 5 are the address of the data and the shape.
    """
    if REDUCED and isinstance(value.type, ir.LiteralStructType):
        for index, part in enumerate(value.type.elements):
            if index not in (4, 5):
                value = builder.insert_value(value, part(ir.Undefined), index)
    return value


def _fields(builder: Any, value: Any, value_type: Any) -> Iterator[tuple[Any, Any]]:
    """Yield the values in a tuple, also in tuples that it contains, with their types."""
    if isinstance(value_type, BaseTuple):
        items = cgutils.unpack_tuple(builder, value, len(value_type))
        for item, item_type in zip(items, value_type, strict=True):
            yield from _fields(builder, item, item_type)
    else:
        yield value, value_type


@intrinsic
def _complete(typing_context, arguments):
    """Return the signature and the code generator of the arguments of a kernel, with all parts of
    each array. They follow from its address and its shape, the only parts that callers pass
    (`_used_parts`)."""

    def complete(context, builder, value, value_type):
        """Generate the code of a complete argument; return the argument."""
        if isinstance(value_type, BaseTuple):
            items = cgutils.unpack_tuple(builder, value, len(value_type))
            parts = [
                complete(context, builder, *item) for item in zip(items, value_type, strict=True)
            ]
            return context.make_tuple(builder, value_type, parts)
        if not (REDUCED and isinstance(value_type, types.Array)):
            return value
        array = context.make_array(value_type)(context, builder, value)
        return _table(context, builder, array.data, cgutils.unpack_tuple(builder, array.shape))

    def generate(context, builder, signature, values):
        """Generate the code of the tuple of complete arguments."""
        return complete(context, builder, values[0], signature.args[0])

    return arguments(arguments), generate


@intrinsic
def local(typing_context, size):
    """Return the numba signature and the code generator of an uninitialized array on the stack.

    In a kernel, `local(size)` is an array of `size` numbers, which exists until the calling
    function returns. numba executes this function while it compiles such a call. The arguments are
    then numba types, not values. `typing_context` is passed by numba and not used.

    `_on_stack(1)` is the numba type of an array with a single dimension. Its call with an integer
    type gives the first result: the signature of a function that has an integer argument and
    returns such an array. The second result is a function that generates the code of the array.
    """
    return _on_stack(1)(types.intp), lambda context, builder, _, sizes: _array(
        context, builder, sizes
    )


@intrinsic
def local_table(typing_context, rows, columns):
    """Return the numba signature and the code generator of an uninitialized table on the stack.

    In a kernel, `local_table(rows, columns)` is a table of `rows` times `columns` numbers. The rest
    is as for `local`, with an array of two dimensions.
    """
    return _on_stack(2)(types.intp, types.intp), lambda context, builder, _, sizes: _array(
        context, builder, sizes
    )


@intrinsic
def copy_rows_within(typing_context, table, source, target, count):
    """Return the numba signature and the code generator of a copy of successive rows of a table.

    In a kernel, `copy_rows_within(table, source, target, count)` copies `count` rows from row
    `source` on to the rows from `target` on, as one block of memory. Both must not overlap. The
    rest is as for `local`.
    """

    def generate(context, builder, signature, values):
        """Generate the code of the copy."""
        array = context.make_array(signature.args[0])(context, builder, values[0])
        columns = builder.extract_value(array.shape, 1)
        from_row, to_row = (
            builder.gep(array.data, [builder.mul(row, columns)]) for row in values[1:3]
        )
        numbers = builder.mul(values[3], columns)
        cgutils.raw_memcpy(builder, to_row, from_row, numbers, 8)
        return context.get_dummy_value()

    return types.none(table, types.intp, types.intp, types.intp), generate


# ---- Functions of the laws in separate object files. They have the convention of C: addresses of
# the tables `law_parameters` and `law_state`, their number of columns, the other arguments, the
# numbers of rows of both; the result is returned directly. (In the convention of numba, a call
# would pass 25 numbers on the stack.)

_NUMBER, _REAL = ir.IntType(64), ir.DoubleType()


@intrinsic
def law_entry(typing_context, code, slot):
    """Return the numba signature and the code generator of an entry of the table of laws.

    In a kernel, `law_entry(code, slot)` is the entry `slot` of the law with the number `code`.
    """

    def generate(context, builder, signature, values):
        """Generate the code that reads the entry."""
        module = builder.module
        table = module.globals.get(LAWS_SYMBOL)
        if table is None:  # declared; the process that loads the object file defines it
            table = ir.GlobalVariable(module, ir.ArrayType(_NUMBER, 0), LAWS_SYMBOL)
        twice = builder.fptosi(builder.fmul(values[0], _REAL(2.0)), _NUMBER)
        row = builder.mul(twice, _NUMBER(len(HOOKS) + 1))
        return builder.load(builder.gep(table, [_NUMBER(0), builder.add(row, values[1])]))

    return types.int64(types.float64, types.int64), generate


def law_function(signature: Signature) -> Any:
    """Return a compiled function (address, arguments) that calls a function of a law with the tuple
    of its arguments."""
    returns, arguments = _type(signature.returns), tuple(map(_type, signature.arguments))

    @intrinsic
    def call(typing_context, address, passed):
        """Return the signature of a call and the function that generates its code."""

        def generate(context, builder, call_signature, values):
            """Generate the code of the call."""
            given = cgutils.unpack_tuple(builder, values[1], len(arguments))
            parameters, state, *others = (
                context.cast(builder, value, value_type, argument)
                for value, value_type, argument in zip(given, passed, arguments, strict=True)
            )
            table = context.make_array(arguments[0])
            parameters, state = (table(context, builder, value) for value in (parameters, state))
            parameter_rows, columns = cgutils.unpack_tuple(builder, parameters.shape)
            state_rows, _ = cgutils.unpack_tuple(builder, state.shape)
            function = builder.inttoptr(values[0], _c_type(signature).as_pointer())
            counts = [parameter_rows, state_rows]
            result = builder.call(
                function, [parameters.data, state.data, columns, *others, *counts]
            )
            return context.get_dummy_value() if returns == types.none else result

        return returns(address, passed), generate

    return call


def _c_type(signature: Signature) -> Any:
    """Return the LLVM type of a function of a law in the convention of C."""
    others = [_REAL if argument == F8 else _NUMBER for argument in signature.arguments[2:]]
    address = _REAL.as_pointer()
    # The numbers of rows are last: the first six integers are passed in registers.
    return ir.FunctionType(
        _REAL if signature.returns == F8 else ir.VoidType(),
        [address, address, _NUMBER, *others, _NUMBER, _NUMBER],
    )


def objects_of_law(functions: dict[str, Any], targets: Iterable[Target]) -> list[bytes]:
    """Compile the functions of a law (by the names in HOOKS) to an object file for each target.

    The object file exports the functions of HOOKS, with these names after "law.".

    Raises
    ------
    ValueError
        As for `objects_of`.
    """
    _require_optimization()
    _set_loop_options()
    context = numba.core.registry.cpu_target.target_context
    codegen = context.codegen()
    library = codegen.create_library("law")
    module = library.create_ir_module("law.entries")
    inlined = []
    for name, signature in HOOKS.items():
        function = functions[name]
        compiled = numba.njit(**_OPTIONS)(getattr(function, "py_func", function))
        compiled.compile(_type(signature.returns)(*map(_type, signature.arguments)))
        ((_, overload),) = compiled.overloads.items()
        library.add_linking_library(overload.library)
        inlined.append(overload.fndesc.llvm_func_name)
        _add_entry(context, module, f"law.{name}", signature, overload.fndesc.llvm_func_name)
    library.add_ir_module(module)
    entries = {f"law.{name}" for name in HOOKS}
    with numba.core.compiler_lock.global_compiler_lock:
        library.finalize()
    # The functions of numba are copied into the entries, which pass addresses only.
    text, _ = _independent(_closed(library.get_llvm_str(), entries, inlined), "law", entries)
    return [_emitted(text, target) for target in targets]


def _closed(text: str, entries: Iterable[str], inlined: Iterable[str] = ()) -> str:
    """Return a module, optimized again, of which only the functions `entries` can be called from
    outside. The functions `inlined` are copied into their callers, and no others.

    LLVM removes the arguments that an internal function does not use: 8 to 18 % of the time of a
    step of `impulse4`. Copies of further functions would make steps 4 to 31 % slower. Equal names
    in two object files are not confused.
    """

    def marked(definition: re.Match[str]) -> str:
        """Return a definition with the attribute that states if the function is copied."""
        name = definition[1]
        attribute = " alwaysinline" if name in inlined else " noinline" if REDUCED else ""
        return definition[0] + ("" if name in entries else attribute)

    with numba.core.compiler_lock.global_compiler_lock:
        # `add_function_attribute` of llvmlite 0.43 changes the attributes of the returned value.
        whole = llvm.parse_assembly(_BODY.sub(marked, _COMDAT.sub("", text)))
        for function in whole.functions:
            if not function.is_declaration and function.name not in entries:
                function.linkage = llvm.Linkage.internal
        library = numba.core.registry.cpu_target.target_context.codegen().create_library("closed")
        library.add_llvm_module(whole)
        library.finalize()
    return str(library.get_llvm_str())


def _add_entry(
    context: Any, module: Any, name: str, signature: Signature, function_name: str
) -> None:
    """Add a function with the convention of C to a module, which calls a function of numba with
    tables that it builds from their addresses."""
    entry = ir.Function(module, _c_type(signature), name)
    entry.attributes.add("nounwind")
    builder = ir.IRBuilder(entry.append_basic_block("entry"))
    parameters, state, columns, *others, parameter_rows, state_rows = entry.args
    for value in (columns, *others, parameter_rows, state_rows):
        if value.type == _NUMBER:  # otherwise numba would wrap negative indices
            builder.assume(builder.icmp_signed(">=", value, _NUMBER(0)))
    tables = [
        _table(context, builder, data, [count, columns])
        for data, count in ((parameters, parameter_rows), (state, state_rows))
    ]
    returns, arguments = _type(signature.returns), tuple(map(_type, signature.arguments))
    convention = context.call_conv
    function_type = convention.get_function_type(returns, arguments)
    target = cgutils.get_or_insert_function(module, function_type, function_name)
    # The status, the first result, is ignored, because a law raises no exception.
    _, result = convention.call_function(builder, target, returns, arguments, [*tables, *others])
    if signature.returns == F8:
        builder.ret(result)
    else:
        builder.ret_void()


def _on_stack(dimensions: int) -> Any:
    """Return the numba type of an array of float64 in C order with a number of dimensions."""
    return types.Array(types.float64, dimensions, "C")


def _array(context: Any, builder: Any, sizes: Any) -> Any:
    """Generate the code for an uninitialized array in C order on the stack; return the array.

    `sizes` are the values of the dimensions in the generated code. Each execution of the generated
    code reserves memory, which is released when the function returns. Kernels therefore do not
    create such arrays in loops.
    """
    count = context.get_constant(types.intp, 1)
    for size in sizes:
        count = builder.mul(count, size)
    return _table(context, builder, builder.alloca(_REAL, count), sizes)


def _table(context: Any, builder: Any, data: Any, sizes: Any) -> Any:
    """Generate the code for an array in C order of the numbers at an address; return the array."""
    # Strides in bytes
    strides: list[Any] = []
    stride = context.get_constant(types.intp, 8)
    for size in reversed(sizes):
        strides.insert(0, stride)
        stride = builder.mul(stride, size)
    array = context.make_array(_on_stack(len(sizes)))(context, builder)
    context.populate_array(
        array,
        data=data,
        shape=cgutils.pack_array(builder, sizes),
        strides=cgutils.pack_array(builder, strides),
        itemsize=context.get_constant(types.intp, 8),
        meminfo=None,
    )
    return array._getvalue()


def objects_of(
    function: Callable[..., Any], signature: Signature, targets: Iterable[Target]
) -> tuple[list[bytes], str]:
    """Compile a kernel to an object file for each target; return the object files and the symbol of
    the entry point.

    References to Python objects are removed, and functions are renamed so that equal sources give
    equal bytes. numba optimizes the LLVM code for the processor in the environment variables
    NUMBA_CPU_NAME and NUMBA_CPU_FEATURES. All targets must be compatible with this optimization;
    `tdint.kernels.building.process.compilations` combines such targets.

    In the calling convention of numba, the fields of a named tuple are separate arguments.

    Raises
    ------
    ValueError
        The kernel calls a function that is not in the object file and not in the C library
        (`_MATH`), because it allocates memory or raises an exception. Or NUMBA_OPT is 0: without
        optimization, such calls remain in the code of every kernel.
    """
    _require_optimization()
    _set_loop_options()
    function = unwrap(function)
    body = inline(function)

    @numba.njit(**_OPTIONS)
    def compiled(arguments):
        """Call the kernel. The fields of the tuple are the arguments of the machine code."""
        return body(*_complete(arguments))

    groups = map(_type_of_group, grouped(function, [*map(_type, signature.arguments)]))
    compiled.compile(_type(signature.returns)(BaseTuple.from_types([*groups])))
    # The function has been compiled for exactly one tuple of argument types.
    (arguments,) = compiled.overloads
    symbol = compiled.overloads[arguments].fndesc.llvm_func_name
    text = compiled.inspect_llvm(arguments)
    if REDUCED:
        text = _closed(text, [symbol])
    text, names = _independent(text, function.__name__)
    return [_emitted(text, target) for target in targets], names[symbol]


def _require_optimization() -> None:
    """Raise ValueError if the code is not optimized."""
    if not numba.core.config.OPT:
        raise ValueError(
            "NUMBA_OPT=0 leaves calls in the code that optimizing removes: unset NUMBA_OPT"
        )


@cache
def _set_loop_options() -> None:
    """Let LLVM generate less code around loops, in a process whose kernels are not vectorized.

    Loops over stories are short. The instructions that prepare unrolled loops take 1 to 10 % of the
    time of a step, and pointers that a loop increments instead of an index 3 to 5 % (`impulse4`).
    Loops over many oscillators are vectorized and keep the defaults of LLVM. LLVM accepts an option
    only once in a process.
    """
    if REDUCED and not numba.core.config.LOOP_VECTORIZE:
        for option in ("--unroll-runtime=false", "--disable-lsr"):
            llvm.set_option("tdint", option)


def _independent(text: str, prefix: str, kept: Iterable[str] = ()) -> tuple[str, dict[str, str]]:
    """Return a module as text that depends on nothing in this process, and the new names of its
    symbols, `prefix` with a number. The names `kept` are not changed.

    Raises
    ------
    ValueError
        The module calls a function that it does not contain.
    """
    # A call of a function that is not part of LLVM or of the C library could not be resolved
    # when the object file is loaded.
    declared = re.findall(r'^declare .*?@("[^"]+"|[\w.$-]+)\(', text, re.MULTILINE)
    foreign = (
        name for name in declared if not name.strip('"').startswith("llvm.") and name not in _MATH
    )
    # A name that occurs only once is declared but not used.
    if undefined := sorted(
        name for name in foreign if len(re.findall(f"@{re.escape(name)}(?![\\w.$-])", text)) > 1
    ):
        raise ValueError(
            f"{prefix} calls {', '.join(undefined)}: a kernel must neither allocate memory nor "
            "raise an exception"
        )
    # The uses that remain after the definitions of Python objects are addresses of exceptions
    # (`@.const.picklebuf...`), which a function passes to its caller in addition to the error code.
    # `tdint.kernels.building.loading.Loaded` reads only the error code.
    text = _EXCEPTION.sub("null", _PYTHON_OBJECTS.sub("", text))
    # numba numbers functions in the order of compilation. Here each name contains its index in the
    # module.
    unchanged = {LAWS_SYMBOL, *kept}
    names = {
        name: f"{prefix}.{index}"
        for index, name in enumerate(_DEFINED.findall(text))
        if name not in unchanged
    }

    def renamed(use: re.Match[str]) -> str:
        """Return the replacement of a match of `_SYMBOL`: the same prefix (@ or $) with the new
        name in quotation marks, or the unchanged text if the module does not define the symbol."""
        return f'{use[1]}"{names[use[2]]}"' if use[2] in names else use[0]

    return _SYMBOL.sub(renamed, text), names


def _emitted(text: str, target: Target) -> bytes:
    """Return the object file of a module (LLVM code as text) for a target.

    numba has generated the module for this machine. For another target, the lines that specify the
    machine are replaced, and all functions are marked as `nounwind`: the object then contains no
    tables for the unwinding of the stack after an exception. No target needs the tables, because no
    exception passes through a kernel. For Windows the mark is necessary: there the tables would
    have to be near the code in memory, but they are not.
    """
    # LLVM target machine that numba uses to compile for this machine
    if target == native():
        codegen = numba.core.registry.cpu_target.target_context.codegen()
        return bytes(codegen._tm.emit_object(llvm.parse_assembly(text)))
    machine = target.machine()
    text = _TARGET_LINES.sub("", text)
    if target.platform == "win32":
        # LLVM translates `_PROBE` with its assembly parser.
        llvm.initialize_native_asmparser()
        text += _PROBE
    module = llvm.parse_assembly(text)
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    for function in module.functions:
        if not function.is_declaration:
            function.add_function_attribute("nounwind")
    return bytes(machine.emit_object(module))


def _type_of_group(argument: Any) -> Any:
    """Return the numba type of a named tuple of numba types; other types are returned unchanged."""
    is_group = isinstance(argument, tuple)
    return BaseTuple.from_types(argument, type(argument)) if is_group else argument


def _type(argument: Argument) -> Any:
    """Return the numba type of an argument. A kernel is passed by its address."""
    match argument:
        case Scalar():
            return getattr(types, argument.name)
        case ArrayOf():
            return types.Array(types.float64, argument.dimensions, "C")
        case Signature():
            return types.int64
