"""Contents of a campaign file as typed values in SI units. Other modules read the files that
it lists, such as models and records."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.errors import ModelError, ModelFault, UsageError
from tdint.ground_motion.choice import RecordChoice
from tdint.model.config.record_files import RecordFiles
from tdint.model.definition import Model
from tdint.model.keys import fields
from tdint.model.parameters import PARAMETERS, check_parameter, check_value
from tdint.number_parsing import number_or_nan, parse_ratio
from tdint.studies.campaign.assigned_motions import FieldFile, GridFile, Levels, Scales
from tdint.studies.campaign.chunks import CampaignSettings
from tdint.studies.fragility.type_states import DamageRequest
from tdint.studies.keys import keys
from tdint.studies.regions.inventory import InventoryRows

# ---- Sweeps: variations of each building of a campaign over grids and samples of its parameters,
# methods and time steps (key `vary` of a campaign file and lists under `analysis`)

_MAX_VARIATIONS = (
    1_000_000  # maximum number of variations of a building, which are stored in memory
)
_LABEL_DIGITS = 6  # significant digits of the values in the labels of variations

DISTRIBUTIONS: Mapping[str, tuple[str, str]] = {
    "lognormal": ("median", "beta"),
    "normal": ("mean", "sd"),
    "uniform": ("low", "high"),
}
"""Distributions of random parameters, and the names of their two parameters."""


_MOST_SCORE = 39.0
"""Limit of the normal quantiles of double precision: a draw is nearer to the median, in standard
deviations."""


@dataclass(frozen=True)
class Distribution:
    """Distribution of a random parameter: `name` is a key of `DISTRIBUTIONS`; `first` and `second`
    are the values of its two parameters, for example median and beta of a lognormal
    distribution; `unit` is their unit, if they have one."""

    name: str
    first: float
    second: float
    unit: str = ""

    def __post_init__(self) -> None:
        """Raise UsageError if the parameters are invalid for this distribution."""
        first_name, second_name = DISTRIBUTIONS[self.name]
        if self.name == "uniform" and not self.first < self.second:
            raise UsageError(
                f"uniform: {first_name} must be less than {second_name}, got {self.first:g} and "
                f"{self.second:g}"
            )
        if self.name != "uniform" and not self.second > 0.0:
            raise UsageError(f"{self.name}: {second_name} must be positive, got {self.second:g}")
        if self.name == "lognormal" and not self.first > 0.0:
            raise UsageError(f"lognormal: {first_name} must be positive, got {self.first:g}")
        with np.errstate(over="ignore"):
            most = self.at_scores(np.array(_MOST_SCORE))
        if not np.isfinite(most):
            raise UsageError(
                f"{self.name}: {first_name} {self.first:g} and {second_name} {self.second:g} give "
                "values that exceed the range of numbers"
            )

    def at(self, probability: Array) -> Array:
        """Return the quantiles of the distribution at probabilities from 0 to 1, as an array of the
        same shape."""
        from scipy.special import ndtri

        if self.name == "uniform":
            return self.first + probability * (self.second - self.first)
        return self.at_scores(ndtri(probability))

    def at_scores(self, scores: Array) -> Array:
        """Return the quantiles of the distribution at the probabilities Phi(scores)."""
        from scipy.special import ndtr

        if self.name == "uniform":
            return self.at(ndtr(scores))
        # The second parameter is the standard deviation of the value (normal) or of its logarithm
        # (lognormal).
        deviations = self.second * scores
        if self.name == "lognormal":
            return np.asarray(self.first * np.exp(deviations))
        return np.asarray(self.first + deviations)


RANKS, VALUES = "ranks", "values"
"""Quantities that a correlation matrix refers to: ranks (Spearman) or values (Pearson)."""

_HERMITE_TERMS = 60
"""Number of Hermite polynomials in the correlation of two values; 60 terms are exact to rounding
for lognormal distributions with a beta up to 2."""


@dataclass(frozen=True)
class Correlation:
    """Correlation of random parameters that have a Gaussian copula.

    Attributes
    ----------
    parameters : tuple of str
        Names of the parameters, in the order of the rows and columns of the matrix.
    matrix : tuple of tuple of float
        Correlation of each two parameters.
    of : str
        `ranks` or `values`.
    """

    parameters: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]
    of: str = RANKS

    def __post_init__(self) -> None:
        """Raise UsageError if the matrix is not a correlation matrix of these parameters."""
        count = len(self.parameters)
        if [len(row) for row in self.matrix] != [count] * count:
            raise UsageError(
                f"the matrix must have {count} rows of {count} numbers, one for each of the "
                "parameters"
            )
        for i, name in enumerate(self.parameters):
            if self.matrix[i][i] != 1.0:
                raise UsageError(
                    f"the diagonal of the matrix must be 1, got {self.matrix[i][i]:g} for {name}"
                )
            for j, other in enumerate(self.parameters[:i]):
                if self.matrix[i][j] != self.matrix[j][i]:
                    raise UsageError(
                        f"the matrix must be symmetric, got {self.matrix[i][j]:g} and "
                        f"{self.matrix[j][i]:g} for {name} and {other}"
                    )
        _check_positive_definite(np.array(self.matrix), "the matrix")

    def of_scores(self, random: Mapping[str, Distribution]) -> Array:
        """Return the correlation matrix of the normal scores of the parameters.

        `random` has the distributions of all random parameters by name.

        Raises
        ------
        UsageError
            A parameter is not random, or its distribution does not permit a correlation.
        """
        for name in self.parameters:
            if name not in random:
                raise UsageError(
                    f"{name!r} is not a random parameter; random are: {', '.join(random) or 'none'}"
                )
        result = np.eye(len(self.parameters))
        for (i, first), (j, second) in itertools.combinations(enumerate(self.parameters), 2):
            rho = self.matrix[i][j]
            if self.of == RANKS:
                result[i, j] = result[j, i] = 2.0 * math.sin(math.pi * rho / 6.0)
                continue
            try:
                score = correlation_of_scores(rho, random[first], random[second])
            except UsageError as error:
                raise UsageError(f"{first} and {second}: {error}") from None
            result[i, j] = result[j, i] = score
        _check_positive_definite(result, "the matrix of the normal scores that it requires")
        return result

    @property
    def note(self) -> str:
        """Note for the user on the meaning of the matrix."""
        measure = {RANKS: "ranks (Spearman)", VALUES: "values (Pearson)"}[self.of]
        return (
            f"correlation of the {measure} of {', '.join(self.parameters)}: the samples of the "
            "Latin hypercube are reordered (Iman and Conover 1982)"
        )


def _check_positive_definite(matrix: Array, called: str) -> None:
    """Raise UsageError unless all eigenvalues of a correlation matrix are positive."""
    smallest = float(np.linalg.eigvalsh(matrix)[0])
    # Rounding errors are about 1e-16 times the number of parameters.
    if smallest <= 1e-12:
        raise UsageError(
            f"{called} must be positive definite, its smallest eigenvalue is "
            f"{0.0 if abs(smallest) <= 1e-12 else smallest:.6g}; reduce the correlations"
        )


def correlation_of_scores(rho: float, first: Distribution, second: Distribution) -> float:
    """Return the correlation of the normal scores of two parameters with a Gaussian copula, whose
    values have the correlation `rho` (Liu and Der Kiureghian 1986).

    Raises
    ------
    UsageError
        The distributions do not permit this correlation.
    """
    from scipy.optimize import brentq

    # Standardized values are sums a_n He_n(z) / sqrt(n!) of Hermite polynomials of the scores, so
    # that the correlation of two values is the sum of a_n b_n r^n, r being that of the scores.
    terms = np.prod([_hermite_coefficients(item) for item in (first, second)], axis=0)

    def of_values(score_correlation: float) -> float:
        """Return the correlation of the values."""
        return float(np.polynomial.polynomial.polyval(score_correlation, terms))

    low, high = of_values(-1.0), of_values(1.0)
    if not low < rho < high:
        raise UsageError(
            f"these distributions permit correlations of the values between {low:.4g} and "
            f"{high:.4g}, got {rho:g}"
        )
    return float(brentq(lambda r: of_values(r) - rho, -1.0, 1.0, xtol=1e-15))


def _hermite_coefficients(distribution: Distribution) -> Array:
    """Return the coefficients of the standardized values of a distribution in normalized Hermite
    polynomials of the normal score, shape (_HERMITE_TERMS,); the first, the mean, is zero."""
    scores, weights = np.polynomial.hermite_e.hermegauss(2 * _HERMITE_TERMS)
    values = distribution.at_scores(scores)
    # The normalized polynomials h_n = He_n / sqrt(n!) follow from their recurrence relation.
    polynomials = [np.ones_like(scores), scores]
    for n in range(2, _HERMITE_TERMS):
        next_one = scores * polynomials[-1] - math.sqrt(n - 1) * polynomials[-2]
        polynomials.append(next_one / math.sqrt(n))
    coefficients = np.array(polynomials) @ (weights * values)
    coefficients[0] = 0.0
    return np.asarray(coefficients / np.linalg.norm(coefficients))


def reordered(samples: Array, correlation: Array) -> Array:
    """Return samples, shape (n, k), with each column reordered so that the normal scores of the
    columns have a correlation (Iman and Conover 1982). The first column keeps its order.

    Parameters
    ----------
    samples : ndarray, shape (n, k)
        Independent samples without equal values in a column.
    correlation : ndarray, shape (k, k)
        Correlation matrix of the normal scores.

    Raises
    ------
    UsageError
        The samples are too few.
    """
    from scipy.special import ndtri

    def ranks(values: Array) -> NDArray[np.intp]:
        """Return the rank of each value in its column, from 0."""
        return np.argsort(np.argsort(values, axis=0, kind="stable"), axis=0)

    scores = ndtri((ranks(samples) + 1.0) / (len(samples) + 1.0))
    present = np.corrcoef(scores, rowvar=False)
    if len(samples) <= len(correlation) or np.linalg.eigvalsh(present)[0] < 1e-9:
        raise UsageError(
            f"{len(samples)} samples are too few for {len(correlation)} correlated parameters; "
            "use more samples"
        )
    # Remove the correlation of the scores, and introduce the requested one.
    transform = np.linalg.cholesky(correlation) @ np.linalg.inv(np.linalg.cholesky(present))
    order = ranks(scores @ transform.T)
    return np.take_along_axis(np.sort(samples, axis=0), order, axis=0)


@dataclass(frozen=True)
class ParameterSweep:
    """Variations of every building of a campaign.

    Attributes
    ----------
    grids : mapping of str to tuple of float or str
        Values of parameters (`tdint.model.parameters.PARAMETERS`), in all combinations: numbers in
        the units of the models that they vary, or texts with units.
    random : mapping of str to Distribution
        Random parameters, sampled by a Latin hypercube (McKay, Beckman and Conover 1979).
    correlation : Correlation | None
        Correlation of random parameters; the others are independent.
    samples : int
        Number of samples of the random parameters. Each combination of the other values is analyzed
        with the same samples.
    methods : tuple of str
        Methods with their parameters, in all combinations with the other values; empty: no
        variation.
    steps : tuple of float
        Time steps, s, in all combinations with the other values; empty: no variation.
    location : ModelFault | None
        Position of the sweep in the campaign file, for error messages; None: not from a file.
    """

    grids: Mapping[str, tuple[float | str, ...]] = field(default_factory=dict)
    random: Mapping[str, Distribution] = field(default_factory=dict)
    samples: int = 0
    seed: int = 0
    methods: tuple[str, ...] = ()
    steps: tuple[float, ...] = ()
    location: ModelFault | None = field(default=None, compare=False)
    correlation: Correlation | None = None

    @contextmanager
    def reported_at_key(self) -> Iterator[None]:
        """Convert a UsageError of an invalid variation to a ModelError that states the position of
        the sweep in the campaign file. The body of the `with` statement creates the buildings. The
        error is not converted if the sweep is not from a file."""
        try:
            yield
        except UsageError as error:
            if self.location is None:
                raise
            raise ModelError([self.location._replace(message=str(error))]) from None

    def changes(self) -> list[dict[str, float | str]]:
        """Return one dictionary per variation, from the name of a parameter to its value: a text
        if it has a unit, otherwise a number in the units of the model.

        The variations are all combinations of the grid values, each with all samples of the random
        parameters. Methods and time steps are not included.

        Raises
        ------
        UsageError
            A sampled value is out of range; there are too many variations, or too few samples of
            correlated parameters.
        """
        # Check the number of variations before they are created, because a typing error in the
        # campaign file can request so many that they do not fit in memory.
        count = math.prod(map(len, self.grids.values())) * max(self.samples, 1)
        if count > _MAX_VARIATIONS:
            raise UsageError(
                f"the sweep has {count} variations of each building; at most "
                f"{_MAX_VARIATIONS} are allowed"
            )
        grid_points: list[dict[str, float | str]] = [
            dict(zip(self.grids, values, strict=True))
            for values in itertools.product(*self.grids.values())
        ]
        if not self.random:
            return grid_points

        # A Latin hypercube covers the range of each parameter even with few samples.
        from scipy.stats import qmc

        sampler = qmc.LatinHypercube(len(self.random), seed=np.random.default_rng(self.seed))
        probabilities = sampler.random(self.samples)  # shape (samples, parameters)
        if self.correlation:
            correlated = [[*self.random].index(name) for name in self.correlation.parameters]
            matrix = self.correlation.of_scores(self.random)
            probabilities[:, correlated] = reordered(probabilities[:, correlated], matrix)
        values_by_parameter = [
            distribution.at(probabilities[:, i]).tolist()
            for i, distribution in enumerate(self.random.values())
        ]
        for name, values in zip(self.random, values_by_parameter, strict=True):
            for value in values:
                check_value(name, value)
        texts_by_parameter = [
            [f"{value!r} {item.unit}" if item.unit else value for value in values]
            for item, values in zip(self.random.values(), values_by_parameter, strict=True)
        ]
        # One dictionary per sample, from the name of a random parameter to its value
        samples = [
            dict(zip(self.random, values, strict=True))
            for values in zip(*texts_by_parameter, strict=True)
        ]
        return [point | sample for point in grid_points for sample in samples]

    def units_of(self, models: Sequence[Model]) -> dict[str, tuple[str, float]]:
        """Return the unit of each key with numbers without a unit, and its factor to SI units: that
        of the models. Factors and ratios are omitted.

        Raises
        ------
        UsageError
            The models have different units.
        """
        bare = [name for name, values in self.grids.items() if not all(map(_is_text, values))]
        bare += [name for name, distribution in self.random.items() if not distribution.unit]
        units: dict[str, tuple[str, float]] = {}
        for name in bare if models else ():
            found = dict.fromkeys(model.unit_of(name) for model in models)
            if len(found) > 1:
                texts = " and ".join(unit for unit, _ in found)
                raise UsageError(
                    f"{name}: the models have different units ({texts}); write each number with "
                    f"its unit, such as '100 {next(iter(found))[0]}'"
                )
            (unit,) = found
            if unit[0]:
                units[name] = unit
        return units

    def foreign_units(self, models: Sequence[Model]) -> dict[str, str]:
        """Return the unit of each key with numbers that are not in SI units."""
        return {name: unit for name, (unit, factor) in self.units_of(models).items() if factor != 1}

    @property
    def values_text(self) -> dict[str, str]:
        """Values, or distribution, of each parameter as text."""
        texts = {name: ", ".join(map(_value_text, values)) for name, values in self.grids.items()}
        for name, item in self.random.items():
            first, second = DISTRIBUTIONS[item.name]
            texts[name] = f"{item.name}, {first} {item.first:g}, {second} {item.second:g}"
            texts[name] += f" {item.unit}" * bool(item.unit)
        return texts

    def vary_models(self, models: Sequence[Model]) -> tuple[Model, ...]:
        """Return all variations of all models: all variations of the first model, then all
        variations of the second model, and so on.

        A variation is a combination of parameter values, method and time step. If the sweep has no
        list of methods (or time steps), each model keeps its method (or time step).

        Raises
        ------
        UsageError
            A varied parameter does not exist, or a value is out of range.
        """
        variations = list(
            itertools.product(
                enumerate(self.changes(), start=1), self.methods or (None,), self.steps or (None,)
            )
        )
        varied_models = []
        self.units_of(models)  # the numbers have one unit
        for model in models:
            for (number, change), method, dt in variations:
                numbers = {name: model.file_value(name, value) for name, value in change.items()}
                analysis = replace(
                    model.analysis,
                    method=method or model.analysis.method,
                    dt=dt or model.analysis.dt,
                )
                label = self._label(change, number, method, dt)
                varied_models.append(
                    replace(model.changed(numbers), analysis=analysis, label=label)
                )
        return tuple(varied_models)

    def vary_inventory(self, rows: InventoryRows) -> InventoryRows:
        """Return an inventory with all variations of its buildings.

        A variation changes the parameters of a building, but not its identifier. The random factors
        of stiffness and damping and the random ground motions of a grid are derived from the
        identifier, so that they are equal for all variations of a building.

        Raises
        ------
        UsageError
            A sampled value is out of range or has a unit; there are too many variations.
        """
        changes: list[tuple[tuple[tuple[str, float], ...], str]] = []
        for number, change in enumerate(self.changes(), start=1):
            for name, value in change.items():
                if isinstance(value, str):
                    raise UsageError(
                        f"{name}: buildings of an inventory are in SI units; give numbers without "
                        f"units, got {value!r}"
                    )
            numbers = tuple((name, float(value)) for name, value in change.items())
            changes.append((numbers, self._label(change, number, method=None, dt=None)))
        return replace(rows, changes=changes)

    def _label(
        self, change: Mapping[str, float | str], number: int, method: str | None, dt: float | None
    ) -> str:
        """Return the label of a variation in tables, such as `damping=0.05, draw 3, dt=0.01`. It
        contains the number of the sample (`draw 3`) instead of all sampled values; `number` counts
        the variations from 1.
        """
        texts = [
            f"{name}={_value_text(value)}" for name, value in change.items() if name in self.grids
        ]
        # The samples are the inner loop of `changes`, so the remainder is the index of the sample.
        if self.random:
            texts.append(f"draw {(number - 1) % self.samples + 1}")
        if method:
            texts.append(method)
        if dt:
            texts.append(f"dt={dt:g}")
        return ", ".join(texts)


def _is_text(value: float | str) -> bool:
    """Return True if a value of a parameter is a text with a unit."""
    return isinstance(value, str)


def _value_text(value: float | str) -> str:
    """Return a value of a parameter as text."""
    return value if isinstance(value, str) else f"{value:.{_LABEL_DIGITS}g}"


_NUMBER = fields.Bounds(ratio=True)

_WITH_UNIT = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*([A-Za-z].*)", re.IGNORECASE)
"""Pattern of a number with a unit."""


class _Measured(NamedTuple):
    """Number of a campaign file and its unit, which is empty if the file does not state it."""

    number: float
    unit: str


def _measured(text: str) -> _Measured:
    """Return the number and the unit of a text; raise UsageError for other texts."""
    if not math.isnan(plain := number_or_nan(text)):
        return _Measured(plain, "")
    if match := _WITH_UNIT.fullmatch(text.strip()):
        return _Measured(float(match[1]), match[2])
    with suppress(UsageError):
        return _Measured(parse_ratio(text), "")
    raise UsageError(f"must be a number, got {text!r:.60}")


_SAMPLES = keys("samples", samples=fields.Integer(1, 100_000), seed=fields.Integer(0, 2**31 - 1))
_CORRELATION = fields.Keys(
    keys(
        "correlation",
        parameters=fields.EntriesOf(
            fields.TextLine(),
            least=2,
            description="a list of at least two random parameters",
            distinct="different parameters",
        ),
        matrix=fields.EntriesOf(
            fields.EntriesOf(fields.Bounds(-1.0, 1.0)), description="a list of rows"
        ),
        of=fields.Choice((RANKS, VALUES)),
    ),
    description="a mapping with the keys parameters and matrix",
)
_SAMPLING = (*_SAMPLES, fields.Key("correlation", _CORRELATION, "correlation of random parameters"))
_VALUES_TEXT = "a list of values, or a distribution such as {lognormal: {median: 1, beta: 0.2}}"


def _distribution(value: fields.Value, name: str, **numbers: _Measured) -> Distribution | None:
    """Return the distribution that a key of the campaign file defines; None if its parameters are
    invalid. In this case an error is recorded in the document.

    `**numbers` contains the two parameters by name, in the order of `DISTRIBUTIONS`.
    """
    first, second = numbers.values()
    # The beta of a lognormal distribution is a ratio; other parameters have a common unit.
    if second.unit != ("" if name == "lognormal" else first.unit):
        value.fault(
            f"{name}: {' and '.join(numbers)} must have the same unit"
            if name != "lognormal"
            else "lognormal: beta has no unit"
        )
        return None
    try:
        return Distribution(name, first.number, second.number, first.unit)
    except UsageError as error:
        value.fault(str(error))
        return None


_RANDOM = fields.Keys(
    tuple(
        fields.Key(
            name,
            fields.Keys(
                tuple(
                    fields.Key(name, fields.TextLine(_measured, "a number"), needed=True)
                    for name in parameters
                ),
                make=partial(_distribution, name=name),
            ),
        )
        for name, parameters in DISTRIBUTIONS.items()
    ),
    # A mapping may contain keys of a single alternative group only. Each distribution is a separate
    # group, so that a mapping with two distributions is an error.
    alternative_groups=tuple((name,) for name in DISTRIBUTIONS),
    description=_VALUES_TEXT,
    # `distributions` contains the specified distribution, and None for all other types.
    make=lambda _, **distributions: next(filter(None, distributions.values())),
)


@dataclass(frozen=True)
class Varied:
    """Type of the key `vary` of a campaign file: parameters with their values or distributions,
    number of samples and seed."""

    def schema(self) -> fields.Schema:
        """Return the JSON schema of the key `vary`. Parameters of stories have the same names as in
        `Model.replace`, for example `story 2.mass` or `stories.stiffness`."""
        number = {"type": ["number", "string"]}  # a text has a unit or is a percentage
        values = {"type": "array", "items": number, "minItems": 1}
        # The mapping of a distribution has exactly one key, its name.
        distribution = _RANDOM.schema() | {"minProperties": 1, "maxProperties": 1}
        values_or_distribution = {"anyOf": [values, distribution]}
        parameters = {
            name: {"description": meaning, **values_or_distribution}
            for name, meaning in PARAMETERS.items()
        }
        sampling = fields.Keys(_SAMPLING).schema()["properties"]
        # Names of story parameters: `stories.KEY`, `stories[NUMBER].KEY` or `story NUMBER.KEY`
        story_parameters = {r"^(stories(\[[0-9]+\])?|story [0-9]+)\..+$": values_or_distribution}
        return {
            "type": "object",
            "properties": parameters | sampling,
            "patternProperties": story_parameters,
            "additionalProperties": False,
        }


def read_sweep(
    vary: fields.Value | None,
    methods: fields.Value | None,
    steps: fields.Value | None,
    *,
    models: bool,
) -> ParameterSweep | None:
    """Return the sweep of a campaign; None if the file requests no variations. Errors are recorded
    in the document that contains the values.

    Parameters
    ----------
    models : bool
        True if the buildings are model files, False if they are from an inventory. Methods and time
        steps can be varied only for model files.
    """
    for value in (methods, steps):
        if value and not models:
            value.fault(
                "lists of methods and time steps require `models`; use a single value with an "
                "inventory"
            )
            return None
    if not (vary or methods or steps):
        return None
    parameters_sweep = _read_vary(vary) if vary else None
    integrators = methods.read() if methods else None
    time_steps = steps.read() if steps else None
    # `fromkeys` removes duplicates.
    return replace(
        parameters_sweep or ParameterSweep(),
        location=vary.location if vary else None,
        methods=tuple(dict.fromkeys(integrator.label for integrator in integrators or ())),
        steps=tuple(dict.fromkeys(time_steps or ())),
    )


def _read_vary(value: fields.Value) -> ParameterSweep | None:
    """Read the key `vary` of a campaign file: values and distributions of parameters, number of
    samples, and random seed. Errors are recorded in the document; None is the result if the value
    is not a mapping with valid keys.
    """
    grids: dict[str, tuple[float | str, ...]] = {}
    random: dict[str, Distribution] = {}
    names = value.names
    # The allowed names of parameters depend on the stories of the models. Therefore all names are
    # accepted here and checked with the models.
    sampling = fields.Keys(_SAMPLING)
    parameters = [name for name in names if name not in sampling]
    section = value.section(
        fields.Keys((*_SAMPLING, *(fields.Key(name, fields.ANY) for name in parameters)))
    )
    if section is None:
        return None
    for name in parameters:
        entry = section.get(name)
        if entry is None:
            continue
        # Check the form of the name; the models are not read yet.
        try:
            check_parameter(name)
        except UsageError as error:
            entry.fault(str(error))
            continue
        if entry.is_mapping:
            if distribution := entry._replace(type=_RANDOM).read():
                random[name] = distribution
        else:
            grids[name] = _values(entry, name)
    # Random parameters require a number of samples, which has no effect without random parameters.
    samples = section.get("samples")
    if random and not samples:
        value.fault("random parameters require `samples`; add the number of samples")
    if samples and not random:
        samples.fault("can only be used with a random parameter; remove it")
    correlation = section.get("correlation")
    if correlation:
        checked = replace(_CORRELATION, make=partial(_correlation, random=random))
        correlation = correlation._replace(type=checked)
    return ParameterSweep(
        grids,
        random,
        section.read("samples") or 0,
        section.read("seed") or 0,
        correlation=correlation.read() if correlation else None,
    )


def _correlation(
    value: fields.Value, random: Mapping[str, Distribution], **entries: Any
) -> Correlation | None:
    """Return the correlation that a key of the campaign file defines, for random parameters with
    known distributions; None if it is invalid. In this case an error is recorded in the document.
    """
    try:
        correlation = Correlation(entries["parameters"], entries["matrix"], entries["of"] or RANKS)
        correlation.of_scores(random)
    except UsageError as error:
        value.fault(str(error))
        return None
    return correlation


def _values(entry: fields.Value, name: str) -> tuple[float | str, ...]:
    """Return the values that a list (`entry`) specifies for the parameter `name`: numbers, or texts
    with units. Duplicate values
    are ignored, because they would repeat the same building. Invalid values are recorded as errors
    of the campaign file."""
    # A dictionary has no duplicate keys and keeps their order.
    numbers: dict[float | str, None] = {}
    for item in entry.items(_VALUES_TEXT, f"is empty; give {_VALUES_TEXT}") or ():
        if math.isnan(number_or_nan(item.word)) and _WITH_UNIT.fullmatch(item.word):
            numbers[item.word] = None
            continue
        # A damping ratio may be in percent. An invalid number is NaN, with its error recorded.
        number = item.number(_NUMBER if name == "damping" else fields.ANY)
        try:
            if not math.isnan(number):
                check_value(name, number)
                numbers[number] = None
        except UsageError as error:
            item.fault(str(error))
    return tuple(numbers)


# ---- Definition


@dataclass(frozen=True)
class InventoryFile:
    """Buildings of an inventory, derived by rules.

    Attributes
    ----------
    file : str
        CSV file, or exposure model of OpenQuake.
    length : float
        Length unit of the file, m.
    classes : str | None
        CSV file of the classes, for rules that require it.
    as_published : bool
        For the rules of capacity curves: multiply forces and stiffness by the factor that the
        published program applies.
    mass_only : bool
        Omit the stiffness-proportional damping.
    stiffness_scatter, damping_scatter : float
        Standard deviations of random factors of stiffness and damping ratio.
    """

    file: str
    rules: str
    length: float
    mass_only: bool = False
    stiffness_scatter: float = 0.0
    damping_scatter: float = 0.0
    seed: int = 0
    classes: str | None = None
    as_published: bool = False
    mapping: str | None = None

    @property
    def files(self) -> tuple[str, ...]:
        """Files of the inventory."""
        return tuple(filter(None, (self.file, self.classes, self.mapping)))


@dataclass(frozen=True)
class SequenceFile:
    """Sequences of events in a CSV file.

    Attributes
    ----------
    rest : float | None
        Time between events, s; None: until free vibration has decayed.
    """

    file: str
    choice: RecordChoice
    rest: float | None


@dataclass(frozen=True)
class LoadFiles:
    """Load cases in files.

    Attributes
    ----------
    files : tuple of str
        CSV files, one per load case.
    columns : tuple of (int, str)
        Floor and column of each force. The floor 0 is the roof of each building; an empty column is
        the only column of forces.
    scale, start : float
        Factor on the values, and time that is added to the times (s).
    """

    files: tuple[str, ...]
    columns: tuple[tuple[int, str], ...]
    scale: float = 1.0
    start: float = 0.0


@dataclass(frozen=True)
class AnalysisOverrides:
    """Settings for all buildings. None: each building has the setting of its model.

    Attributes
    ----------
    collapse_drift : float | None
        Drift ratio above which a run counts as collapsed.
    """

    method: str | None = None
    collapse_drift: float | None = None
    p_delta: bool | None = None


NO_RECORDS = RecordFiles((), RecordChoice())
UNSCALED = Scales((1.0,))


@dataclass(frozen=True)
class CampaignFile:
    """Checked campaign file.

    Attributes
    ----------
    name, source : str
        Name of the campaign (by default the name of the file), and path of the file.
    buildings : tuple of str or InventoryFile
        Paths of model files, relative to the working directory, or an inventory.
    intensity : Levels
        Factors or levels; a table of factors of `tdint scale` is not read yet.
    damage : DamageRequest | None
        Definition of the damage states; None: as in the models.
    outputs : tuple of str | None
        Tables to write; None: all tables.
    style : str
        Style of the figures, as in the file. Runs do not depend on the style.
    pair_demand : str | None
        Rule that combines the components of pairs (`tdint.response.pairs`); None: the
        default. Runs do not depend on the rule.
    """

    name: str
    source: str
    buildings: tuple[str, ...] | InventoryFile = ()
    records: RecordFiles | SequenceFile | GridFile | FieldFile | LoadFiles = NO_RECORDS
    intensity: Levels = UNSCALED
    analysis: AnalysisOverrides = AnalysisOverrides()
    settings: CampaignSettings = field(default_factory=CampaignSettings)
    sweep: ParameterSweep | None = None
    damage: DamageRequest | None = None
    outputs: tuple[str, ...] | None = None
    style: str = ""
    pair_demand: str | None = None
