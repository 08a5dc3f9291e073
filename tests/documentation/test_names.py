"""Names in backquotes exist: in docstrings and comments of the package, and on pages."""

import json
import re
import tokenize
from functools import cache

import click
import pytest
from click.testing import CliRunner

import readmes
from tdint_cli.main import COMMANDS, cli

NAME = re.compile(r"(?<!`)`(_?[A-Za-z][\w.]*?)(?:\(\))?`(?!`)")
"""A name that looks like a name of Python: an identifier, or identifiers joined by dots."""

ELSEWHERE = {
    "GAL": "StationXML", "device_drift": "key of histories", "t_ms": "column of a user",
    "AccSignal": "eqsig", "RSN1_MINE_090.AT2": "file of a user", "_c": "suffix of names",
    "_kipin": "suffix of columns", "asset_hazard_distance": "OpenQuake",
    "calc_spec_accels": "pyrotd", "cluster.scheduler_address": "Dask",
    "cryptography": "Dask", "district": "column of a user", "diff_step": "SciPy",
    "distributed.comm.tls": "Dask", "drift_mm": "column of a user",
    "fragilityFunction": "OpenQuake", "hc": "Hazus", "hn1.json": "file of a user",
    "i_motion": "i is a number", "i_outcome": "i is a number",
    "k_T": "equations of the paper", "kip_in": "refused by units.py",
    "kipin": "unit of kip in, suffix of columns", "lbs": "refused by units.py",
    "leapfrog": "plug-in of a user", "moat_wall": "element of a user",
    "roof_kN": "column of a user", "story_1_moat_wall": "column of a user",
    "ton": "refused by units.py", "leapfrog.py": "plug-in of a user",
    "verlet.py": "plug-in of a user", "bracketed.py": "plug-in of a user",
    "hyperbolic.py": "plug-in of a user", "nohup": "shell",
    "numpy.lib.format.open_memmap": "NumPy", "numpy.savetxt": "NumPy",
    "openquake.hazardlib.imt": "OpenQuake", "psa_g": "column of a user",
    "rax": "register of a processor",
    "sd_cm": "column of a user", "session.run": "nox", "shear_kN": "column of a user",
    "trio": "class of a page", "Hysteretic": "OpenSees", "Pinching4": "OpenSees",
    "stronger": "variant of configs/retrofit",
    "stiffer": "variant of configs/retrofit", "Steel02": "OpenSees",
    "text.usetex": "matplotlib", "_figures": "suffix of modules", "p50": "percentile in a table",
}  # fmt: skip
"""Names of other programs and of users, by the place in which they exist."""

MADE_UP = re.compile(
    r"_m_s2?$|_period_s$|^_(?:MN|lbf|tf|tonf|kgf)$|_error$|_J$|_Nm?$|_m$|_g$|_independent$|_correlated$|^gmv_|FACTOR|KEY|^CI\.|^NZ\.|^HNE$|^hne$"
    r"|^OUT\.|^TDINT_|^DASK_|^tls_|^matplotlibrc$|\.csv$|\.$"
)
"""Columns, codes and variables whose names are composed, and placeholders in capital letters."""


@cache
def package():
    """Return the docstrings and comments of the package by file, and all words of its other tokens
    without blanks and of the names of its modules."""
    texts, words = {}, {"py", "AT2"}
    for folder in ("src", "cli"):
        for path in sorted((readmes.ROOT / folder).rglob("*.py")):
            name = path.relative_to(readmes.ROOT)
            words.update(name.with_suffix("").parts)
            texts[str(name)], begins_line = [], True
            with path.open(encoding="utf-8") as lines:
                for token in tokenize.generate_tokens(lines.readline):
                    is_docstring = token.type == tokenize.STRING and begins_line
                    if token.type == tokenize.COMMENT or is_docstring:
                        texts[str(name)].append(token.string)
                    elif " " not in token.string:
                        words.update(re.findall(r"\w+", token.string))
                    if token.type not in (tokenize.COMMENT, tokenize.NL):
                        ends = (tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT)
                        begins_line = token.type in ends
    return texts, words


def unknown(text, words):
    """Return the names in backquotes of which a part is none of `words`."""
    return {
        name
        for name in NAME.findall(text)
        if name not in ELSEWHERE
        and not MADE_UP.search(name)
        and not words.issuperset(name.split("."))
    }


@pytest.mark.long
def test_names_in_docstrings_and_comments_exist():
    texts, words = package()
    found = {path: unknown("\n".join(parts), words) for path, parts in texts.items()}
    assert {path: names for path, names in found.items() if names} == {}


@pytest.mark.long
def test_names_on_pages_exist():
    """Pages may also name tests and programs of the other directories of the project."""
    words = package()[1] | {"pyproject", "toml"}
    for folder in ("tests", "records", ".github"):
        for path in (readmes.ROOT / folder).rglob("*.py"):
            words.update(path.relative_to(readmes.ROOT).with_suffix("").parts)
            words.update(re.findall(r"\w+", path.read_text(encoding="utf-8")))
    missing = {}
    for path in readmes.files():
        text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.S | re.M)
        if path.name != "COLUMNS.md" and (names := unknown(text, words)):
            missing[str(path.relative_to(readmes.ROOT))] = names
    assert missing == {}


def keys(schema):
    """Yield the keys of all mappings of a JSON schema."""
    if isinstance(schema, dict):
        yield from schema.get("properties", {})
    parts = schema.values() if isinstance(schema, dict) else schema
    for part in parts if isinstance(schema, dict | list) else ():
        yield from keys(part)


@pytest.mark.long
def test_keys_of_models_and_options_are_on_pages():
    """Each key of a model file is on the pages of models or of damage states; each option of a
    command is on some page."""
    texts = {path: path.read_text(encoding="utf-8") for path in readmes.files()}
    described = "\n".join(
        text for path, text in texts.items() if path.parent.name in ("configs", "studies")
    )
    schema = json.loads(CliRunner().invoke(cli, ["check", "--schema", "model"]).output)
    found = set(re.findall(r"[\w-]+", described))
    assert len(set(keys(schema))) > 150
    assert set(keys(schema)) - found <= {"peak_absolute_acceleration"}  # another name of a limit
    named = set(re.findall(r"--[a-z][\w-]*", "\n".join(texts.values())))
    missing = {
        (command, option.opts[0])
        for command in COMMANDS
        for option in cli.get_command(click.Context(cli), command).params
        if isinstance(option, click.Option) and not option.hidden
        and named.isdisjoint([*option.opts, *option.secondary_opts])
    }  # fmt: skip
    assert missing == set()


def test_unknown_name_is_found():
    text = "the function `locate_reversals`, `np.no_such` and `turns_of_a_story()`"
    found = unknown(text, {"locate_reversals", "np"})
    assert found == {"np.no_such", "turns_of_a_story"}
