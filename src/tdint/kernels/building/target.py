"""The processors and systems that kernels are compiled for."""

from __future__ import annotations

import hashlib
import sys
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any

import llvmlite.binding as llvm

from tdint.errors import UsageError

_V2 = frozenset({"cx16", "sahf", "popcnt", "sse3", "sse4.1", "sse4.2", "ssse3"})
_V3 = _V2 | {"avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"}
_V4 = _V3 | {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}
LEVELS = {"x86-64-v4": _V4, "x86-64-v3": _V3, "x86-64-v2": _V2, "x86-64": frozenset[str]()}
"""The levels of the x86-64 psABI, the highest first: what a processor of each must have."""

AARCH64 = "aarch64"
"""Any 64-bit ARM processor of Linux, any of Apple's."""

NATIVE = "native"

_PLATFORMS = {"linux": "linux", "macos": "darwin", "windows": "win32"}
"""`sys.platform` of what a target's name may begin with."""

_TRIPLES = {
    ("linux", True): "x86_64-unknown-linux-gnu",
    ("linux", False): "aarch64-unknown-linux-gnu",
    ("darwin", True): "x86_64-apple-macosx10.9.0",
    ("darwin", False): "arm64-apple-macosx11.0.0",
    ("win32", True): "x86_64-pc-windows-msvc",
}


@dataclass(frozen=True)
class Target:
    """A processor as LLVM knows it, or one of LEVELS, or AARCH64; and `sys.platform` there."""

    cpu: str
    features: str
    platform: str = sys.platform

    @property
    def text(self) -> str:
        """The processor in a word that a file name may hold."""
        if self.cpu in LEVELS or self.cpu == AARCH64:
            return self.cpu
        return f"{self.cpu}-{hashlib.sha256(self.features.encode()).hexdigest()[:8]}"

    @property
    def optimized_for(self) -> tuple[str, str]:
        """Processor and features that numba, which knows those of this machine only, optimizes
        for."""
        if self == native():
            return self.cpu, self.features
        if _family() != "x86_64":
            return "generic", ""
        return (
            self.cpu if self.cpu in LEVELS else "x86-64-v2",
            "",
        )  # whose vectors are as long as those of ARM

    def machine(self) -> Any:
        """What writes objects for the processor, to be loaded into a process."""
        triple = _TRIPLES[self.platform, self.cpu in LEVELS]
        llvm.initialize_all_targets()
        llvm.initialize_all_asmprinters()
        cpu = (
            self.cpu
            if self.cpu in LEVELS
            else "apple-m1"
            if self.platform == "darwin"
            else "generic"
        )
        reloc = "static" if self.cpu in LEVELS else "default"  # as numba does
        return llvm.Target.from_triple(triple).create_target_machine(
            cpu=cpu, features=self.features, opt=3, reloc=reloc, codemodel="jitdefault", jit=True
        )


def _family() -> str:
    """What processors this process runs on: `x86_64`, `aarch64`, or whatever else LLVM calls
    them."""
    family = str(llvm.get_process_triple().partition("-")[0])
    return {"amd64": "x86_64", "arm64": AARCH64}.get(family, family)


@cache
def native() -> Target:
    """The processor of this machine."""
    return Target(llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())


def machine() -> Any:
    """What loads objects on this machine; an engine that is made of it owns it."""
    with suppress(
        RuntimeError, AttributeError
    ):  # newer llvmlite does it on its own, and says so or has no such word
        llvm.initialize()
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    this = native()
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=this.cpu, features=this.features, opt=3, jit=True)


def named(name: str) -> Target:
    """The target called `name`: `native`, one of LEVELS or AARCH64; of another platform behind its
    name (`macos-`).

    Raises
    ------
    UsageError
        There is none of that name.
    """
    if name == NATIVE:
        return native()
    first, _, rest = name.partition("-")
    platform, cpu = (_PLATFORMS[first], rest) if first in _PLATFORMS else (sys.platform, name)
    if (cpu not in LEVELS and cpu != AARCH64) or (platform, cpu in LEVELS) not in _TRIPLES:
        raise UsageError(f"no processor that kernels can be compiled for: {name}")
    return Target(cpu, "", platform)


@cache
def runnable() -> tuple[Target, ...]:
    """The targets whose objects this machine runs, the most fitting first: of a family that has no
    other, its own."""
    if _family() == AARCH64:
        return native(), Target(AARCH64, "")
    if _family() != "x86_64":
        return (native(),)
    has = {name for name, present in llvm.get_host_cpu_features().items() if present}
    return native(), *(Target(name, "") for name, needed in LEVELS.items() if needed <= has)
