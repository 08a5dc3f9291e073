"""Pages of the site that are assembled from sections of the READMEs.

`site.yml` lists these pages under `pages`: title, purpose and sections. A section is moved to its
page with all its subsections, so each text has one source in the repository and a single place on
the site. The sections of README.md are copied: they remain on the first page. Links between
sections are resolved here, since a section may be on a different page than its README.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

FIRST_PAGE = "README.md"
FENCE = re.compile(r"(^````?.*?^````?$)", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\]\((?!\w+:)([^)\s#]*)(#[^)\s]*)?\)")
_HEADING = re.compile(r"^(#+) (.*)$", re.MULTILINE)


class Section(NamedTuple):
    """A heading and the text up to the next heading."""

    level: int
    anchor: str
    text: str


def anchor_of(title: str) -> str:
    """Return the anchor that the generator gives to a heading, as GitHub does."""
    title = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title)
    kept = re.sub(r"[^\w\s-]", "", title).strip().lower()
    return re.sub(r"[-\s]+", "-", kept)


def split_sections(text: str) -> list[Section]:
    """Split Markdown at its headings; the first section starts with the title of the page."""
    hidden = FENCE.sub(lambda match: re.sub(r"(?m)^#", "\0", match[0]), text)
    starts = [match.start() for match in _HEADING.finditer(hidden)]
    sections = []
    for start, end in zip(starts, [*starts[1:], len(hidden)], strict=True):
        part = hidden[start:end].replace("\0", "#")
        heading = _HEADING.match(part)
        assert heading is not None
        sections.append(Section(len(heading[1]), anchor_of(heading[2]), part))
    return sections


def assemble(
    texts: Mapping[str, str],
    layout: Mapping[str, Mapping[str, Any]],
    file_target: Callable[[str], str],
) -> dict[str, str]:
    """Return the pages of all READMEs and of all assembled pages, with resolved links.

    Parameters
    ----------
    texts : mapping
        Markdown of the READMEs by their paths in the repository.
    layout : mapping
        Assembled pages by their paths: `title`, `purpose` and `sections`, a list of
        `README#anchor`.
    file_target : callable
        Function that returns the page for a path of the repository that is not a README.
    """
    sections = {name: split_sections(text) for name, text in texts.items()}
    homes = _homes(sections, layout)
    pages: dict[str, list[tuple[str, Section]]] = {}
    for page, entry in layout.items():
        title = f"# {entry['title']}\n\n{entry['purpose'].strip()}\n\n"
        pages[page] = [("", Section(1, anchor_of(entry["title"]), title))]
        for reference in entry["sections"]:
            shown = {(name, section.anchor) for name, section in pages[page]}
            pages[page] += [
                (name, section)
                for name, section in _promoted(reference, sections, homes, page)
                if (name, section.anchor) not in shown
            ]
    for name, found in sections.items():
        kept = [one for one in found if homes[name, one.anchor] == name]
        if name not in layout and (len(kept) > 1 or len(found) == 1):
            pages[name] = [(name, one) for one in kept]

    def target(path: str, anchor: str) -> str:
        if path not in texts:
            path = file_target(path)
        if path not in texts:
            return path + (f"#{anchor}" if anchor else "")
        page = homes.get((path, anchor), "") if anchor else path
        if page and page in pages:
            return page + (f"#{anchor}" if anchor else "")
        moved = [home for (name, _), home in homes.items() if name == path and home in pages]
        if anchor or not moved:
            raise ValueError(f"{path}#{anchor}: no such section")
        return moved[0]

    return {
        page: "".join(_resolved(part.text, name, page, target) for name, part in parts)
        for page, parts in pages.items()
    }


def _homes(
    sections: Mapping[str, list[Section]], layout: Mapping[str, Mapping[str, Any]]
) -> dict[tuple[str, str], str]:
    """Return the page of each section, by README and anchor; subsections follow their section."""
    listed = {
        tuple(reference.split("#", 1)): page
        for page, entry in layout.items()
        for reference in entry["sections"]
        if not reference.startswith(f"{FIRST_PAGE}#")
    }
    homes: dict[tuple[str, str], str] = {}
    for name, found in sections.items():
        pages_above = {0: name}
        for section in found:
            above = pages_above[max(level for level in pages_above if level < section.level)]
            home = listed.pop((name, section.anchor), above)
            pages_above = {
                level: page for level, page in pages_above.items() if level < section.level
            }
            pages_above[section.level] = home
            homes[name, section.anchor] = home
    if listed:
        raise ValueError(f"site.yml lists sections that do not exist: {sorted(listed)}")
    return homes


def _promoted(
    reference: str,
    sections: Mapping[str, list[Section]],
    homes: Mapping[tuple[str, str], str],
    page: str,
) -> list[tuple[str, Section]]:
    """Return a section and its subsections with the section's heading at level 2.

    Parameters
    ----------
    reference : str
        README and anchor of the section, `cli/README.md#options`.
    sections : mapping
        Sections of each README.
    homes : mapping
        Page of each section, by README and anchor.
    page : str
        Page that is assembled; it omits subsections that are listed for other pages.
    """
    name, anchor = reference.split("#", 1)
    found = sections[name]
    start = next(place for place, one in enumerate(found) if one.anchor == anchor)
    shift = found[start].level - 2
    kept = []
    for section in found[start:]:
        if kept and section.level <= found[start].level:
            break
        if name == FIRST_PAGE or homes[name, section.anchor] == page:
            text = section.text[shift:] if shift > 0 else section.text
            kept.append((name, section._replace(text=text)))
    return kept


def _resolved(text: str, name: str, page: str, target: Callable[[str, str], str]) -> str:
    """Return Markdown with links that are relative to its page.

    Parameters
    ----------
    text : str
        Markdown of a section.
    name : str
        README of the section: its links are relative to this file. Empty for text of site.yml,
        where links are relative to the root of the repository.
    page : str
        Page of the site that contains the section.
    target : callable
        Function of path and anchor that returns the page and anchor of the site.
    """

    def turned(match: re.Match[str]) -> str:
        path, anchor = match[1], (match[2] or "#")[1:]
        path = posixpath.normpath(posixpath.join(posixpath.dirname(name), path)) if path else name
        goal, _, anchor = target(path, anchor).partition("#")
        relative = posixpath.relpath(goal, posixpath.dirname(page) or ".") if goal != page else ""
        return f"]({relative}{'#' + anchor if anchor else ''})"

    parts = FENCE.split(text)
    parts[::2] = [_LINK.sub(turned, part) for part in parts[::2]]
    return "".join(parts)
