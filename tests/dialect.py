"""Count the markers of the former private dialect in docstrings, comments, messages and pages.

    python tests/dialect.py                rates per 10 000 words, by layer
    python tests/dialect.py --files 20     also the 20 files with the most markers
    python tests/dialect.py --show told    each occurrence of a marker

The total rate has an upper limit (MAX_RATE). The layers have none: a deleted text without markers
raises the rate of its layer. Seven packages of the field (diffrax, scikit-fem, ObsPy, eqsig,
OpenQuake, sqlite-utils, rasterio) have 46 to 112 markers per 10 000 words. Words like "its" and
"one" are English, so zero is not the goal. Text in backticks, code blocks and tables is not
counted. In the layer `tests`, strings are not counted either, because they are inputs and expected
outputs; this layer is not part of `total`.
`dialect_markers.csv` lists each marker with its pattern (case is ignored) and plain replacements;
add new ones when they are discovered.
"""

from __future__ import annotations

import argparse
import ast
import csv
import io
import re
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
MAX_RATE = 46  # markers per 10 000 words of all layers but the tests, measured 2026-11-27
TESTS = "tests"  # layer of the test suite

DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
SECTIONS = "Parameters|Returns|Attributes|Raises|Yields|Notes|Examples|References|See Also"
MARKERS_FILE = Path(__file__).with_name("dialect_markers.csv")

with MARKERS_FILE.open(encoding="utf-8", newline="") as table:
    COMPILED = {row["marker"]: re.compile(row["pattern"], re.I) for row in csv.DictReader(table)}

# One pattern of all markers finds the few texts that contain a marker: at a position that is not a
# word boundary it fails at once. Only these texts are searched for each marker.
_AT_WORDS = [p.pattern for p in COMPILED.values() if p.pattern.startswith(r"\b")]
_ELSEWHERE = [p.pattern for p in COMPILED.values() if not p.pattern.startswith(r"\b")]
ANY_MARKER = (
    re.compile(r"\b(?:" + "|".join(f"(?:{p[2:]})" for p in _AT_WORDS) + ")"),
    *map(re.compile, _ELSEWHERE),
)


def _plain(text: str) -> str:
    """Return the prose of a text: no code, links, doctests, section headings, parameter types."""
    text = re.sub(r"```.*?```|<!--.*?-->", " ", text, flags=re.S)
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", " ", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    kept = []
    for line in text.expandtabs().split("\n"):
        stripped = line.strip()
        is_underline = re.fullmatch(r"([=\-~^#*+.`])\1{2,}", stripped)
        if is_underline or re.match(r">>>|\.\.\. |\.\. |\|", stripped):
            continue
        if re.fullmatch(SECTIONS, stripped) or re.match(r"[\w*, ]+ : ", stripped):
            continue
        kept.append(line)
    return re.sub(r"`+[^`]*`+", "CODE", "\n".join(kept))


def _comments(source: str) -> Iterator[tuple[int, str]]:
    """Yield comments without directives for linters."""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type != tokenize.COMMENT:
            continue
        text = token.string.lstrip("#!: ")
        if not re.match(r"noqa|type:|pragma|fmt:|mypy|ruff|-\*-", text):
            yield token.start[0], text


def _string_value(node: ast.AST) -> str:
    """Return the text of a string, with X for each placeholder; empty for other nodes."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    if isinstance(node, ast.JoinedStr):
        return "".join(
            str(part.value) if isinstance(part, ast.Constant) else "X" for part in node.values
        )
    return ""


def pieces(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the first line and the raw text of each text of a file."""
    source = path.read_text("utf8")
    if path.suffix == ".md":
        yield from _paragraphs(source)
    else:
        yield from _python_texts(source, with_strings=layer_of(path) != TESTS)


def _paragraphs(source: str) -> Iterator[tuple[int, str]]:
    """Yield the paragraphs of a page without code blocks, headings, tables and comments."""
    is_code = False
    paragraph: list[str] = []
    first_line = 1
    for number, line in enumerate([*source.split("\n"), ""], 1):
        is_code ^= line.lstrip().startswith("```")
        is_skipped = is_code or line.lstrip().startswith(("```", "|", "#", "<!--"))
        # A blank line, a list item or skipped text ends the paragraph.
        if is_skipped or not line.strip() or re.match(r"\s*(?:[-*]|\d+\.) ", line):
            if paragraph:
                yield first_line, "\n".join(paragraph)
            paragraph = []
        if not is_skipped and line.strip():
            first_line = first_line if paragraph else number
            paragraph.append(line)


def _python_texts(source: str, with_strings: bool) -> Iterator[tuple[int, str]]:
    """Yield docstrings, strings of at least four words (optional), and comments of Python code."""
    nodes = list(ast.walk(ast.parse(source)))
    skipped = set()  # identities of docstrings and of the parts of f-strings
    for node in nodes:
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node):
            skipped.add(id(node.body[0].value))
            yield node.body[0].lineno, ast.get_docstring(node) or ""
        if isinstance(node, ast.JoinedStr):
            skipped.update(id(part) for part in node.values)
    for node in nodes if with_strings else ():
        text = "" if id(node) in skipped else _string_value(node)
        if " " in text and len(re.findall(r"[A-Za-z]{2,}", text)) >= 4:
            yield node.lineno, text
    yield from _comments(source)


class Marker(NamedTuple):
    """One occurrence of a marker in a text."""

    name: str
    path: str
    line: int
    context: str


class Survey(NamedTuple):
    """Words by layer, and all markers with their layers."""

    words: Counter[str]
    markers: list[tuple[str, Marker]]

    def rates(self) -> dict[str, float]:
        """Return the markers per 10 000 words by layer, and of all layers but the tests as
        `total`."""
        counts = Counter(layer for layer, _ in self.markers)
        rates = {layer: 1e4 * counts[layer] / words for layer, words in self.words.items() if words}
        words = self.words.total() - self.words[TESTS]
        rates["total"] = 1e4 * (counts.total() - counts[TESTS]) / words
        return {layer: round(rate, 1) for layer, rate in sorted(rates.items())}


def layer_of(path: Path) -> str:
    """Return the layer of a file: `src/tdint/PACKAGE`, or the first directory of its path."""
    parts = path.relative_to(ROOT).parts
    if parts[:2] == ("src", "tdint") and len(parts) > 3:
        return "/".join(parts[:3])
    return parts[0] if len(parts) > 1 else "."


def text_files() -> list[Path]:
    """Return the Python files and pages that are surveyed: all but the changelog."""
    roots = [ROOT / name for name in ("src", "cli", "configs", "records", ".github", TESTS)]
    files = [ROOT / "README.md"]
    for root in roots:
        files += [*root.rglob("*.py"), *root.rglob("*.md")]
    return sorted(files)


def survey() -> Survey:
    """Count words and find markers in all surveyed files."""
    words: Counter[str] = Counter()
    markers = []
    for path in text_files():
        layer = layer_of(path)
        for first_line, raw in pieces(path):
            text = _plain(raw)
            words[layer] += len(re.findall(r"[A-Za-z']+", text))
            lower_case = text.lower()
            if not any(pattern.search(lower_case) for pattern in ANY_MARKER):
                continue
            for name, pattern in COMPILED.items():
                for match in pattern.finditer(text):
                    line = first_line + text.count("\n", 0, match.start())
                    context = text.replace("\n", " ")[max(0, match.start() - 40) : match.end() + 40]
                    marker = Marker(name, str(path.relative_to(ROOT)), line, context)
                    markers.append((layer, marker))
    return Survey(words, markers)


def main() -> None:
    """Print the rates, and what the options request."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--files", type=int, default=0)
    parser.add_argument("--show")
    options = parser.parse_args()
    result = survey()
    if options.show:
        for _, marker in result.markers:
            if options.show in marker.name:
                print(f"{marker.path}:{marker.line}: {marker.context}")
        return
    for layer, rate in result.rates().items():
        print(f"{rate:7.1f}  {layer}")
    by_file = Counter(marker.path for _, marker in result.markers)
    for path, count in by_file.most_common(options.files):
        print(f"{count:7d}  {path}")


if __name__ == "__main__":
    main()
