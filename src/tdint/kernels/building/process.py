"""Processes that compile."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from tdint.errors import AnalysisError
from tdint.kernels.building.sources import OUTSIDE, size
from tdint.kernels.building.target import Target, named, native
from tdint.kernels.building.variant import Variant
from tdint.system import processors

if TYPE_CHECKING:
    from tdint.kernels.building.compilable import Compilable

_PLACE = re.compile(r'File "(?:[^"]*[/\\])?([^"/\\]+)", line (\d+)')


class Compilation:
    """One kernel in one variant, compiled by a process of its own for targets that numba optimizes alike."""

    def __init__(self, kernel: Compilable, variant: Variant, targets: Mapping[str, Target]) -> None:
        self.kernel = kernel
        self.variant = variant
        self.targets = targets
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = False

    def run(self) -> list[bytes]:
        """The packed object for each target.

        Raises
        ------
        AnalysisError
            No process can be started, or it failed.
        """
        if self._stopped:
            return []
        pipe = subprocess.PIPE
        try:
            self._process = subprocess.Popen(
                self._command(), stdin=pipe, stdout=pipe, stderr=pipe, env=self._environment()
            )
        except OSError as error:
            raise AnalysisError(f"{self.kernel.name} cannot be compiled: no process can be started ({error})") from None
        # `communicate` would close its standard input, which ends it; and a temporary file needs a folder for it.
        with self._process as process, ThreadPoolExecutor(1) as beside:
            assert process.stdout is not None and process.stderr is not None
            words = beside.submit(process.stderr.read)
            packed = list(_packed(process.stdout))
            code = process.wait()
            text = words.result().decode(errors="replace").strip().splitlines()
        if code and not self._stopped:
            raise AnalysisError(f"{self.kernel.name} cannot be compiled: {self._reason(text) or f'exit code {code}'}")
        return packed

    def _reason(self, text: list[str]) -> str:
        """The last line that the process wrote; with plug-ins, what numba says of them and the line it says it of."""
        files = [file for _, file in self._plugins().values()]
        module = sys.modules[self.kernel.function.__module__]
        files += [] if module.__name__.startswith("tdint.") else [str(module.__file__)]
        names = {Path(file).name: file for file in files}
        places = [found for line in text if (found := _PLACE.search(line)) and found[1] in names]
        if not files or not text:
            return text[-1] if text else ""
        after = next((i for i, line in enumerate(text) if "Failed in nopython" in line), len(text) - 2)
        said = next((line.strip() for line in text[after + 1 :] if line.strip()), text[-1])
        place = f"{names[places[-1][1]]}:{places[-1][2]}" if places else files[-1]
        return f"{place}: {said}"

    def _plugins(self) -> dict[str, tuple[str, str]]:
        """Module and file of each law of the variant that is a plug-in's."""
        modules = {law: OUTSIDE[law] for law in self.variant.outside}
        return {law: (name, str(sys.modules[name].__file__)) for law, name in modules.items()}

    def stop(self) -> None:
        """End the process, if it runs."""
        self._stopped = True
        if self._process is not None:
            self._process.kill()

    def _command(self) -> list[str]:
        module = sys.modules[self.kernel.function.__module__]
        if module.__name__ == "__main__" or not getattr(module, "__file__", None):
            raise AnalysisError(f"{self.kernel.name} cannot be compiled: put the kernel into a module of its own")
        command = [sys.executable, "-P", "-m", "tdint.kernels.building.build", self.kernel.name]
        if not module.__name__.startswith("tdint."):
            command.append(str(module.__file__))
        return command

    def _environment(self) -> dict[str, str]:
        cpu, features = next(iter(self.targets.values())).optimized_for
        return {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
            "TDINT_KERNELS": "compile",
            "TDINT_KERNELS_VARIANT": self.variant.text,
            "TDINT_KERNELS_TARGETS": ",".join(self.targets),
            "NUMBA_CPU_NAME": cpu,
            "NUMBA_CPU_FEATURES": features,
            "TDINT_KERNELS_PLUGINS": json.dumps(self._plugins()),
            "NUMBA_LOOP_VECTORIZE": str(int(self.kernel.vectorized)),
            "OPENBLAS_NUM_THREADS": "1",
        }


def compilations(
    missing: Iterable[tuple[Compilable, Variant, str]],
) -> list[Compilation]:
    """What is to be run for kernels and names of targets (`target.named`): those that are optimized alike together."""
    together: dict[Any, dict[str, Target]] = {}
    for kernel, variant, name in missing:
        target = named(name)
        # Without vectors all processors are one to the optimizer, but for this one, which numba compiles for itself.
        alike = target.optimized_for if kernel.vectorized or target == native() else None
        together.setdefault((kernel, variant, alike), {})[name] = target
    return [Compilation(kernel, variant, targets) for (kernel, variant, _), targets in together.items()]


def run_all(compilations: Sequence[Compilation]) -> Iterator[tuple[Compilation, list[bytes]]]:
    """Run as many processes side by side as there are processors, the longest first; each one's objects as it is done.

    Raises
    ------
    AnalysisError
        One cannot be compiled.
    """
    if compilations and importlib.util.find_spec("numba") is None:
        names = ", ".join(dict.fromkeys(one.kernel.name for one in compilations))
        raise AnalysisError(f"{names}: not among the compiled loops that came with tdint; to compile, install numba")
    longest_first = sorted(compilations, key=lambda one: size(one.kernel.name), reverse=True)
    with ThreadPoolExecutor(processors()) as pool:
        try:
            running = {pool.submit(one.run): one for one in longest_first}
            for future in as_completed(running):
                yield running[future], future.result()
        except BaseException:
            for one in compilations:
                one.stop()
            raise


def _packed(stream: IO[bytes]) -> Iterator[bytes]:
    """What `build` writes."""
    while size := stream.readline():
        yield stream.read(int(size))
