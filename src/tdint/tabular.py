"""Support for use from a Python prompt or a notebook.

Results have a one-line description, an HTML table, and columns for pandas, Parquet and figures.
Modules are imported at their first use.
"""

from __future__ import annotations

import functools
import inspect
import logging
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar, overload

from tdint.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame


Progress = Callable[[int, int], None]
"""Callable that receives the number of completed parts and the total number of parts."""


def import_optional(package: str, purpose: str, extra: str = "notebook") -> Any:
    """Import an optional package.

    Parameters
    ----------
    purpose : str
        Option or method that requires the package, for the message.

    Raises
    ------
    UsageError
        The package is not installed.
    """
    try:
        return import_module(package)
    except ImportError:
        raise UsageError(
            f"{purpose} requires {package.partition('.')[0]}, which is not installed; install it "
            f"with: pip install 'tdint[{extra}]'"
        ) from None


@contextmanager
def progress_reporter(requested: bool | Progress, count: int, unit: str) -> Iterator[Progress]:
    """Return the callable that reports progress, as a context manager.

    Parameters
    ----------
    requested : bool or callable
        False for no report; True for a progress bar in a notebook or on a terminal (no bar is
        written to a pipe); or a callable that receives the completed and the total number of parts.
        Without tqdm, True results in a warning and no bar.
    unit : str
        Name of a part, displayed by the bar.

    Raises
    ------
    UsageError
        `requested` is neither a bool nor a callable.
    """
    if callable(requested):
        yield requested
        return
    if not isinstance(requested, bool):
        raise UsageError(
            f"progress must be True, False or a callable (done, total), got {requested!r:.60}"
        )
    if not requested:
        yield lambda done, total: None
        return
    # In a notebook without ipywidgets, tqdm warns and shows a text bar, which is sufficient.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            tqdm = import_optional("tqdm.auto", "progress=True")
        except UsageError as error:
            logging.getLogger("tdint").warning("%s; no progress bar is shown", error)
            yield lambda done, total: None
            return
    # By default (None) tqdm shows a bar on terminals only, which excludes notebooks.
    with tqdm.tqdm(
        total=count, unit=unit, disable=False if "ipykernel" in sys.modules else None
    ) as bar:

        def advance_bar(done: int, total: int) -> None:
            """Set the bar to `done` parts; `update` expects the increment."""
            bar.update(done - bar.n)

        yield advance_bar


class Described:
    """Base class of results with a description of one line, which `repr` returns."""

    def _headline(self) -> str:
        """Return the result in one line without the class name.

        The default lists the scalars and texts of a dataclass, and the shapes of its arrays. Other
        attributes are omitted.
        """
        parts = []
        for item in fields(self):  # type: ignore[arg-type]
            value = getattr(self, item.name)
            if isinstance(value, float | int | str) and item.repr:
                text = f"{value:.4g}" if isinstance(value, float) else str(value)
                parts.append(f"{item.name} {text}")
            elif hasattr(value, "shape"):
                parts.append(f"{item.name} {value.shape}")
        return ", ".join(parts)

    def __repr__(self) -> str:
        text = f"<{type(self).__name__} {self._headline()}>"
        return text if len(text) <= _LINE else f"{text[: _LINE - 4]}...>"


_LINE = 200
"""Maximum number of characters of a description, about two lines of a terminal."""


class WithTable(Described):
    """Base class of results with a table and without a figure.

    The columns are declared in the output layer, which imports the results; the results do not
    import the output layer. `tdint/__init__.py` therefore sets the names of its modules.

    Attributes
    ----------
    tables : str
        Name of the module with `to_dict`, `to_html` and `to_parquet`.
    """

    tables: ClassVar[Callable[[], Any]]

    def to_dict(self, units: str = "") -> dict[str, Any]:
        """Return the columns of the table as arrays by name.

        `pandas.DataFrame(result.to_dict())` is the table as a data frame.

        Parameters
        ----------
        units : str
            Units to use instead of SI, such as `kip,in,g`. The units at the end of the column names
            change accordingly.

        Returns
        -------
        dict
            Arrays of equal length by column name. Columns of text are lists.

        Raises
        ------
        UsageError
            The result has no table, or a unit is unknown.
        """
        columns: dict[str, Any] = type(self).tables().to_dict(self, units)
        return columns

    def to_pandas(self, units: str = "") -> DataFrame:
        """Return the table as a pandas DataFrame.

        Parameters
        ----------
        units : str
            Units to use instead of SI, as for `to_dict`.

        Returns
        -------
        pandas.DataFrame
            The table, with a column for each entry of `to_dict`.

        Raises
        ------
        UsageError
            The result has no table, a unit is unknown, or pandas is not installed.
        """
        return import_optional("pandas", "to_pandas").DataFrame(self.to_dict(units))

    def to_parquet(self, file: str | Path) -> None:
        """Write the table in SI units as a Parquet file with the units of the columns as metadata.

        An existing file is replaced.

        Parameters
        ----------
        file : str or Path
            Name of the file, ending in .parquet.

        Raises
        ------
        UsageError
            The result has no table, or pyarrow is not installed.
        OutputError
            The file cannot be written.
        """
        type(self).tables().to_parquet(self, file)

    def _repr_html_(self) -> str:
        """Return a caption and the first rows as HTML, for notebooks."""
        return str(type(self).tables().to_html(self, self._headline()))


class Tabular(WithTable):
    """Base class of results with a table and a figure.

    Attributes
    ----------
    figures : str
        Name of the module with `plot`.
    """

    figures: ClassVar[Callable[[], Any]]
    _presentations: ClassVar[Callable[[], list[Any]]]

    @overload
    def plot(self, ax: None = None, units: str = "") -> Figure: ...

    @overload
    def plot(self, ax: Axes, units: str = "") -> Axes: ...

    def plot(self, ax: Axes | None = None, units: str = "") -> Figure | Axes:
        """Plot the result in a new figure, or plot its main panel on existing axes.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes for the main panel. Results with a figure of several equal panels refuse it.
        units : str
            Units to use instead of SI, such as `kip,in,g`.

        Returns
        -------
        matplotlib.figure.Figure or matplotlib.axes.Axes
            The new figure, which is not registered with pyplot (a notebook displays it), or `ax`.

        Raises
        ------
        UsageError
            The result has no figure or no main panel, or a unit is unknown.
        """
        result: Figure | Axes = type(self).figures().plot(self, ax=ax, units=units)
        return result


Member = TypeVar("Member")


class ResultList(Tabular, Generic[Member]):
    """Immutable sequence of results of a single class, with a common table.

    It has a length, can be indexed with an integer, and can be iterated.

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

    def __getitem__(self, index: int) -> Member:
        return self.members[index]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ResultList) and self.members == other.members

    def __hash__(self) -> int:
        return hash(self.members)

    def _headline(self) -> str:
        """Return the number and the class of the members."""
        return (
            f"{len(self.members)} of {type(self.members[0]).__name__}" if self.members else "none"
        )


def map_over_first(function: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a function so that its first argument may also be a list or a tuple.

    For a list or a tuple, the wrapper calls the function with each member and returns a
    `ResultList` of the results. Overloads state both results for type checkers.
    """
    first_name = next(iter(inspect.signature(function).parameters))

    @functools.wraps(function)
    def wrapper(*arguments: Any, **keywords: Any) -> Any:
        """Call the function, or call it for each member of a list and return a `ResultList`."""
        if arguments:
            first, further = arguments[0], arguments[1:]
        else:  # the first argument is passed by name
            first, further = keywords.get(first_name), ()
        if not isinstance(first, list | tuple | ResultList):
            return function(*arguments, **keywords)
        keywords.pop(first_name, None)
        results = (function(member, *further, **keywords) for member in first)
        return ResultList(
            item
            for result in results
            for item in (result if isinstance(result, ResultList) else (result,))
        )

    return wrapper


class FunctionPackage(ModuleType):
    """Package with the same name as a public function: calling the package calls the function.

    After its import, a package such as `tdint.methods` replaces the function `tdint.methods` as
    the attribute of `tdint`; this class therefore makes the package callable.

    Attributes
    ----------
    functions : callable
        Returns the public function with a given name. Set by `tdint/__init__.py`, because only
        this module has the list of all public functions.
    """

    functions: ClassVar[Callable[[str], Callable[..., Any]]]

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        """Call the function of the same name."""
        return self._function(*arguments, **keywords)

    @property
    def _function(self) -> Callable[..., Any]:
        """Public function with the name of the package, such as `methods` for `tdint.methods`."""
        return type(self).functions(self.__name__.rpartition(".")[2])

    @property
    def __signature__(self) -> inspect.Signature:
        """Signature of the function, which `help` and editors display."""
        return inspect.signature(self._function)

    @property
    def __doc__(self) -> str:  # type: ignore[override]
        """Signature and docstring of the function, which `help` shows as the description."""
        function = self._function
        name = self.__name__.rpartition(".")[2]
        return f"{name}{inspect.signature(function)}\n\n{inspect.getdoc(function)}"


class _OnUse:
    """Function of a module that is imported when the function is called."""

    def __init__(self, find: Callable[[], Any]) -> None:
        self._find = find

    def __getattr__(self, name: str) -> _OnUse:
        return _OnUse(lambda: getattr(self._find(), name))

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        return self._find()(*arguments, **keywords)


def on_use(module: str) -> Any:
    """Return a placeholder for a module. Its attributes are functions that import the module when
    they are called; also an attribute of an attribute, such as `Acceptance.parse`."""
    return _OnUse(lambda: import_module(module))


def modules_on_use(package: str, style: str = "") -> Callable[[str], ModuleType]:
    """Return a `__getattr__` for a package that imports its modules, and the modules of its
    subpackages, at their first use.

    `package` is the full name of the package, such as `tdint.output.tables`. `style` is the module
    that must be the first that imports matplotlib: it is imported before a module with `figures` in
    its full name.
    """

    def import_on_use(name: str) -> ModuleType:
        """Import the module `name`; raise AttributeError if there is no module."""
        module = f"{package}.{name}"
        if find_spec(module) is None:
            file = next(Path(sys.modules[package].__path__[0]).glob(f"*/{name}.py"), None)
            if file is None:
                raise AttributeError(f"module {package!r} has no attribute {name!r}")
            module = f"{package}.{file.parent.name}.{name}"
        if style and "figures" in module:
            import_module(style)
        return import_module(module)

    return import_on_use
