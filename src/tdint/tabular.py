"""Functions and results as a person at a Python prompt or in a notebook meets them: arguments that
are none are told by their names; a short line, a table, columns for pandas."""

from __future__ import annotations

import ast
import functools
import inspect
import logging
import numbers
import os
import reprlib
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar, Generic, ParamSpec, TypeVar, overload

from tdint.errors import TdintError, UsageError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

P = ParamSpec("P")
Result = TypeVar("Result")

_OF_ARGUMENTS = (TypeError, ValueError, AttributeError, IndexError, OverflowError)
"""What Python and numpy raise of an argument that is of another kind than it must be."""


_RENAMED = {"methods": "method", "dts": "dt"}
"""What arguments were called in 0.1, taken for one release more."""


class WrongCall(UsageError, TypeError):
    """A call without an argument that it needs, or with one that it does not have."""


@functools.cache
def asked_rightly(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """A function of `tdint` that says which argument is of another kind than its signature tells,
    if it fails by one.

    Its arguments are looked at then only: whatever works, works. What fails by none of them is a
    bug, and raised as it is.
    """

    @functools.wraps(function)
    def asked(*given: Any, **named: Any) -> Any:
        for before, now in _RENAMED.items():
            if (
                before in named
                and before not in (known := inspect.signature(function).parameters)
                and now in known
            ):
                warnings.warn(f"{name}: {before} is {now} now", DeprecationWarning, stacklevel=2)
                named[now] = named.pop(before)
        try:
            return function(*given, **named)
        except TdintError:
            raise
        except _OF_ARGUMENTS as error:
            try:
                arguments = inspect.signature(function).bind(*given, **named)
            except TypeError as wrong:
                raise WrongCall(f"{name}: {wrong}") from None
            # Without an argument to blame the fault is ours.
            raise _fault(name, arguments) or error from error

    asked.__module__, asked.__qualname__, asked.__name__ = (
        "tdint",
        name,
        name,
    )  # where pickle finds it
    return asked


def _fault(function: str, arguments: inspect.BoundArguments) -> UsageError | None:
    """The first argument that is not of the kind that its annotation tells; if there is none, the
    first one that may be anything."""
    anything = None
    for parameter in arguments.signature.parameters.values():
        if parameter.name not in arguments.arguments:
            continue
        value = arguments.arguments[parameter.name]
        of_one = parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
        annotation = parameter.annotation
        written = (
            annotation if isinstance(annotation, str) else inspect.formatannotation(annotation)
        )
        kind = ast.parse(written, mode="eval").body
        values = (
            value.values() if isinstance(value, dict) and of_one else value if of_one else (value,)
        )
        got = reprlib.repr(value)
        if not all(_is_of(item, kind) for item in values):
            return UsageError(f"{function}: {parameter.name} must be {_in_words(kind)}, got {got}")
        if anything is None and any(_is_open(part) for part in ast.walk(kind)):
            anything = UsageError(
                f"{function}: {parameter.name} cannot be used as it is, got {got}"
            )
    return anything


def _is_open(kind: ast.AST) -> bool:
    """Whether it stands for anything, or for what only the function can judge: `AnyModel`,
    `AnyRecord`, ..."""
    return isinstance(kind, ast.Name) and kind.id.startswith("Any")


def _is_of(value: Any, kind: ast.expr) -> bool:
    """Whether a value is of the kind that an annotation tells."""
    match kind:
        case ast.BinOp():
            return _is_of(value, kind.left) or _is_of(value, kind.right)
        case ast.Constant():
            return value is kind.value
        case ast.Subscript(value=ast.Name(id="tuple"), slice=ast.Tuple(elts=kinds)):
            return (
                isinstance(value, tuple)
                and len(value) == len(kinds)
                and all(map(_is_of, value, kinds))
            )
        case ast.Subscript(value=ast.Name(id="Mapping")):
            return isinstance(value, Mapping)
        case ast.Subscript(value=ast.Name(id="Sequence" | "Iterable"), slice=member):
            # A text is a sequence to Python; a generator would be used up by a look at its members.
            several = isinstance(value, Iterable) and not isinstance(value, str | bytes | Mapping)
            several = several and getattr(value, "ndim", 1) > 0
            return several and (
                not hasattr(value, "__len__") or all(_is_of(item, member) for item in value)
            )
        case ast.Subscript(value=ast.Name(id="NDArray")):
            return getattr(value, "ndim", 0) == 1
        case ast.Name(id="Array"):
            row = isinstance(value, list | tuple) or getattr(value, "ndim", 0) == 1
            return row and len(value) > 0 and all(isinstance(item, numbers.Real) for item in value)
        case ast.Name(id=name) if name in _KINDS:
            # numpy's truth values are none of Python's, and Python's are numbers.
            truth = type(value).__name__ in ("bool", "bool_")
            return truth if name == "bool" else isinstance(value, _KINDS[name][0]) and not truth
        case ast.Name(id=name):
            # By the name, as annotations of types are not loaded at run time.
            return (
                _is_open(kind)
                or callable(value)
                or name in [item.__name__ for item in type(value).__mro__]
            )
    return True


_KINDS: dict[str, tuple[tuple[type, ...], str]] = {
    "float": ((numbers.Real,), "a number"),
    "int": ((numbers.Integral,), "a whole number"),
    "bool": ((bool,), "True or False"),
    "str": ((str,), "a text"),
    "Path": ((os.PathLike,), "a path"),
}


def _in_words(kind: ast.expr) -> str:
    """An annotation for people."""
    match kind:
        case ast.BinOp():
            return f"{_in_words(kind.left)} or {_in_words(kind.right)}"
        case ast.Subscript(value=ast.Name(id="Sequence" | "Iterable"), slice=member):
            return f"a sequence (each {_in_words(member)})"
        case ast.Name(id="Array") | ast.Subscript(value=ast.Name(id="NDArray")):
            return "an array of numbers in one row"
        case ast.Name(id=name) if name in _KINDS:
            return _KINDS[name][1]
    return ast.unparse(kind)


Progress = Callable[[int, int], None]
"""Told how much is done, of how much."""


def optional(package: str, purpose: str, extra: str = "notebook") -> Any:
    """A package that is not needed else; UsageError where it is not installed."""
    try:
        return import_module(package)
    except ImportError:
        raise UsageError(
            f"{purpose} needs {package.partition('.')[0]}: pip install 'tdint[{extra}]'"
        ) from None


@contextmanager
def told_progress(asked: bool | Progress, count: int, unit: str) -> Iterator[Progress]:
    """What to tell of progress: nothing, a callable's, or a bar on a terminal or in a notebook;
    none into a pipe.

    Raises
    ------
    UsageError
        What is neither. Without tqdm there is no bar, and a warning says so.
    """
    if callable(asked):
        yield asked
        return
    if not isinstance(asked, bool):
        raise UsageError(f"progress is True, False or a callable (done, of), got {asked!r:.60}")
    if not asked:
        yield lambda done, of: None
        return
    with (
        warnings.catch_warnings()
    ):  # a notebook without ipywidgets has a bar of letters, which is none of its faults
        warnings.simplefilter("ignore")
        try:
            tqdm = optional("tqdm.auto", "progress=True")
        except UsageError as error:
            logging.getLogger("tdint").warning("%s; it runs without a bar", error)
            yield lambda done, of: None
            return
    # A bar that is not told otherwise draws itself on terminals alone; a notebook is none.
    with tqdm.tqdm(
        total=count, unit=unit, disable=False if "ipykernel" in sys.modules else None
    ) as bar:

        def show(done: int, of: int) -> None:
            bar.update(done - bar.n)

        yield show


class Tabular:
    """A result with a table. Its columns are declared where tables are written, which may know all
    results, while results know nothing of tables: the package's front door, which knows both, says
    where they are.

    Attributes
    ----------
    tables, figures : str
        Names of the modules with `to_dict` and `to_html`, and with `plot`; set by
        `tdint/__init__.py`.
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

    def to_pandas(self, units: str = "") -> DataFrame:
        """Its table as a DataFrame of pandas.

        Parameters
        ----------
        units : str
            As of `to_dict`.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        UsageError
            It has no table, an unknown unit; pandas is not installed.
        """
        return optional("pandas", "to_pandas").DataFrame(self.to_dict(units))

    def to_parquet(self, file: str | Path) -> None:
        """Write its table, SI units, as a Parquet file whose columns say their units; one that is
        there is replaced.

        Parameters
        ----------
        file : str or Path
            NAME.parquet.

        Raises
        ------
        UsageError
            It has no table; pyarrow is not installed.
        OutputError
            The file cannot be written.
        """
        import_module(self.tables).to_parquet(self, file)

    @overload
    def plot(self, ax: None = None, units: str = "") -> Figure: ...

    @overload
    def plot(self, ax: Axes, units: str = "") -> Axes: ...

    def plot(self, ax: Axes | None = None, units: str = "") -> Figure | Axes:
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
            The figure, of this call alone: a notebook shows it, pyplot does not know it; or the
            axes given.

        Raises
        ------
        UsageError
            It has no picture, or no main panel; an unknown unit.
        """
        drawn: Figure | Axes = import_module(self.figures).plot(self, ax=ax, units=units)
        return drawn

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self._headline()}>"

    def _repr_html_(self) -> str:
        """A caption and the first rows, for notebooks."""
        return str(import_module(self.tables).to_html(self, self._headline()))


Member = TypeVar("Member")


class ResultList(Tabular, Generic[Member]):
    """Results of one kind in a row, with one table: it has a length, members by number, and may be
    walked through.

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
        return isinstance(other, ResultList) and self.members == other.members

    def __hash__(self) -> int:
        return hash(self.members)

    def _headline(self) -> str:
        return (
            f"{len(self.members)} of {type(self.members[0]).__name__}" if self.members else "none"
        )


def each_of(function: Callable[P, Result]) -> Callable[P, Result]:
    """A function whose first argument may be a list or a tuple, too: then it gives a `ResultList`
    of what it gives for each, which a checker of types takes for one."""
    first = next(iter(inspect.signature(function).parameters))

    @functools.wraps(function)
    def one_or_each(*given: P.args, **named: P.kwargs) -> Any:
        of, rest = (given[0], given[1:]) if given else (named.get(first), ())
        if not isinstance(of, list | tuple | ResultList):
            return function(*given, **named)
        named.pop(first, None)
        return ResultList(function(one, *rest, **named) for one in of)  # type: ignore[arg-type]

    return one_or_each


class FunctionPackage(ModuleType):
    """A package that is the function of its name, too: once it is loaded, `tdint.campaign` stands
    for both."""

    def __call__(self, *given: Any, **named: Any) -> Any:
        """Call the function."""
        return self._function(*given, **named)

    @property
    def _function(self) -> Callable[..., Any]:
        whole, _, name = self.__name__.rpartition(".")
        function: Callable[..., Any] = import_module(whole).__getattr__(name)
        return function

    @property
    def __signature__(self) -> inspect.Signature:
        return inspect.signature(self._function)


def modules_on_use(package: str) -> Callable[[str], ModuleType]:
    """The `__getattr__` of a package whose modules are imported when they are first used."""

    def found(name: str) -> ModuleType:
        if find_spec(f"{package}.{name}") is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return import_module(f"{package}.{name}")

    return found
