"""Generated tables of the pages: units, methods by feature, files by command, columns."""

from tdint import make_record, prepare, units
from tdint.methods.catalogue import catalogue, parse
from tdint.response.runs.compiled_steps import unsupported_reason
from tdint.studies.ida.ida import STORE
from tdint.studies.store.result_store import FILE
from tdint_cli.commands import run_request as run
from tdint_cli.options import spectra
from tdint_cli.studies import campaign_files as campaign
from tdint_cli.studies import compare, ida, match

# ---- Units


def unit_table():
    """Return the table of the units of models and records, from the tables of `tdint.units`."""
    rows = {
        "length": units.LENGTH,
        "force": units.FORCE,
        "mass": units.MASS,
        "acceleration": units.ACCELERATION,
    }
    lines = [f"| {quantity} | {', '.join(f'`{name}`' for name in names)} |" for quantity, names in
        rows.items()]  # fmt: skip
    return "\n".join(["| quantity | units |", "|---|---|", *lines]) + "\n"


# ---- Methods by feature

SINGLE_STEP = "single-step family"
_LAW = {"type": "bilinear", "yield_force": 1e4, "hardening": 0.05}
_BRACED = {"coefficient": 1e3, "brace": 1e6}
_POWER_LAW = {"coefficient": 1e3, "exponent": 0.5, "linear_below": 1e-3}
_TANGENT = {"rayleigh": {"ratio": 0.02, "modes": [1, 2], "tangent": True}}
_DEVICES = {
    "attachments": [{"name": "tank", "floor": "roof", "mass": 40, "stiffness": 500, "dashpot": 8}],
    "links": [{"name": "damper", "from": "ground", "to": 2, "dashpot": 10}],
}


def _chain(damping="5%", **story):
    stories = [{"repeat": 2, "mass": 1e3, "height": 3.0, "stiffness": 1e6, **story}]
    return {"stories": stories, "damping": damping}


def _joint(law, **keys):
    stop = {"type": law, "gap": 0.01, "stop_stiffness": 1e7, **keys}
    return {**_chain("none"), "links": [{"name": "joint", "from": "ground", "to": 2, "law": stop}]}


FEATURES = {
    "laws other than `linear`": [_chain(law=_LAW)],
    "power-law dashpots": [_chain(dashpot=_POWER_LAW)],
    "dashpots with a brace": [_chain(dashpot=_BRACED)],
    "`tangent: true`": [_chain(_TANGENT, law=_LAW)],
    "attachments, links": [{**_chain(), **_DEVICES}],
    "attachments or links, beside a brace or `tangent: true`": [
        {**_chain(dashpot=_BRACED), **_DEVICES},
        {**_chain(_TANGENT, law=_LAW), **_DEVICES},
    ],
    "`gap` with `dashpot` or `restitution`": [
        _joint("gap", dashpot=10.0),
        _joint("gap", restitution=0.6),
    ],
    "`hertz` with `restitution`": [_joint("hertz", restitution=0.6)],
    "inerters, linear": [_chain(inertance=100)],
    "inerters, with other laws or power-law dashpots": [
        _chain(inertance=100, law=_LAW),
        _chain(inertance=100, dashpot=_POWER_LAW),
    ],
    "inerters, beside a brace or `tangent: true`": [
        _chain(inertance=100, dashpot=_BRACED),
        _chain(_TANGENT, inertance=100, law=_LAW),
    ],
    "`stiffness_matrix`, `flexural`, `matrices`": [
        {"stories": [{"mass": 1e3, "height": 3.0}], "stiffness_matrix": [[1e6]], "damping": "5%"},
        {**_chain(), "stories": [{"mass": 1e3, "height": 3.0, "flexural": {"EI": 1e8}}]},
        {"matrices": {"mass": [1e3, 10], "stiffness": [[1e6, -1e4], [-1e4, 1e4]],
            "inertance": [0, 10]}, "damping": {"modal": 0.05}},
    ],
}  # fmt: skip
"""Models with each feature that some method does not support. The models of a feature are supported
by the same methods."""


def supporting_methods(model):
    """Return the names of the methods that support a model."""
    record = make_record([0.0] * 11, dt=0.01, units="m/s^2")
    cases = {name: prepare(model, record, method=name) for name in catalogue()}
    return [
        name for name, case in cases.items() if not unsupported_reason(case.method, case.building)
    ]


def single_step_methods():
    """Return the methods of one step with one set of kernels (Newmark and its relatives)."""
    families = {name: parse(name).family for name in catalogue()}
    return [name for name, family in families.items() if family is families["newmark-average"]]


def _method_names(found, family):
    """Return names of methods as text: all but a few, or with the name of the family."""
    missing = [name for name in catalogue() if name not in found]
    if not found:
        return "none"
    if len(missing) < 8:
        return "all but " + ", ".join(f"`{name}`" for name in missing)
    if len(names := [name for name in family if name in found]) > 8:
        others = [f"`{name}`" for name in found if name not in family]
        absent = [f"`{name}`" for name in family if name not in names]
        exception = f" without {' and '.join(absent)}" if absent else ""
        return ", ".join([*others, f"{SINGLE_STEP}{exception}"])
    return ", ".join(f"`{name}`" for name in found)


def feature_table():
    """Return the table of the methods that support each feature of a building."""
    family = single_step_methods()
    lines = [f"The {SINGLE_STEP} is {', '.join(f'`{name}`' for name in family)}.", ""]
    lines += ["| feature | methods |", "|---|---|"]
    for feature, models in FEATURES.items():
        first, *others = map(supporting_methods, models)
        assert all(found == first for found in others), feature
        lines.append(f"| {feature} | {_method_names(first, family)} |")
    return "\n".join(lines) + "\n"


# ---- Files by command

OUTPUTS = {
    "run": {
        "": (run.STORIES, run.SUMMARY),
        "by the model": (
            *(run.RESULTANTS, run.ELEMENTS, run.ATTACHMENTS, run.LINKS, run.CONTACTS, run.ROWS),
        ),
        "`--history`": (run.HISTORY,),
        "`--plot`": (run.PICTURE,),
        "`--floor-spectra`": (spectra.SPECTRA, spectra.SPECTRA_PICTURE),
        "`--export-floors`": (spectra.MOTIONS,),
    },
    "campaign": {
        "": (campaign.RUNS, campaign.PROFILES, campaign.SUMMARY, FILE),
        "by the models and options": tuple(
            name
            for name in campaign._WRITTEN_FILES
            if name not in (campaign.RUNS, campaign.PROFILES, campaign.SUMMARY)
        ),
    },
    "ida": {
        "": (ida.RUNS, ida.CAPACITIES, ida.FRACTILES, ida.SUMMARY, STORE),
        "`--p695`": (ida.MARGIN,),
    },
    "match": {
        "": (match.MATCHED, match.MATCHED.replace(".csv", ".json")),
        "`--plot`": (match.PICTURE,),
    },
    "compare": {"": (compare.TABLE, compare.SPECTRA, compare.SUMMARY)},
}
"""Files that a command writes to the directory of `-o`, with the condition."""


def output_table():
    """Return the table of the files that commands write to the directory of `-o`."""
    lines = ["| command | files |", "|---|---|"]
    for command, files in OUTPUTS.items():
        parts = [
            (f"{condition}: " if condition else "") + _names(names)
            for condition, names in files.items()
        ]
        lines.append(f"| `{command}` | {'; '.join(parts)} |")
    return "\n".join(lines) + "\n"


# ---- Columns

ERROR = "_error"


def is_estimate(column):
    """Return True for a column with the estimated error of another column."""
    name = column.name.removesuffix(ERROR)
    return column.name != name and column.meaning == f"estimated absolute error of {name}"


def column_pages(groups):
    """Return a section for each group of columns: a list of the columns with a meaning that no
    earlier group has, the names of the others, and the names of columns with estimated errors."""
    sections, first = [], {}
    for title, group in groups.items():
        own, named = [], {}
        for column in group:
            if is_estimate(column):
                continue
            home = first.setdefault((column.name, column.unit, column.meaning), title)
            if home == title:
                own.append(column)
            else:
                named.setdefault(home, []).append(column.name)
        parts = [f"## {title}"]
        if own:
            parts.append("\n".join(map(_entry, own)))
        parts += [f"As in **{home}**: {_names(names)}." for home, names in named.items()]
        if estimates := [one.name.removesuffix(ERROR) for one in group if is_estimate(one)]:
            parts.append(f"Estimated errors of {_names(estimates)}.")
        sections.append("\n\n".join(parts) + "\n")
    return "\n".join(sections)


def _entry(column):
    unit = "" if column.unit in ("1", "text") else f" ({column.unit})"
    return f"- `{column.name}`{unit}: {column.meaning}"


def _names(names):
    return ", ".join(f"`{name}`" for name in names)
