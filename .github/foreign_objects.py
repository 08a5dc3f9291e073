"""Check the undefined symbols and relocations of object files for other platforms, which cannot be
run on this machine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import lief

LIBRARY = {
    *(
        "acos",
        "acosh",
        "asin",
        "asinh",
        "atan",
        "atan2",
        "atanh",
        "cbrt",
        "cos",
        "cosh",
        "erf",
        "erfc",
        "exp",
        "exp2",
    ),
    *(
        "expm1",
        "fmod",
        "hypot",
        "ldexp",
        "log",
        "log10",
        "log1p",
        "log2",
        "pow",
        "sin",
        "sinh",
        "tan",
        "tanh",
    ),
    *("ceil", "floor", "rint", "trunc", "memcpy", "memmove", "memset"),
}
"""Symbols that the C libraries of all systems define."""

FURTHER = {
    "linux": {"sincos"},
    "darwin": {"__sincos_stret", "bzero", "__bzero"},
    "win32": {"_fltused"},  # a mark that floating-point numbers are used; nothing refers to it
}

NEAR = {"AMD64_ADDR32NB", "AMD64_ADDR32", "X86_64_32", "X86_64_32S"}
"""Relocations that hold only if all parts of an object come to lie within 4 GB, or low in
memory."""

_EXTERNAL, _TYPE = 0x01, 0x0E  # bits of the type of a symbol in Mach-O


def check(code: bytes, about: Mapping[str, Any]) -> None:
    """Refuse an object that could not be loaded on its platform.

    Raises
    ------
    ValueError
        It needs more than the C library's mathematics, or relocations that may not reach.
    """
    left, kinds = left_open(code, about["platform"])
    wrong = [*sorted(left - LIBRARY - FURTHER[about["platform"]]), *sorted(kinds & NEAR)]
    if wrong:
        raise ValueError(
            f"{about['kernel']} for {about['target']} on {about['platform']}: {', '.join(wrong)}"
        )


def left_open(code: bytes, platform: str) -> tuple[set[str], set[str]]:
    """Return the undefined symbols of an object and the types of its relocations."""
    if platform == "win32":
        coff = lief.COFF.parse(list(code))
        external = lief.COFF.Symbol.STORAGE_CLASS.EXTERNAL
        left = {
            one.name
            for one in coff.symbols
            if not one.section_idx and one.storage_class == external
        }
        return left, _kinds(coff.sections)
    if platform == "darwin":
        macho = lief.MachO.parse(list(code)).at(0)
        left = {
            one.name.removeprefix("_")
            for one in macho.symbols
            if one.raw_type & (_TYPE | _EXTERNAL) == _EXTERNAL
        }
        return left, _kinds(macho.sections)
    elf = lief.ELF.parse(list(code))
    kinds = {one.type.name for one in elf.relocations}
    return {one.name for one in elf.symbols if not one.shndx and one.name}, kinds


def _kinds(sections: Any) -> set[str]:
    return {one.type.name for section in sections for one in section.relocations}
