"""What a mutant of `inputs.py` changes: an option, a key or an argument, and its receiver."""

from dataclasses import dataclass

Place = tuple[str, str]
"""Command, file type or function, and the name of the option, key or argument."""


@dataclass(frozen=True)
class Mutant:
    """Change of an option, a key or an argument.

    Attributes
    ----------
    place : tuple of str
        What is changed.
    receiver : str
        Name of the option, key or argument that receives the value; empty if the value is ignored.
    """

    place: Place
    receiver: str = ""

    def __str__(self) -> str:
        owner, name = self.place
        return f"{owner} {name}: " + (f"as {self.receiver}" if self.receiver else "ignored")
