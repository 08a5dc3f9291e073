"""Processors and operating systems for which kernels are compiled."""

from __future__ import annotations

import hashlib
import sys
from contextlib import suppress
from functools import cache
from typing import Any, NamedTuple

import llvmlite.binding as llvm

from tdint.errors import UsageError

_V2 = frozenset({"cx16", "sahf", "popcnt", "sse3", "sse4.1", "sse4.2", "ssse3"})
_V3 = _V2 | {"avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"}
_V4 = _V3 | {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}
LEVELS = {"x86-64-v4": _V4, "x86-64-v3": _V3, "x86-64-v2": _V2, "x86-64": frozenset[str]()}
"""Levels of the x86-64 psABI, from the highest, with the processor features that each level
requires."""

AARCH64 = "aarch64"
"""Name of the target for all 64-bit ARM processors on Linux and all Apple processors."""

NATIVE = "native"

_PLATFORMS = {"linux": "linux", "macos": "darwin", "windows": "win32"}
"""Values of `sys.platform` for the prefixes of target names."""

# LLVM triple of each platform (`sys.platform`) for x86-64 processors (True) and ARM processors
# (False)
_TRIPLES = {
    ("linux", True): "x86_64-unknown-linux-gnu",
    ("linux", False): "aarch64-unknown-linux-gnu",
    ("darwin", True): "x86_64-apple-macosx10.9.0",
    ("darwin", False): "arm64-apple-macosx11.0.0",
    ("win32", True): "x86_64-pc-windows-msvc",
}


class Target(NamedTuple):
    """Processor and operating system for which an object file is compiled.

    Attributes
    ----------
    cpu : str
        LLVM name of the processor, one of LEVELS, or AARCH64.
    features : str
        Features of the processor in the form of LLVM; empty for LEVELS and AARCH64.
    platform : str
        Operating system as in `sys.platform`. Default: this system.
    """

    cpu: str
    features: str
    platform: str = sys.platform

    @property
    def text(self) -> str:
        """Text that identifies the processor in the names of object files.

        For a level of x86-64 (LEVELS) and for AARCH64, the text is this name. For the target of a
        specific machine (`native`), the text is the LLVM name of the processor and a hash of its
        features.
        """
        if self.cpu in LEVELS or self.cpu == AARCH64:
            return self.cpu
        return f"{self.cpu}-{hashlib.sha256(self.features.encode()).hexdigest()[:8]}"

    @property
    def optimized_for(self) -> tuple[str, str]:
        """Name and features of the processor for which numba optimizes the code.

        numba runs on this machine. It can optimize for this machine or, if this machine has an
        x86-64 processor, for any level of x86-64 (LEVELS).

            this machine    target          name and features
            any             this machine    LLVM name and features of the target
            x86-64          level           name of the level, no features
            x86-64          ARM             x86-64-v2, no features
            not x86-64      any other       "generic", no features

        For an ARM target, x86-64-v2 is used because vectors of x86-64-v2 and of ARM have the same
        length.
        """
        if self == native():
            return self.cpu, self.features
        if _family() != "x86_64":
            return "generic", ""
        return self.cpu if self.cpu in LEVELS else "x86-64-v2", ""

    def machine(self) -> Any:
        """Return the LLVM target machine that generates object files for this target.

        The target is a level of x86-64 (a key of LEVELS) or AARCH64, the 64-bit ARM processors. The
        settings are the same as in numba for x86-64 and for ARM. The method is not called for the
        target `native`: the code generator of numba writes the object files of the machine.
        """
        # The second part of the key is True for x86-64, False for ARM.
        triple = _TRIPLES[self.platform, self.cpu in LEVELS]
        llvm.initialize_all_targets()
        llvm.initialize_all_asmprinters()
        if self.cpu in LEVELS:
            cpu = self.cpu
        else:
            cpu = "apple-m1" if self.platform == "darwin" else "generic"
        # Relocation model that numba uses for x86-64 and for ARM
        reloc = "static" if self.cpu in LEVELS else "default"
        return llvm.Target.from_triple(triple).create_target_machine(
            cpu=cpu, features=self.features, opt=3, reloc=reloc, codemodel="jitdefault", jit=True
        )


def _family() -> str:
    """Return the family of processors of the process: `x86_64`, `aarch64`, or the LLVM name of
    another family.
    """
    family = str(llvm.get_process_triple().partition("-")[0])
    return {"amd64": "x86_64", "arm64": AARCH64}.get(family, family)


@cache
def native() -> Target:
    """Return the target of the machine: LLVM name and features of its processor, its system."""
    return Target(llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())


def machine() -> Any:
    """Return the LLVM target machine that describes this machine.

    The class `tdint.kernels.building.loading.Loaded` creates an engine from the target machine,
    which loads an object file and then owns the target machine.
    """
    # Newer versions of llvmlite initialize LLVM automatically. The function then raises an error or
    # does not exist.
    with suppress(RuntimeError, AttributeError):
        llvm.initialize()
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    host = native()
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=host.cpu, features=host.features, opt=3, jit=True)


def named(name: str) -> Target:
    """Return the target (processor and operating system) that a user specifies by its name.

    Parameters
    ----------
    name : str
        `native` for this machine, one of LEVELS or AARCH64. For another platform the name has a
        prefix, for example `macos-aarch64`.

    Raises
    ------
    UsageError
        The name is unknown.
    """
    if name == NATIVE:
        return native()
    # `macos-aarch64` consists of a platform and a processor; the dash of `x86-64` is part of the
    # name.
    prefix, _, suffix = name.partition("-")
    platform, cpu = (_PLATFORMS[prefix], suffix) if prefix in _PLATFORMS else (sys.platform, name)
    # _TRIPLES contains the supported combinations of a platform with x86-64 (True) or ARM (False).
    if (cpu not in LEVELS and cpu != AARCH64) or (platform, cpu in LEVELS) not in _TRIPLES:
        raise UsageError(
            f"unknown processor {name}: use native, {', '.join(LEVELS)} or {AARCH64}, with the "
            f"prefix {', '.join(f'{prefix}-' for prefix in _PLATFORMS)} for another platform"
        )
    return Target(cpu, "", platform)  # a level of x86-64 or AARCH64 has no list of features


@cache
def runnable() -> tuple[Target, ...]:
    """Return the targets with object files that this machine can execute, the most specific first.

    The first target is this machine. On x86-64, the levels with features that the processor has
    follow, on 64-bit ARM the common target. Other families of processors have no further target.
    """
    if _family() == AARCH64:
        return native(), Target(AARCH64, "")
    if _family() != "x86_64":
        return (native(),)
    features = {name for name, present in llvm.get_host_cpu_features().items() if present}
    return native(), *(Target(name, "") for name, needed in LEVELS.items() if needed <= features)
