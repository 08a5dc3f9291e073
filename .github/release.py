"""What a release goes by: python .github/release.py [TAG DATE]

Without arguments it writes what CITATION.cff says into codemeta.json and into README.md as BibTeX,
and whom to write to (pyproject.toml, [tool.tdint]) into SECURITY.md and CODE_OF_CONDUCT.md; then it
lists what the owner has still to give. With a tag and the day of its commit (2026-12-31) it tells
all that stands in the way of a release, and ends with 1 if anything does; what is the owner's and
can wait is listed behind it.
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
_CONTACT = re.compile(r"(?<=<!-- contact -->).*?(?=<!-- end -->)", re.DOTALL)
_BIBTEX = re.compile(r"(?<=```bibtex\n).*?(?=```)", re.DOTALL)


def read() -> tuple[dict[str, Any], dict[str, Any]]:
    """CITATION.cff and pyproject.toml."""
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    return citation, tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def _agent(author: dict[str, str]) -> dict[str, str]:
    """An author of CITATION.cff, a person or an entity, as CodeMeta knows one."""
    if "name" in author:
        return {"type": "Organization", "name": author["name"]}
    told = {
        "given-names": "givenName",
        "family-names": "familyName",
        "email": "email",
        "affiliation": "affiliation",
    }
    identity = {"id": author["orcid"]} if "orcid" in author else {}
    return (
        {"type": "Person"}
        | identity
        | {name: author[key] for key, name in told.items() if key in author}
    )


def _bibtex_name(author: dict[str, str]) -> str:
    """An author of CITATION.cff as BibTeX takes one: `von Last, Jr., First`, an entity in
    braces."""
    if "name" in author:
        return f"{{{author['name']}}}"
    family = " ".join(filter(None, (author.get("name-particle"), author.get("family-names"))))
    return ", ".join(filter(None, (family, author.get("name-suffix"), author.get("given-names"))))


def contact(project: dict[str, Any]) -> str:
    """Whom to write to: an address, or the repository's form for reports that only its maintainers
    read."""
    told = project["tool"]["tdint"]
    if told["contact"]:
        return str(told["contact"])
    if told["repository"]:
        return f"{told['repository'].rstrip('/')}/security/advisories/new"
    return "the contact in `pyproject.toml`, `[tool.tdint] contact`"


def codemeta(citation: dict[str, Any], project: dict[str, Any]) -> str:
    """The metadata of the software in the words of CodeMeta 3."""
    told = project["project"]
    place = project["tool"]["tdint"]["repository"]
    found = {
        "@context": "https://w3id.org/codemeta/3.0",
        "type": "SoftwareSourceCode",
        "name": "tdint",
        "description": told["description"],
        "version": citation["version"],
        "datePublished": str(citation.get("date-released", "")),
        "author": [_agent(author) for author in citation["authors"]],
        "license": f"https://spdx.org/licenses/{citation['license']}",
        "keywords": citation["keywords"],
        "codeRepository": place,
        "developmentStatus": "active",
        "programmingLanguage": "Python",
        "runtimePlatform": f"Python {told['requires-python']}",
        "softwareRequirements": told["dependencies"],
    }
    return json.dumps({name: value for name, value in found.items() if value}, indent=2) + "\n"


def bibtex(citation: dict[str, Any], project: dict[str, Any]) -> str:
    """The entry of BibTeX for the software, as biblatex and BibTeX's newer styles know it."""
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


def faults(tag: str, day: str) -> list[str]:
    """What stands in the way of a release under a tag, of a commit of a day."""
    citation, project = read()
    version = re.search(
        r'__version__ = "(.+)"', (ROOT / project["tool"]["hatch"]["version"]["path"]).read_text()
    )
    heading = re.search(
        r"^## (\S+) \((.+)\)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE
    )
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
    found = []
    for what, said in (("version", versions), ("date", days)):
        if len(set(said.values())) > 1:
            found.append(
                f"one {what}, please: "
                + ", ".join(f"{value} in {place}" for place, value in said.items())
            )
    found += [
        f"pyproject.toml: [tool.tdint] {name} is empty"
        for name, value in project["tool"]["tdint"].items()
        if not value and name != "site"
    ]
    if not {"family-names", "name"} & citation["authors"][0].keys():
        found.append("CITATION.cff: the first author has neither family-names nor name")
    for file in TELLING:
        said = _CONTACT.search((CODEMETA.parent / file).read_text(encoding="utf-8"))
        if said is None or said[0] != contact(project):
            found.append(f".github/{file} does not tell the contact: run python .github/release.py")
    if CODEMETA.read_text(encoding="utf-8") != codemeta(citation, project):
        found.append(
            ".github/codemeta.json is not what CITATION.cff says: run python .github/release.py"
        )
    if bibtex(citation, project) not in README.read_text(encoding="utf-8"):
        found.append(
            "README.md: the BibTeX entry is not what CITATION.cff says: run python "
            ".github/release.py"
        )
    return found


def owners() -> list[str]:
    """What only the owner can give: what a release does not wait for comes last, and what no file
    tells."""
    citation, project = read()
    told = project["tool"]["tdint"]
    recipe = (ROOT / ".github" / "conda" / "meta.yaml").read_text(encoding="utf-8")
    missing = {
        "address of the repository: pyproject.toml, [tool.tdint] repository": not told[
            "repository"
        ],
        "address of the site, if it is published: pyproject.toml, [tool.tdint] site": not told[
            "site"
        ],
        "e-mail: pyproject.toml, [tool.tdint] contact": not told["contact"],
        "persons: CITATION.cff, authors with family-names and given-names": all(
            "name" in a for a in citation["authors"]
        ),
        "date of the release: CITATION.cff, date-released, and CHANGELOG.md": "date-released"
        not in citation,
        "tag v" + citation["version"] + " on the commit of that day": "date-released"
        not in citation,
        "authors and DOI of the paper of 2022: CITATION.cff, preferred-citation": "preferred-citation"  # noqa: E501
        not in citation,
        "DOI of the archive, once there is one: CITATION.cff, doi": "doi" not in citation,
        "maintainers of the conda recipe: .github/conda/meta.yaml, recipe-maintainers": "OWNER"
        in recipe,
        "on the index: an account, and this repository's release.yml as its trusted "
        "publisher": True,
        "on the repository: pages served by site.yml, the environment `pypi`": True,
    }
    return [what for what, wanted in missing.items() if wanted]


if __name__ == "__main__":
    found = []
    if sys.argv[1:]:
        found = faults(*sys.argv[1:])
        print("\n".join(found) or "ready")  # noqa: T201 (it is what the program is for)
    else:
        citation, project = read()
        CODEMETA.write_text(codemeta(citation, project), encoding="utf-8")
        text = README.read_text(encoding="utf-8")
        README.write_text(_BIBTEX.sub(lambda _: bibtex(citation, project), text), encoding="utf-8")
        for file in TELLING:
            text = (CODEMETA.parent / file).read_text(encoding="utf-8")
            (CODEMETA.parent / file).write_text(
                _CONTACT.sub(lambda _: contact(project), text), encoding="utf-8"
            )
    print("The owner's:", *owners(), sep="\n  ")  # noqa: T201
    sys.exit(bool(found))
