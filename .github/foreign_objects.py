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
    "tdint.laws",
}
"""Symbols that the C libraries of all systems define, and the table of laws, which tdint defines
before it loads an object."""

FURTHER = {
    "linux": {"sincos"},
    "darwin": {"__sincos_stret", "bzero", "__bzero"},
    "win32": {"_fltused"},  # marks the use of floating-point numbers and is not called
}

NEAR = {"AMD64_ADDR32NB", "AMD64_ADDR32", "X86_64_32", "X86_64_32S"}
"""Relocations that are valid only if an object is loaded within 4 GB, or at low addresses."""

_EXTERNAL, _TYPE = 0x01, 0x0E  # bits of the type of a symbol in Mach-O


def check(code: bytes, about: Mapping[str, Any]) -> None:
    """Refuse an object that could not be loaded on its platform.

    Raises
    ------
    ValueError
        If the object requires more than the mathematical functions of the C library, or contains
        relocations with a range that may be too short.
    """
    undefined, relocations = undefined_symbols(code, about["platform"])
    refused = [
        *sorted(undefined - LIBRARY - FURTHER[about["platform"]]),
        *sorted(relocations & NEAR),
    ]
    if refused:
        raise ValueError(
            f"{about['kernel']} for {about['target']} on {about['platform']}: {', '.join(refused)}"
        )


def undefined_symbols(code: bytes, platform: str) -> tuple[set[str], set[str]]:
    """Return the undefined symbols of an object and the types of its relocations."""
    if platform == "win32":
        coff = lief.COFF.parse(list(code))
        external = lief.COFF.Symbol.STORAGE_CLASS.EXTERNAL
        undefined = {
            symbol.name
            for symbol in coff.symbols
            if not symbol.section_idx and symbol.storage_class == external
        }
        return undefined, _relocation_types(coff.sections)
    if platform == "darwin":
        macho = lief.MachO.parse(list(code)).at(0)
        undefined = {
            symbol.name.removeprefix("_")
            for symbol in macho.symbols
            if symbol.raw_type & (_TYPE | _EXTERNAL) == _EXTERNAL
        }
        return undefined, _relocation_types(macho.sections)
    elf = lief.ELF.parse(list(code))
    types = {relocation.type.name for relocation in elf.relocations}
    return {symbol.name for symbol in elf.symbols if not symbol.shndx and symbol.name}, types


def _relocation_types(sections: Any) -> set[str]:
    """Return the types of all relocations of the sections of an object."""
    return {relocation.type.name for section in sections for relocation in section.relocations}
