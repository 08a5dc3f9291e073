"""Code blocks of the site with short lines, so that they fit on a page without scrolling.

Comments behind a command, key or statement move to lines above it, long commands continue on the
next line after a backslash, and flow mappings of YAML are broken after a comma. Commands and YAML
keep their meaning. Printed output and Python statements are not changed; `site.css` wraps them.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Iterator

WIDTH = 85
"""Longest line of code in characters: fits next to the table of contents at 1600 px."""

_FENCED = re.compile(r"^(````?)(\w*)\n(.*?)^(````?)$", re.DOTALL | re.MULTILINE)
_INDENTED = re.compile(r"(?<=\n\n)    tdint .*(?=\n)")
_COMMENT = re.compile(r"^(.*?\S)\s+# (.*)$")


def narrow_blocks(text: str) -> str:
    """Return Markdown with short lines in code blocks."""

    def narrowed(match: re.Match[str]) -> str:
        fence, language, code, _ = match.groups()
        by_line = _BY_LANGUAGE.get(language)
        if by_line is None:
            return match[0]
        lines = [part for line in code.splitlines() for part in by_line(line)]
        return f"{fence}{language}\n" + "".join(f"{line}\n" for line in lines) + fence

    text = _INDENTED.sub(lambda match: "\n".join(_indented_command(match[0])), text)
    return _FENCED.sub(narrowed, text)


def _shell(line: str) -> Iterator[str]:
    """Yield the lines of a line of a script."""
    if len(line) <= WIDTH:
        yield line
        return
    code, comment = _split_comment(line)
    yield from _comment_lines(comment, "")
    yield from _continued(code, "    ")


def _session(line: str) -> Iterator[str]:
    """Yield the lines of a line of a session; only commands are broken, output is not."""
    if line.startswith("$ ") and len(line) > WIDTH:
        yield from _shell(line)
    else:
        yield line


def _indented_command(line: str) -> Iterator[str]:
    """Yield the lines of a command in an indented block."""
    for part in _continued(line.strip(), "    ", WIDTH - 4):
        yield f"    {part}"


def _continued(command: str, indent: str, width: int = WIDTH) -> Iterator[str]:
    """Yield a command on several lines, broken before a pipe, an option or (last) an argument."""
    while len(command) > width:
        quoted = re.sub(r"'[^']*'|\"[^\"]*\"", lambda match: "x" * len(match[0]), command)
        ends = [match.start() for match in re.finditer(r" (?=\S)", quoted[: width - 1])]
        ends = [end for end in ends if command[:end].strip() not in ("", "$")]
        best = [end for end in ends if re.match(r" (\||&&|-)", quoted[end:])] or ends
        if not best:
            break
        yield f"{command[: best[-1]]} \\"
        command = indent + command[best[-1] + 1 :]
    yield command


def _yaml(line: str) -> Iterator[str]:
    """Yield the lines of a line of YAML; quoted texts are not broken."""
    if len(line) <= WIDTH:
        yield line
        return
    indent = " " * (len(line) - len(line.lstrip()))
    if line.lstrip().startswith("#"):
        yield from _comment_lines(line.lstrip(" #"), indent)
        return
    code, comment = _split_comment(line)
    yield from _comment_lines(comment, indent)
    while len(code) > WIDTH:
        hidden = re.sub(r"'[^']*'|\"[^\"]*\"", lambda match: "x" * len(match[0]), code)
        ends = [
            match.end()
            for match in re.finditer(r",(?= )", hidden[:WIDTH])
            if re.search(r"[\[{]", hidden[: match.start()]) or _closes_more(hidden)
        ]
        if not ends:
            break
        yield code[: ends[-1]]
        code = f"{indent}    {code[ends[-1] :].lstrip()}"
    yield code


def _closes_more(text: str) -> bool:
    """Return True if a line continues a flow mapping: it closes more brackets than it opens."""
    return sum(map(text.count, "]}")) > sum(map(text.count, "[{"))


def _python(line: str) -> Iterator[str]:
    """Yield a statement below its comment; directives for doctest are omitted."""
    line = re.sub(r"\s*# doctest: .*", "", line)
    prompt = (re.match(r"(>>>|\.\.\.) ", line) or [""])[0]
    code, comment = _split_comment(line) if len(line) > WIDTH else (line, "")
    if comment:
        body = code.removeprefix(prompt)
        yield from _comment_lines(comment, prompt + " " * (len(body) - len(body.lstrip())))
    yield code


def _bibtex(line: str) -> Iterator[str]:
    """Yield the lines of a BibTeX field; spaces and line ends mean the same."""
    yield from textwrap.wrap(
        line, WIDTH, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False
    ) or [""]


def _split_comment(line: str) -> tuple[str, str]:
    """Return the code and the comment of a line; `#` within quotation marks is code."""
    hidden = re.sub(r"'[^']*'|\"[^\"]*\"", lambda match: "x" * len(match[0]), line)
    match = _COMMENT.match(hidden)
    return (line[: match.end(1)], line[match.start(2) :]) if match else (line, "")


def _comment_lines(comment: str, indent: str) -> Iterator[str]:
    """Yield a comment in lines that are short enough."""
    yield from textwrap.wrap(
        comment, WIDTH, initial_indent=f"{indent}# ", subsequent_indent=f"{indent}# "
    )


_BY_LANGUAGE: dict[str, Callable[[str], Iterator[str]]] = {
    "sh": _shell,
    "": _session,
    "console": _session,
    "yaml": _yaml,
    "python": _python,
    "pycon": _python,
    "bibtex": _bibtex,
}
