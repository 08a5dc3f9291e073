"""Execute the object of a kernel for another system on Linux: python FILE macos|windows. Standard
input contains, pickled, the object for this machine, the other object, and the symbol of both.

LLVM loads objects of all systems. Objects for macOS follow the calling convention of Linux. Objects
for Windows have another convention, which LLVM functions convert around the kernel and around each
library function that it calls.
"""

import pickle
import sys

import llvmlite.binding as llvm
import numpy as np

from tdint.kernels.building import loading
from tdint.kernels.building.compilable import F8, I8, ArrayOf, Scalar
from tdint.kernels.building.target import machine, named

SIGNATURE = F8(ArrayOf(1), ArrayOf(2), I8, ArrayOf(1), F8)
LIBRARY = {"exp": 1, "exp2": 1, "sin": 1, "cos": 1, "tanh": 1, "pow": 2, "log1p": 1}


def around_the_library(convention: str) -> str:
    """Return functions of the library with the calling convention of another system."""
    lines = [
        "declare ptr @memset(ptr, i32, i64)",
        f"define {convention} ptr @other_memset(ptr %p, i32 %x, i64 %n) {{",
        "  %r = call ptr @memset(ptr %p, i32 %x, i64 %n)\n  ret ptr %r\n}",
        f"define {convention} void @other___bzero(ptr %p, i64 %n) {{",
        "  %r = call ptr @memset(ptr %p, i32 0, i64 %n)\n  ret void\n}",
    ]
    for name, count in LIBRARY.items():
        numbers = ", ".join(f"double %{i}" for i in range(count))
        lines += [
            f"declare double @{name}({', '.join(['double'] * count)})",
            f"define {convention} double @other_{name}({numbers}) {{",
            f"  %r = call double @{name}({numbers})\n  ret double %r\n}}",
        ]
    pair = "{double, double}"
    both = (
        f"%one = insertvalue {pair} undef, double %s, 0\n  %both = insertvalue {pair} %one, double "
        "%c, 1"
    )
    lines += [
        f"define {convention} {pair} @other___sincos_stret(double %x) {{",
        f"  %s = call double @sin(double %x)\n  %c = call double @cos(double %x)\n  {both}",
        f"  ret {pair} %both\n}}",
    ]
    return "\n".join(lines)


def around_the_kernel(address: int, convention: str) -> str:
    """Return the kernel at an address with the calling convention of this system."""
    types = ["ptr", "ptr"]
    for argument in SIGNATURE.arguments:
        if isinstance(argument, Scalar):
            types.append({"float64": "double", "int64": "i64"}[argument.name])
        else:
            types += ["ptr", "ptr", "i64", "i64", "ptr", *["i64"] * (2 * argument.dimensions)]
    arguments = ", ".join(f"{llvm_type} %a{i}" for i, llvm_type in enumerate(types))
    call = f"%f = inttoptr i64 {address} to ptr\n  %r = call {convention} i32 %f({arguments})"
    return f"define i32 @here({arguments}) {{\n  {call}\n  ret i32 %r\n}}"


def engine_of(text: str):
    """Return a module of LLVM text in memory."""
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(text), machine())
    engine.finalize_object()
    return engine


def main() -> None:
    """Print the result of the kernel for this machine and of the object for the other system."""
    system = sys.argv[1]
    target = named(f"{system}-x86-64-v2")
    convention = "win64cc" if system == "windows" else "ccc"
    own, foreign, symbol = pickle.load(sys.stdin.buffer)
    arguments = np.linspace(0.1, 2.0, 7), np.arange(14.0).reshape(2, 7), 1, np.ones(7), 0.5
    print(loading.Loaded(own, symbol, SIGNATURE)(*arguments))

    library = engine_of(around_the_library(convention))
    prefix = "" if system == "windows" else "_"
    for name in (*LIBRARY, "memset", "__bzero", "__sincos_stret"):
        llvm.add_symbol(prefix + name, library.get_function_address(f"other_{name}"))
    empty = llvm.parse_assembly("")
    other = target.machine()
    empty.triple, empty.data_layout = other.triple, str(other.target_data)
    engine = llvm.create_mcjit_compiler(empty, other)
    engine.add_object_file(llvm.ObjectFileRef.from_data(foreign))
    engine.finalize_object()
    here = engine_of(around_the_kernel(engine.get_function_address(symbol), convention))

    called = loading.Loaded(own, symbol, SIGNATURE)
    called.address = here.get_function_address("here")
    print(called(*arguments))


if __name__ == "__main__":
    main()
