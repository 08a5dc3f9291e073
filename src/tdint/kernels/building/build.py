"""A process that compiles one kernel: `python -P -m tdint.kernels.building.build MODULE:KERNEL [FILE]`.

Its objects, for the targets that TDINT_KERNELS_TARGETS names, go to standard output, each as
`tdint.kernels.building.loading` packs it, behind a line that tells how many bytes follow. FILE is that of a module that
cannot be found by its name. The process ends when its standard input does, so that none is left behind.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import sys
import threading
from dataclasses import replace
from typing import Any


def main() -> None:
    """Compile the kernel named on the command line."""
    # numba looks for SciPy's linear algebra, which kernels have no use for.
    sys.modules["scipy.linalg"] = None  # type: ignore[assignment]
    name, *file = sys.argv[1:]
    module_name, _, attribute = name.partition(":")
    variant = os.environ["TDINT_KERNELS_VARIANT"]
    _add_laws(variant)
    module = _module(module_name, file[0]) if file else importlib.import_module(module_name)

    from tdint.kernels.building.compiler import objects_of
    from tdint.kernels.building.loading import pack
    from tdint.kernels.building.store import identity
    from tdint.kernels.building.target import named

    # After the imports: on Windows numpy's would wait for the pipe that the thread reads.
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    kernel = getattr(module, attribute)
    targets = [named(target) for target in os.environ["TDINT_KERNELS_TARGETS"].split(",")]
    codes, symbol = objects_of(kernel.function, kernel.signature, targets)
    for code, target in zip(codes, targets, strict=True):
        about = identity(name, variant, target)
        data = pack(code, {**about, "symbol": symbol})
        sys.stdout.buffer.write(b"%d\n" % len(data) + data)
    sys.stdout.buffer.flush()


def _module(name: str, file: str) -> Any:
    """The module in a file, under the name that it has in the process that wants the kernel."""
    if name not in sys.modules:
        specification = importlib.util.spec_from_file_location(name, file)
        assert specification is not None and specification.loader is not None
        sys.modules[name] = importlib.util.module_from_spec(specification)
        specification.loader.exec_module(sys.modules[name])
    return sys.modules[name]


def _add_laws(variant: str) -> None:
    """Put the laws of plug-ins that a variant names at their numbers, before what goes by the laws is imported."""
    from tdint.kernels.building.sources import OUTSIDE
    from tdint.kernels.building.variant import parse
    from tdint.kernels.laws import LAWS, linear
    from tdint.kernels.laws.law import DriftLaw

    files = json.loads(os.environ.get("TDINT_KERNELS_PLUGINS", "{}"))
    for name, code in parse(variant).outside.items():
        LAWS.extend([replace(linear.LAW, name="")] * (code + 1 - len(LAWS)))
        values = list(vars(_module(*files[name])).values())
        values += [one for value in values if isinstance(value, tuple | list) for one in value]
        OUTSIDE[name] = files[name][0]
        LAWS[code] = next(one for one in values if isinstance(one, DriftLaw) and one.name == name)


def _end_with_the_parent() -> None:
    while os.read(0, 1024):  # not sys.stdin, whose lock a thread must not hold when Python ends
        pass
    os._exit(1)


if __name__ == "__main__":
    main()
