"""Count the lines of code of a source file, without docstrings, comments and blank lines."""

import ast
from functools import cache
from pathlib import Path


def code_lines(nodes):
    """Return the line numbers that contain code.

    Parameters
    ----------
    nodes : iterable of ast.AST
        All nodes of the syntax tree of one file, as from `ast.walk`.
    """
    nodes = list(nodes)
    docstrings = {
        id(node.body[0].value)
        for node in nodes
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and ast.get_docstring(node, clean=False)
    }
    return {
        line
        for node in nodes
        if isinstance(node, ast.stmt)
        and not (isinstance(node, ast.Expr) and id(node.value) in docstrings)
        for line in range(
            node.lineno, (node.body[0].lineno if hasattr(node, "body") else node.end_lineno + 1)
        )
    }


@cache
def count_code_lines(path):
    """Return the number of code lines of a file."""
    return len(code_lines(ast.walk(ast.parse(Path(path).read_bytes()))))
