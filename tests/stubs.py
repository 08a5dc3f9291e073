"""Write the public names of `tdint` and `tdint.plugin` for type checkers: `__init__.pyi` and
`plugin.pyi`.

    python tests/stubs.py

The names are declared in `tdint.public_names`; tests/test_front_door.py compares the files.
"""

from pathlib import Path

from tdint.public_names import DEFINED_AS, PLUGIN, PUBLIC

FOLDER = Path(__file__).parents[1] / "src" / "tdint"


def stubs():
    """Return the text of each file, by its name."""
    version = {"__version__": "tdint.system"}
    renamed = {name: (PUBLIC[name], defined) for name, defined in DEFINED_AS.items()}
    return {
        "__init__.pyi": _text(version | PUBLIC, renamed),
        "plugin.pyi": _text(PLUGIN, {"rows": ("tdint.kernels", "layout")}),
    }


def _text(homes, renamed):
    """Return the text of a stub.

    `homes` contains the module of each name; `renamed` contains the module and the name in it for
    names that differ. Type checkers treat only `import NAME as NAME` as public.
    """
    imports = [
        f"from {home} import {name} as {name}"
        for name, home in homes.items()
        if name not in renamed
    ]
    imports += [f"from {home} import {defined}" for home, defined in renamed.values()]
    assignments = [f"{name} = {defined}" for name, (_, defined) in renamed.items()]
    head = "# Written by tests/stubs.py from tdint.public_names."
    return "\n".join([head, "", *sorted(imports), "", *assignments]) + "\n"


if __name__ == "__main__":
    for file, text in stubs().items():
        (FOLDER / file).write_text(text, encoding="utf-8")
