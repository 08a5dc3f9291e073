"""Metadata of a release: python .github/release.py [TAG DATE]

Without arguments, copy the metadata to every file that needs it, and list the data that the owner
of the project must still provide:

- CITATION.cff and pyproject.toml to codemeta.json, and to README.md as BibTeX
- addresses (pyproject.toml, [tool.tdint]) to CITATION.cff and the conda recipe
- the contact (pyproject.toml, [tool.tdint]) to SECURITY.md and CODE_OF_CONDUCT.md

With a tag and the date of its commit (2026-12-31), list everything that prevents a release, and end
with exit code 1 if the list is not empty.
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[1]
CODEMETA = ROOT / ".github" / "codemeta.json"
README = ROOT / "README.md"
TELLING = ("SECURITY.md", "CODE_OF_CONDUCT.md")
"""Files of .github that contain the contact."""

DATA_LICENSE = "https://creativecommons.org/licenses/by/3.0/nz/"
"""License of the recordings in records/kaikoura; it has no SPDX identifier."""

_CONTACT = re.compile(r"(?<=<!-- contact -->).*?(?=<!-- end -->)", re.DOTALL)
_BIBTEX = re.compile(r"(?<=```bibtex\n).*?(?=```)", re.DOTALL)


def read() -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the contents of CITATION.cff and pyproject.toml."""
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    return citation, tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def _agent(author: dict[str, str]) -> dict[str, str]:
    """Return an author of CITATION.cff, a person or an organization, in the terms of CodeMeta."""
    if "name" in author:
        return {"type": "Organization", "name": author["name"]}
    terms = {
        "given-names": "givenName",
        "family-names": "familyName",
        "email": "email",
        "affiliation": "affiliation",
    }
    identity = {"id": author["orcid"]} if "orcid" in author else {}
    return (
        {"type": "Person"}
        | identity
        | {term: author[key] for key, term in terms.items() if key in author}
    )


def _bibtex_name(author: dict[str, str]) -> str:
    """Return an author in the form of BibTeX: `von Last, Jr., First`, or {organization}."""
    if "name" in author:
        return f"{{{author['name']}}}"
    family = " ".join(filter(None, (author.get("name-particle"), author.get("family-names"))))
    return ", ".join(filter(None, (family, author.get("name-suffix"), author.get("given-names"))))


def contact(project: dict[str, Any]) -> str:
    """Return the contact, or the form of the repository for private reports."""
    addresses = project["tool"]["tdint"]
    if addresses["contact"]:
        return str(addresses["contact"])
    if addresses["repository"]:
        return f"{addresses['repository'].rstrip('/')}/security/advisories/new"
    return "the contact in `pyproject.toml`, `[tool.tdint] contact`"


def codemeta(citation: dict[str, Any], project: dict[str, Any]) -> str:
    """Return the metadata of the software in the terms of CodeMeta 3."""
    metadata = project["project"]
    values = {
        "@context": "https://w3id.org/codemeta/3.0",
        "type": "SoftwareSourceCode",
        "name": "tdint",
        "description": metadata["description"],
        "version": citation["version"],
        "datePublished": str(citation.get("date-released", "")),
        "author": [_agent(author) for author in citation["authors"]],
        "license": [f"https://spdx.org/licenses/{citation['license']}", DATA_LICENSE],
        "keywords": citation["keywords"],
        "codeRepository": project["tool"]["tdint"]["repository"],
        "softwareHelp": project["tool"]["tdint"].get("site", ""),
        "developmentStatus": "active",
        "programmingLanguage": "Python",
        "runtimePlatform": f"Python {metadata['requires-python']}",
        "softwareRequirements": metadata["dependencies"],
    }
    return json.dumps({name: value for name, value in values.items() if value}, indent=2) + "\n"


def bibtex(citation: dict[str, Any], project: dict[str, Any]) -> str:
    """Return the BibTeX entry of the software (`@software`, for biblatex and newer styles)."""
    fields = {
        "author": " and ".join(map(_bibtex_name, citation["authors"])),
        "title": f"{{{citation['title']}}}",
        "version": citation["version"],
        "year": str(citation.get("date-released", ""))[:4],
        "url": project["tool"]["tdint"]["repository"],
        "license": citation["license"],
    }
    lines = [f"  {name:7} = {{{value}}}," for name, value in fields.items() if value]
    return "\n".join(["@software{tdint,", *lines, "}"]) + "\n"


def with_addresses(text: str, project: dict[str, Any]) -> str:
    """Return CITATION.cff with the addresses of the repository and the site, if they are set."""
    addresses = project["tool"]["tdint"]
    text = re.sub(r"^(?:repository-code|url): .*\n", "", text, flags=re.MULTILINE)
    lines = {"repository-code": addresses["repository"], "url": addresses.get("site", "")}
    added = "".join(f'{name}: "{value}"\n' for name, value in lines.items() if value)
    return re.sub(r"^(license: .*\n)", rf"\g<1>{added}", text, count=1, flags=re.MULTILINE)


def with_home(recipe: str, project: dict[str, Any]) -> str:
    """Return the conda recipe with the addresses of the repository and the site, if they are set.

    Without the address of the repository, `home` is OWNER, which conda refuses.
    """
    addresses = project["tool"]["tdint"]
    site = addresses.get("site", "")
    recipe = re.sub(r"^  doc_url: .*\n", "", recipe, flags=re.MULTILINE)
    lines = f"  home: {addresses['repository'] or 'OWNER'}\n" + (
        f"  doc_url: {site}\n" * bool(site)
    )
    return re.sub(r"^  home: .*\n", lambda _: lines, recipe, flags=re.MULTILINE)


def _contradictions(tag: str, day: str, citation: dict[str, Any], source: Path) -> list[str]:
    """Return the versions and dates that differ.

    Parameters
    ----------
    tag : str
        Tag of the release, v1.2.3.
    day : str
        Date of the tagged commit, 2026-12-31.
    citation : dict
        Contents of CITATION.cff.
    source : Path
        File that contains the version of the package.
    """
    version = re.search(r'__version__ = "(.+)"', source.read_text(encoding="utf-8"))
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    heading = re.search(r"^## (\S+) \((.+)\)$", changelog, re.MULTILINE)
    versions = {
        "the tag": tag.removeprefix("v"),
        "src/tdint/system.py": version and version[1],
        "CITATION.cff": citation["version"],
        "CHANGELOG.md": heading and heading[1],
    }
    days = {
        "the tagged commit": day,
        "CITATION.cff (date-released)": str(citation.get("date-released")),
        "CHANGELOG.md": heading and heading[2],
    }
    return [
        f"different values of the {name}: "
        + ", ".join(f"{value} in {file}" for file, value in values.items())
        for name, values in (("version", versions), ("date", days))
        if len(set(values.values())) > 1
    ]


def faults(tag: str, day: str) -> list[str]:
    """Return everything that prevents the release of a tag with a commit of date `day`."""
    citation, project = read()
    source = ROOT / project["tool"]["hatch"]["version"]["path"]
    messages = _contradictions(tag, day, citation, source)
    messages += [
        f"pyproject.toml: [tool.tdint] {name} is empty"
        for name, value in project["tool"]["tdint"].items()
        if not value and name != "site"
    ]
    if not {"family-names", "name"} & citation["authors"][0].keys():
        messages.append("CITATION.cff: the first author has neither family-names nor name")
    again = "run python .github/release.py"
    for file in TELLING:
        found = _CONTACT.search((CODEMETA.parent / file).read_text(encoding="utf-8"))
        if found is None or found[0] != contact(project):
            messages.append(f".github/{file} does not state the contact: {again}")
    if CODEMETA.read_text(encoding="utf-8") != codemeta(citation, project):
        messages.append(f".github/codemeta.json does not match CITATION.cff: {again}")
    if bibtex(citation, project) not in README.read_text(encoding="utf-8"):
        messages.append(f"README.md: the BibTeX entry does not match CITATION.cff: {again}")
    for file, changed in (
        (ROOT / "CITATION.cff", with_addresses),
        (CODEMETA.parent / "conda" / "meta.yaml", with_home),
    ):
        text = file.read_text(encoding="utf-8")
        if text != changed(text, project):
            messages.append(f"{file.name}: its addresses differ from [tool.tdint]: {again}")
    return messages


def owners() -> list[str]:
    """Return what only the owner of the project can provide; a release needs the first entries."""
    citation, project = read()
    addresses = project["tool"]["tdint"]
    recipe = (ROOT / ".github" / "conda" / "meta.yaml").read_text(encoding="utf-8")
    has_date = "date-released" in citation
    missing = {
        "address of the repository: pyproject.toml, [tool.tdint] repository": not addresses[
            "repository"
        ],
        "address of the site, if it is published: pyproject.toml, [tool.tdint] site": not addresses[
            "site"
        ],
        "e-mail: pyproject.toml, [tool.tdint] contact": not addresses["contact"],
        "persons: CITATION.cff, authors with family-names and given-names": all(
            "name" in author for author in citation["authors"]
        ),
        "date of the release: CITATION.cff, date-released, and CHANGELOG.md": not has_date,
        f"tag v{citation['version']} on a commit of main of that date": not has_date,
        "authors and DOI of the paper of 2022: CITATION.cff, preferred-citation": (
            "preferred-citation" not in citation
        ),
        "DOI of the archive, after it was created: CITATION.cff, doi": "doi" not in citation,
        "maintainers of the conda recipe: .github/conda/meta.yaml, recipe-maintainers": (
            "recipe-maintainers: [OWNER]" in recipe
        ),
        "on the package index: an account, and release.yml as trusted publisher": True,
        "on the repository: GitHub Pages by site.yml, the environment `pypi`": True,
        "before the tag: tests of real records, TDINT_RECORDS=FOLDER python -m pytest": True,
    }
    return [entry for entry, is_missing in missing.items() if is_missing]


def write() -> None:
    """Copy the metadata of CITATION.cff and pyproject.toml to all other files."""
    citation, project = read()
    CODEMETA.write_text(codemeta(citation, project), encoding="utf-8")
    changes = {
        README: lambda text: _BIBTEX.sub(lambda _: bibtex(citation, project), text),
        ROOT / "CITATION.cff": lambda text: with_addresses(text, project),
        CODEMETA.parent / "conda" / "meta.yaml": lambda text: with_home(text, project),
    }
    for file in TELLING:
        changes[CODEMETA.parent / file] = lambda text: _CONTACT.sub(
            lambda _: contact(project), text
        )
    for file, changed in changes.items():
        file.write_text(changed(file.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    messages = []
    if sys.argv[1:]:
        messages = faults(*sys.argv[1:])
        print("\n".join(messages) or "ready")  # noqa: T201 (the output of this program)
    else:
        write()
    print("The owner must provide:", *owners(), sep="\n  ")  # noqa: T201
    sys.exit(bool(messages))
