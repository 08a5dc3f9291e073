"""Processes that compile kernels."""

from __future__ import annotations

import ast
import importlib.util
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from threading import Event
from typing import IO, Any, NamedTuple

from tdint.errors import AnalysisError
from tdint.kernels.building.compilable import ANY, Compilable
from tdint.kernels.building.sources import closure, size
from tdint.kernels.building.target import Target, named, native
from tdint.system import processors, unnamed_file

_POSITION = re.compile(r'(?:File "| at )(?:[^"]*[/\\])?([^"/\\]+\.py)(?:", line |\s\()(\d+)')
"""Position in a source file, as in the messages of Python and numba."""

_MISSING = r"name '(\w+)'"
"""Undefined name in a message of Python or numba, as in "name 'x' is not defined"."""


@dataclass(frozen=True)
class Compilation:
    """Compilation of a kernel in a single form, or of a law, for targets with equal optimization by
    numba.

    Attributes
    ----------
    kernel : Compilable
        Kernel or law.
    form : str
        Form of the code, of `tdint.kernels.building.compilable`.
    targets : mapping of str to Target
        Processors and systems by name, one object file for each target.
    """

    kernel: Compilable
    form: str
    targets: Mapping[str, Target]

    @property
    def settings(self) -> dict[str, str]:
        """Environment variables of the process that compiles the kernel.

        A kernel with only one form does not depend on the form.
        """
        # The first target represents all targets. `compilations` combines targets only if they have
        # the same `optimized_for`, or if the kernel is not vectorized, so that the optimization
        # does not depend on the processor.
        cpu, features = next(iter(self.targets.values())).optimized_for
        form = {} if self.form == ANY else {"TDINT_KERNELS_FORM": self.form}
        return form | {
            "TDINT_KERNELS_TARGETS": ",".join(self.targets),
            "NUMBA_CPU_NAME": cpu,
            "NUMBA_CPU_FEATURES": features,
            "NUMBA_LOOP_VECTORIZE": str(int(self.kernel.vectorized)),
        }

    def fits(self, settings: Mapping[str, str]) -> bool:
        """Return True if a process with these environment variables can compile the kernel."""
        return self.settings.items() <= settings.items()

    @property
    def request(self) -> tuple[str, str, str | None]:
        """Request for the process that compiles the kernel.

        The elements are the name of the kernel, its form, and the file of its module if the module
        is not part of tdint, otherwise None.

        Raises
        ------
        AnalysisError
            The kernel is not in a module that another process can load.
        """
        name = self.kernel.module
        file = None if name.startswith("tdint.") else getattr(sys.modules[name], "__file__", None)
        if name == "__main__" or not (file or name.startswith("tdint.")):
            raise AnalysisError(
                f"{self.kernel.name} cannot be compiled, because a kernel must be defined in a "
                "module file that another process can import; move it to a separate file"
            )
        return self.kernel.name, self.form, file

    def reason(self, text: list[str]) -> str:
        """Return the reason why this compilation failed, `FILE:LINE: message`, from the error
        output of the process.

        The message is the first line that is not empty after the last "Failed in nopython" in the
        output of numba, otherwise the last line; empty without output. The external file is the
        file of a plug-in, if the code is not part of tdint. The source files are this file and the
        files of all modules that the object file depends on (`closure`). The position is determined
        as follows:

        1. If the message reports an undefined name, numba gives no position. The position is the
           first line that uses the name, in the external file first.
        2. Otherwise, the lines after the last "Failed in nopython" are searched, then all lines of
           the output, from the last to the first. A position in the external file is preferred.
        3. If no position is found, the position is the external file without a line, unless the
           message contains its name.
        """
        failures = [i for i, line in enumerate(text) if "Failed in nopython" in line]
        lines_after = text[-1:]
        if failures:
            lines_after = [line.strip() for line in text[failures[-1] + 1 :] if line.strip()]
        if not lines_after or not lines_after[0]:
            return ""
        # A line that ends with a colon is continued by the next line.
        message = " ".join(lines_after[: 2 if lines_after[0].endswith(":") else 1])
        external = self.request[2]
        files = [Path(external)] if external else []
        files += [file for file in closure(self.kernel.name).values() if file not in files]
        # Case 1
        if undefined := re.search(_MISSING, message):
            position = next(
                (f"{file}:{line}" for file in files if (line := _line_of(undefined[1], file))), ""
            )
        else:
            # Case 2. If several files have the same name, the first file is used: `reversed` lets
            # the first file overwrite the other files.
            files_by_name = {file.name: file for file in reversed(files)}
            matches = filter(None, map(_POSITION.search, (*lines_after, *text[::-1])))
            positions = [
                (files_by_name[match[1]], match[2])
                for match in matches
                if match[1] in files_by_name
            ]
            # Paths are compared, because the text of a name can differ: `__file__` of a module can
            # contain `/./` or `//`, which a path omits.
            positions.sort(key=lambda item: not external or item[0] != files[0])
            position = next((f"{file}:{line}" for file, line in positions), "")
        # Case 3
        if not position and external and str(files[0]) not in message:
            position = str(files[0])
        return f"{position}: {message}" if position else message


def _line_of(name: str, file: Path) -> int:
    """Return the first line of a source file that reads the variable `name`; 0 if no line reads it,
    or for a file that is not a Python source file.
    """
    if file.suffix != ".py":
        return 0
    names = (node for node in ast.walk(ast.parse(file.read_bytes())) if isinstance(node, ast.Name))
    return min(
        (node.lineno for node in names if node.id == name and isinstance(node.ctx, ast.Load)),
        default=0,
    )


def compilations(requested: Iterable[tuple[Compilable, str, str]]) -> list[Compilation]:
    """Return the compilations of kernels, each in a form and for a named target; targets with equal
    optimization are combined.
    """
    groups: dict[Any, dict[str, Target]] = {}
    for kernel, form, name in requested:
        target = named(name)
        # A vectorized kernel is optimized for the processor of the target. A kernel that is not
        # vectorized has the same code for all processors, so that its targets share the value None.
        # The target of the machine does not share it: its object file is written by the code
        # generator of numba, which generates code for the processor in the settings of the process
        # (NUMBA_CPU_NAME).
        optimization = target.optimized_for if kernel.vectorized or target == native() else None
        groups.setdefault((kernel, form, optimization), {})[name] = target
    return [Compilation(kernel, form, targets) for (kernel, form, _), targets in groups.items()]


def run_all(
    compilations: Sequence[Compilation], processes: int | None = None
) -> Iterator[tuple[Compilation, list[bytes]]]:
    """Run several processes in parallel (default: one for each processor), and yield each
    compilation with its object files (one for each target) when it is completed.

    Each process is controlled by a thread, which takes the next compilation from a common list.

    Raises
    ------
    AnalysisError
        A kernel cannot be compiled.
    """
    if compilations and importlib.util.find_spec("numba") is None:
        names = ", ".join(dict.fromkeys(compilation.kernel.name for compilation in compilations))
        raise AnalysisError(
            f"{names}: compiled time loops are not included in this installation; install numba "
            "to compile them"
        )
    # The longest estimated time is first: a long compilation that starts last would delay the end,
    # while the other processes are idle.
    waiting = sorted(compilations, key=lambda item: size(item.kernel.name), reverse=True)
    work = _Work(waiting, SimpleQueue(), set(), [], Event())
    count = min(processes or processors(), len(waiting))
    with ThreadPoolExecutor(max(count, 1)) as pool:
        try:
            for _ in range(count):
                pool.submit(_compile_waiting, work)
            for _ in compilations:
                completed = work.done.get()
                if isinstance(completed, BaseException):
                    raise completed
                yield completed
        finally:
            work.stopped.set()
            for process in [*work.running]:
                process.kill()


class _Work(NamedTuple):
    """Compilations that several threads share.

    Attributes
    ----------
    done : SimpleQueue
        Completed compilations, each with its object files, or the exception that ended one.
    running : set of Popen
        Processes that have not ended.
    started : list
        Settings of all processes.
    stopped : Event
        Is set when no further process may start.
    """

    waiting: list[Compilation]
    done: SimpleQueue[tuple[Compilation, list[bytes]] | BaseException]
    running: set[subprocess.Popen[bytes]]
    started: list[Mapping[str, str]]
    stopped: Event


def _compile_waiting(work: _Work) -> None:
    """Compile waiting kernels and laws, one process after the other, until none is left.

    Each thread of `run_all` calls this function. An error ends it.
    """
    try:
        while compilation := _next(work):
            with _process(compilation, work) as (process, errors):
                # The process compiles code that kernels share once: it takes all it can compile.
                next_one: Compilation | None = compilation
                while next_one:
                    work.done.put((next_one, _objects(process, errors, next_one)))
                    next_one = _next(work, compilation.settings)
    except BaseException as error:
        work.done.put(error)


def _next(work: _Work, settings: Mapping[str, str] | None = None) -> Compilation | None:
    """Remove and return the first waiting compilation, for a process with the settings if any are
    given; None if there is none, or if no compilation may start.

    Without settings, those that no process can compile are first: two processes with the same
    settings would both compile the code that kernels share.
    """
    waiting = [] if work.stopped.is_set() else [*work.waiting]
    for compilation in sorted(waiting, key=lambda item: any(map(item.fits, work.started))):
        if settings is None or compilation.fits(settings):
            with suppress(ValueError):  # another thread has taken it
                work.waiting.remove(compilation)
                work.started.append(settings or compilation.settings)
                return compilation
    return None


@contextmanager
def _process(
    first: Compilation, work: _Work
) -> Iterator[tuple[subprocess.Popen[bytes], IO[bytes]]]:
    """Yield a process with the settings of a compilation, and the file of its error output. The
    process is killed at the end of the `with` statement.

    Raises
    ------
    OSError
        No process can be started.
    """
    pipe, path = subprocess.PIPE, os.pathsep.join(filter(None, sys.path))
    # The process must never wait for a full pipe, therefore its error output is a file.
    with unnamed_file() as errors:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "tdint.kernels.build"],
            stdin=pipe,
            stdout=pipe,
            stderr=errors,
            env={
                **{**os.environ, **first.settings},
                "PYTHONPATH": path,
                "TDINT_KERNELS": "compile",
                "OPENBLAS_NUM_THREADS": "1",
                "PYTHONHASHSEED": "0",  # equal object code: numba iterates over sets of names
            },
        )
        work.running.add(process)
        try:
            if work.stopped.is_set():  # after `run_all` has killed the running processes
                process.kill()
            yield process, errors
        finally:
            process.kill()
            process.communicate()  # closes the pipes
            work.running.discard(process)


def _objects(
    process: subprocess.Popen[bytes], errors: IO[bytes], compilation: Compilation
) -> list[bytes]:
    """Request a compilation from a process, and return the contents of its object file for each
    target, which the process writes to its standard output.

    Raises
    ------
    AnalysisError
        The kernel cannot be compiled. The process has ended.
    """
    assert process.stdin is not None and process.stdout is not None
    # The standard input remains open, because its end would end the process.
    with suppress(OSError):  # the process has ended, and its output contains the reason
        process.stdin.write(json.dumps(compilation.request).encode() + b"\n")
        process.stdin.flush()
    # An object for each target, or fewer objects after a failure
    packed: list[bytes] = []
    while len(packed) < len(compilation.targets) and (length := process.stdout.readline()):
        data = process.stdout.read(expected_size := int(length))
        # Fewer bytes were written if the process has ended, for example for lack of memory.
        if len(data) < expected_size:
            break
        packed.append(data)
    if len(packed) == len(compilation.targets):
        return packed
    code = process.wait()
    errors.seek(0)
    text = errors.read().decode(errors="replace").strip().splitlines()
    message = compilation.reason(text) or f"exit code {code}"
    output = RuntimeError("\n".join(text))  # shown with --debug
    raise AnalysisError(f"{compilation.kernel.name} cannot be compiled: {message}") from output
