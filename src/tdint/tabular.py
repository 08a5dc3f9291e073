"""Results as a person at a Python prompt or in a notebook meets them: a short line, a table, columns for pandas."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any, ClassVar, Generic, TypeVar


class Tabular:
    """A result with a table. Its columns are declared where tables are written, which may know all results, while
    results know nothing of tables: the package's front door, which knows both, says where they are.

    Attributes
    ----------
    tables, figures : str
        Names of the modules with `to_dict` and `to_html`, and with `plot`; set by `tdint/__init__.py`.
    """

    tables: ClassVar[str]
    figures: ClassVar[str]

    def _headline(self) -> str:
        """What it is, in a line."""
        raise NotImplementedError

    def to_dict(self, units: str = "") -> dict[str, Any]:
        """The columns of its table by name, as arrays: `pandas.DataFrame(result.to_dict())`.

        Parameters
        ----------
        units : str
            Units in place of SI, such as `kip,in,g`; the names change with them.

        Returns
        -------
        dict
            Arrays of one length; words as lists.
        """
        columns: dict[str, Any] = import_module(self.tables).to_dict(self, units)
        return columns

    def plot(self, ax: Any = None, units: str = "") -> Any:
        """Draw it: a new figure, or its main panel on axes that are there.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            The axes; what has no single panel is refused.
        units : str
            Units in place of SI, such as `kip,in,g`.

        Returns
        -------
        matplotlib.figure.Figure or matplotlib.axes.Axes
            The figure, of this call alone: matplotlib's pyplot does not know it; or the axes that were given.
        """
        return import_module(self.figures).plot(self, ax=ax, units=units)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self._headline()}>"

    def _repr_html_(self) -> str:
        """A caption and the first rows, for notebooks."""
        return str(import_module(self.tables).to_html(self, self._headline()))


Member = TypeVar("Member")


class Several(Tabular, Generic[Member]):
    """Results of one kind in a row, with one table: it has a length, members by number, and may be walked through.

    Attributes
    ----------
    members : tuple
        The results.
    """

    def __init__(self, members: Iterable[Member]) -> None:
        self.members = tuple(members)

    def __len__(self) -> int:
        return len(self.members)

    def __iter__(self) -> Iterator[Member]:
        return iter(self.members)

    def __getitem__(self, place: int) -> Member:
        return self.members[place]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Several) and self.members == other.members

    def __hash__(self) -> int:
        return hash(self.members)

    def _headline(self) -> str:
        return f"{len(self.members)} of {type(self.members[0]).__name__}" if self.members else "none"


class FunctionPackage(ModuleType):
    """A package that is the function of its name, too: once it is loaded, `tdint.campaign` stands for both."""

    def __call__(self, *given: Any, **named: Any) -> Any:
        """Call the function."""
        whole, _, name = self.__name__.rpartition(".")
        return import_module(whole).__getattr__(name)(*given, **named)


def modules_on_use(package: str) -> Callable[[str], ModuleType]:
    """The `__getattr__` of a package whose modules are imported when they are first used."""

    def found(name: str) -> ModuleType:
        if find_spec(f"{package}.{name}") is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return import_module(f"{package}.{name}")

    return found
