"""The processors that kernels are compiled for."""

from __future__ import annotations

import hashlib
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any

import llvmlite.binding as llvm

_V2 = frozenset({"cx16", "sahf", "popcnt", "sse3", "sse4.1", "sse4.2", "ssse3"})
_V3 = _V2 | {"avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"}
_V4 = _V3 | {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}
LEVELS = {"x86-64-v4": _V4, "x86-64-v3": _V3, "x86-64-v2": _V2, "x86-64": frozenset[str]()}
"""The levels of the x86-64 psABI, the highest first: what a processor of each must have."""

NATIVE = "native"


@dataclass(frozen=True)
class Target:
    """A processor as LLVM knows it."""

    cpu: str
    features: str

    @property
    def text(self) -> str:
        """The processor in a word that a file name may hold."""
        if self.cpu in LEVELS:
            return self.cpu
        return f"{self.cpu}-{hashlib.sha256(self.features.encode()).hexdigest()[:8]}"


@cache
def native() -> Target:
    """The processor of this machine."""
    return Target(llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())


def machine() -> Any:
    """What loads objects on this machine; an engine that is made of it owns it."""
    with suppress(RuntimeError):  # newer llvmlite does it on its own, and says so
        llvm.initialize()
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    this = native()
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=this.cpu, features=this.features, opt=3, jit=True)


def named(name: str) -> Target:
    """The target called `name`: `native` or one of LEVELS."""
    return native() if name == NATIVE else Target(name, "")


@cache
def runnable() -> tuple[Target, ...]:
    """The targets whose objects this machine runs, the most fitting first."""
    has = {name for name, present in llvm.get_host_cpu_features().items() if present}
    intel = llvm.get_process_triple().startswith("x86_64")
    return native(), *(Target(name, "") for name, needed in LEVELS.items() if intel and needed <= has)
