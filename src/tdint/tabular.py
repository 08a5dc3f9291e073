"""Support for use from a Python prompt or a notebook.

Calls with arguments of a wrong type raise an error that names the argument. Results have a one-line
description, an HTML table, and columns for pandas, Parquet and figures.
"""

from __future__ import annotations

import ast
import functools
import inspect
import logging
import numbers
import os
import re
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

_ARGUMENT_ERRORS = (TypeError, ValueError, AttributeError, IndexError, OverflowError)
"""Errors that Python and numpy raise for an argument of a wrong type."""


class WrongCall(UsageError, TypeError):
    """Call with a missing or an unknown argument."""


@functools.cache
def validated_call(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """Wrap a public function so that errors name the argument of a wrong type.

    Arguments are compared with the signature only after the function has failed, because the
    comparison takes time. If every argument has the declared type, the failure is a bug of tdint,
    and its exception is raised unchanged.

    Parameters
    ----------
    function : callable
        The function.
    name : str
        Its public name, for messages.
    """

    @functools.wraps(function)
    def wrapper(*arguments: Any, **keywords: Any) -> Any:
        try:
            return function(*arguments, **keywords)
        except TdintError:
            raise
        except _ARGUMENT_ERRORS as error:
            try:
                bound = inspect.signature(function).bind(*arguments, **keywords)
            except TypeError as binding_error:  # a missing or an unknown argument
                raise WrongCall(f"{name}: {binding_error}") from None
            # If no argument has a wrong type, the error is a bug of tdint.
            raise _wrong_argument(name, bound) or error from error

    # pickle imports the function by its public name.
    wrapper.__module__, wrapper.__qualname__, wrapper.__name__ = "tdint", name, name
    return wrapper


def _wrong_argument(function: str, arguments: inspect.BoundArguments) -> UsageError | None:
    """Return an error for the first argument that does not match its annotation.

    If all arguments match, the error is for the first argument with an annotation such as `Any` or
    `AnyModel`: it matches every value, so that the value may still be the cause of the failure.
    Without such an argument, return None.
    """
    unchecked_error = None
    for parameter in arguments.signature.parameters.values():
        if parameter.name not in arguments.arguments:
            continue
        value = arguments.arguments[parameter.name]
        is_variadic = parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
        annotation = parameter.annotation
        annotation_text = (
            annotation if isinstance(annotation, str) else inspect.formatannotation(annotation)
        )
        expression = ast.parse(annotation_text, mode="eval").body
        # The value of *arguments is a tuple, the value of **keywords a dict; check their members.
        values = (
            value.values()
            if isinstance(value, dict) and is_variadic
            else value
            if is_variadic
            else (value,)
        )
        got = reprlib.repr(value)
        if not all(_matches(item, expression) for item in values):
            return UsageError(
                f"{function}: {parameter.name} must be {_as_text(expression)}, got {got}"
            )
        if unchecked_error is None and any(_accepts_any(part) for part in ast.walk(expression)):
            unchecked_error = UsageError(
                f"{function}: invalid value of {parameter.name}, got {got}"
            )
    return unchecked_error


def _accepts_any(annotation: ast.AST) -> bool:
    """Return True if the annotation accepts values that only the function can check.

    The names of such annotations start with `Any`: `Any`, `AnyModel`, `AnyRecord`, ...
    """
    return isinstance(annotation, ast.Name) and annotation.id.startswith("Any")


def _matches(value: Any, annotation: ast.expr) -> bool:
    """Return True if a value matches an annotation, or if the annotation cannot be checked."""
    match annotation:
        case ast.BinOp():  # the operator | of a union
            return _matches(value, annotation.left) or _matches(value, annotation.right)
        case ast.Constant():  # None
            return value is annotation.value
        case ast.Subscript(value=ast.Name(id="tuple"), slice=ast.Tuple(elts=members)):
            return (
                isinstance(value, tuple)
                and len(value) == len(members)
                and all(map(_matches, value, members))
            )
        case ast.Subscript(value=ast.Name(id="Mapping")):
            return isinstance(value, Mapping)
        case ast.Subscript(value=ast.Name(id="Sequence" | "Iterable"), slice=member):
            # Texts and mappings are iterable in Python, but are not sequences of values here.
            # Members of a generator are not checked, because this would consume the generator.
            is_sequence = isinstance(value, Iterable) and not isinstance(
                value, str | bytes | Mapping
            )
            is_sequence = is_sequence and getattr(value, "ndim", 1) > 0
            return is_sequence and (
                not hasattr(value, "__len__") or all(_matches(item, member) for item in value)
            )
        case ast.Subscript(value=ast.Name(id="NDArray")):
            return getattr(value, "ndim", 0) == 1
        case ast.Name(id="Array" | "Numbers"):
            has_one_axis = isinstance(value, list | tuple) or getattr(value, "ndim", 0) == 1
            return (
                has_one_axis
                and len(value) > 0
                and all(isinstance(item, numbers.Real) for item in value)
            )
        case ast.Name(id=name) if name in _SIMPLE_TYPES:
            # In Python, bool is a subclass of int; numpy's bool_ is not a subclass of bool.
            is_bool = type(value).__name__ in ("bool", "bool_")
            if name == "bool":
                return is_bool
            return isinstance(value, _SIMPLE_TYPES[name][0]) and not is_bool
        case ast.Name(id=name):
            # Types are compared by name, because modules imported for annotations only are not
            # loaded at run time.
            return (
                _accepts_any(annotation)
                or callable(value)
                or name in [item.__name__ for item in type(value).__mro__]
            )
    return True


_SIMPLE_TYPES: dict[str, tuple[tuple[type, ...], str]] = {
    "float": ((numbers.Real,), "a number"),
    "int": ((numbers.Integral,), "a whole number"),
    "bool": ((bool,), "True or False"),
    "str": ((str,), "a text"),
    "Path": ((os.PathLike,), "a path"),
}
"""Accepted types and description for messages, by the name in an annotation."""


def _as_text(annotation: ast.expr) -> str:
    """Return an annotation as text for a message."""
    match annotation:
        case ast.BinOp():
            return f"{_as_text(annotation.left)} or {_as_text(annotation.right)}"
        case ast.Subscript(value=ast.Name(id="Sequence" | "Iterable"), slice=member):
            return f"a sequence (each {_as_text(member)})"
        case ast.Name(id="Array" | "Numbers") | ast.Subscript(value=ast.Name(id="NDArray")):
            return "an array of numbers in one row"
        case ast.Name(id=name) if name in _SIMPLE_TYPES:
            return _SIMPLE_TYPES[name][1]
    return ast.unparse(annotation)


Progress = Callable[[int, int], None]
"""Callable that receives the number of completed parts and the total number of parts."""


def import_optional(package: str, purpose: str, extra: str = "notebook") -> Any:
    """Import an optional package.

    Parameters
    ----------
    package : str
        Name of the module to import.
    purpose : str
        Option or method that requires the package, for the message.
    extra : str
        Extra of tdint that installs the package.

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
    count : int
        Total number of parts.
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
    # In a notebook without ipywidgets, tqdm warns and draws a text bar, which is sufficient.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            tqdm = import_optional("tqdm.auto", "progress=True")
        except UsageError as error:
            logging.getLogger("tdint").warning("%s; no progress bar is shown", error)
            yield lambda done, total: None
            return
    # By default (None) tqdm draws a bar on terminals only, which excludes notebooks.
    with tqdm.tqdm(
        total=count, unit=unit, disable=False if "ipykernel" in sys.modules else None
    ) as bar:

        def advance_bar(done: int, total: int) -> None:
            bar.update(done - bar.n)

        yield advance_bar


class Tabular:
    """Base class of results with a table.

    The columns are declared in the output layer, which imports the results; the results do not
    import the output layer. `tdint/__init__.py` therefore sets the names of its modules.

    Attributes
    ----------
    tables : str
        Name of the module with `to_dict`, `to_html` and `to_parquet`.
    figures : str
        Name of the module with `plot`.
    """

    tables: ClassVar[Callable[[], Any]]
    figures: ClassVar[Callable[[], Any]]

    def _headline(self) -> str:
        """Return the description of the result in one line, for `repr` and the HTML caption."""
        raise NotImplementedError

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
            The table, with one column for each entry of `to_dict`.

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

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self._headline()}>"

    def _repr_html_(self) -> str:
        """Return a caption and the first rows as HTML, for notebooks."""
        return str(type(self).tables().to_html(self, self._headline()))


Member = TypeVar("Member")


class ResultList(Tabular, Generic[Member]):
    """Immutable sequence of results of one class, with a common table.

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
    `ResultList` of the results. Overloads at the function state both results for type checkers.
    """
    first_name = next(iter(inspect.signature(function).parameters))

    @functools.wraps(function)
    def wrapper(*arguments: Any, **keywords: Any) -> Any:
        if arguments:
            first, further = arguments[0], arguments[1:]
        else:  # the first argument is passed by name
            first, further = keywords.get(first_name), ()
        if not isinstance(first, list | tuple | ResultList):
            return function(*arguments, **keywords)
        keywords.pop(first_name, None)
        return ResultList(function(member, *further, **keywords) for member in first)

    return wrapper


class FunctionPackage(ModuleType):
    """Package with the same name as a public function: calling the package calls the function.

    After its import, a package such as `tdint.campaign` replaces the function `tdint.campaign` as
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
        return type(self).functions(self.__name__.rpartition(".")[2])

    @property
    def __signature__(self) -> inspect.Signature:
        return inspect.signature(self._function)

    @property
    def __doc__(self) -> str:  # type: ignore[override]
        """Signature and docstring of the function, which `help` shows as the description."""
        function = self._function
        name = self.__name__.rpartition(".")[2]
        return f"{name}{inspect.signature(function)}\n\n{inspect.getdoc(function)}"


def declared_homes(file: str) -> dict[str, str]:
    """Return the module that defines each name that a source file imports for type checkers only.

    Parameters
    ----------
    file : str
        Source file with indented lines `from MODULE import NAME as NAME`.

    Returns
    -------
    dict of str to str
        Module by name.
    """
    text = Path(file).read_text(encoding="utf-8")
    lines = re.findall(r"^    from (tdint\.\S+) import (?:\(\s*)?(\w+) as \2\b", text, re.MULTILINE)
    return {name: module for module, name in lines}


def modules_on_use(package: str) -> Callable[[str], ModuleType]:
    """Return a `__getattr__` for a package that imports its modules at their first use."""

    def import_on_use(name: str) -> ModuleType:
        if find_spec(f"{package}.{name}") is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return import_module(f"{package}.{name}")

    return import_on_use
