"""Public interface for plug-ins: methods, drift laws, reference programs in charts, record formats
and intensity measures.

    from tdint.plugin import STEP, Family, Method, kernel, rows

The docstring of `rows` defines the arguments of the kernels. These names are stable: a name changes
only after a minor release that announces the change. Names of other modules of tdint can change
without notice. Each name is imported when it is first used, so that a law does not load the modules
that methods need.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from tdint.errors import did_you_mean
from tdint.public_names import PLUGIN


def __getattr__(name: str) -> Any:
    """Import a public name at its first use; raise AttributeError for an unknown name."""
    if name == "__all__":  # `help` shows these names
        return __dir__()
    if name not in PLUGIN:
        raise AttributeError(
            f"module 'tdint.plugin' has no attribute {name!r}{did_you_mean(name, PLUGIN)}"
        )
    module = import_module(PLUGIN[name])
    return module if name == "rows" else getattr(module, name)


def __dir__() -> list[str]:
    """Return the sorted public names."""
    return sorted(PLUGIN)
