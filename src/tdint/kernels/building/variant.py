"""Which parts of the time loops a scene needs: what it does without is not compiled."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace


@dataclass(frozen=True)
class Variant:
    """What a kernel is compiled for.

    Attributes
    ----------
    laws : tuple of str
        Drift laws of the stories by name, in the order of `tdint.kernels.laws.LAWS`; empty for all of ours. One of a
        plug-in is named with its number, `name@9`.
    modal : bool
        Modal damping.
    forces : bool
        Forces on floors.
    dashpots : bool
        Dashpots, linear ones or of a power law.
    """

    laws: tuple[str, ...] = ()
    modal: bool = True
    forces: bool = True
    dashpots: bool = True

    @property
    def text(self) -> str:
        """The variant in a word that a file name may hold, read by `parse`."""
        parts = "".join(f"+{name}" for name in FEATURES if getattr(self, name))
        return (",".join(self.laws) or "all") + parts

    @property
    def outside(self) -> dict[str, int]:
        """The numbers of the laws of plug-ins, by name."""
        split = (law.partition("@") for law in self.laws)
        return {name: int(code) for name, at, code in split if at}

    def only(self, parts: tuple[str, ...]) -> Variant:
        """The variant of a kernel that depends on some `parts` alone (names of the attributes)."""
        return replace(self, **{name: getattr(EVERYTHING, name) for name in _PARTS if name not in parts})


EVERYTHING = Variant()
_PARTS = tuple(field.name for field in fields(Variant))
FEATURES = _PARTS[1:]


def parse(text: str) -> Variant:
    """Read what `Variant.text` writes."""
    laws, *features = text.split("+")
    if unknown := set(features) - set(FEATURES):
        raise ValueError(f"variant {text!r}: unknown {', '.join(sorted(unknown))}")
    chosen = () if laws == "all" else tuple(laws.split(","))
    return Variant(chosen, **{name: name in features for name in FEATURES})
