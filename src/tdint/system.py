"""Functions that depend on the operating system, and work on threads.

Functions of the standard library that exist on some systems only are called here, with a fallback
for the other systems. Compiled loops release the global interpreter lock, so threads run in
parallel.
"""

from __future__ import annotations

import math
import os
import platform
import re
import signal
import stat
import sys
import time
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import copy_context
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

_SIGNAL_AT_PARENTS_DEATH = 1
"""PR_SET_PDEATHSIG of Linux's prctl."""

_LOW = 10
"""Niceness (0 to 19). On a busy machine, such a process gets about a tenth of a processor."""

_MOUNTS = Path("/proc/self/mountinfo")
_REMOTE_DRIVE = 4
"""DRIVE_REMOTE of Windows' GetDriveTypeW."""

_QUERY_INFORMATION, _STILL_ACTIVE = 0x1000, 259
"""PROCESS_QUERY_LIMITED_INFORMATION of Windows' OpenProcess, STILL_ACTIVE of its
GetExitCodeProcess."""

START_OF_PROCESSES = "fork" if sys.platform == "linux" and hasattr(os, "fork") else "spawn"
"""Start method of processes. Forked processes inherit loaded kernels; if forking is not safe, they
load the kernels from the cache."""


def processors() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


_FINE = 1e-5
"""Maximum resolution of the clock for time loops, s: a hundredth of the shortest loops, which take
a millisecond."""

CLOCKS = {"thread_time": "processor time of the thread", "perf_counter": "wall time"}


@cache
def clock() -> str:
    """Return the clock for time loops: a key of `CLOCKS` and a function of the module `time`.

    Processor time excludes other work on the machine. Windows counts it in ticks of 16 ms,
    regardless of the resolution that it reports. If the measured resolution is this coarse, wall
    time is used.
    """
    ticks = []
    deadline = time.perf_counter() + 0.1  # s; after this time the clock is considered stopped
    for _ in range(3):  # an interrupt may lengthen one of the ticks
        begin = time.thread_time()
        while (now := time.thread_time()) == begin:
            if time.perf_counter() > deadline:
                return "perf_counter"
        ticks.append(now - begin)
    return "thread_time" if min(ticks) <= _FINE else "perf_counter"


def seconds() -> float:
    """Return the time of `clock`, s."""
    return float(getattr(time, clock())())


def load() -> float | None:
    """Return the average number of running or waiting processes in the last minute, or None."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None


def processor() -> str:
    """Return the name of the processor of this machine."""
    with suppress(OSError):
        for line in (
            Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        ):
            name, _, value = line.partition(":")
            if name.strip() == "model name":
                return " ".join(value.split())
    return platform.processor() or platform.machine() or "unknown processor"


def memory() -> int | None:
    """Return the memory of this machine, bytes; None if it is unknown."""
    if hasattr(os, "sysconf"):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if (kernel := _windows()) is None:
        return None
    import ctypes

    kilobytes = ctypes.c_ulonglong()
    kernel.GetPhysicallyInstalledSystemMemory(ctypes.byref(kilobytes))
    return 1024 * kilobytes.value or None


def set_nonblocking(descriptor: int) -> None:
    """Make writing to a full pipe fail instead of blocking. No effect on Windows before 3.12."""
    if hasattr(os, "set_blocking"):
        os.set_blocking(descriptor, False)


def unnamed_file() -> BinaryIO:
    """Return a file in memory; on systems without such files, the null device."""
    if hasattr(os, "memfd_create"):
        return os.fdopen(os.memfd_create("tdint"), "w+b")
    return Path(os.devnull).open("w+b")


# ---- Ownership of files that are loaded


def is_trusted(file: os.stat_result, also: int) -> bool:
    """Return True if a file belongs to the user, to root or to the user `also`, and is not writable
    for others.

    Always True on Windows, which protects the directories of a user by other means.
    """
    if not hasattr(os, "geteuid"):
        return True
    return file.st_uid in {os.geteuid(), 0, also} and not file.st_mode & 0o022


def _is_own(home: Path, folder: Path) -> bool:
    """Return True if no other user can write to a directory or replace it by renaming.

    The directory must belong to this user and must not be writable for others. Its parent `home`
    may belong to root, and may be writable for others if it has the sticky bit, like /tmp. Always
    True on Windows.
    """
    if not hasattr(os, "getuid"):
        return True
    try:
        own_status, parent_status = folder.lstat(), home.stat()
    except OSError:
        return False
    user = os.getuid()
    others_cannot_write = stat.S_ISDIR(own_status.st_mode) and not own_status.st_mode & (
        stat.S_IWGRP | stat.S_IWOTH
    )
    # In a directory with the sticky bit, users can rename only their own files.
    others_cannot_rename = not parent_status.st_mode & stat.S_IWOTH or bool(
        parent_status.st_mode & stat.S_ISVTX
    )
    return (
        own_status.st_uid == user
        and others_cannot_write
        and parent_status.st_uid in (user, 0)
        and others_cannot_rename
    )


# ---- Cache directory of the user: compiled kernels and reference solutions


def cache_home() -> Path | None:
    """Return TDINT_CACHE_DIR or the cache directory of the platform; None without a home."""
    if chosen := os.environ.get("TDINT_CACHE_DIR"):
        return Path(chosen)
    if sys.platform == "linux":  # the result of platformdirs, without importing it
        base = Path(os.environ.get("XDG_CACHE_HOME", ""))
        with suppress(RuntimeError):  # the user has no home directory
            base = base if base.is_absolute() else Path("~/.cache").expanduser()
        home = base / "tdint"
    else:
        import platformdirs

        home = platformdirs.user_cache_path("tdint", appauthor=False)
    return home if home.is_absolute() else None


def cache_subfolder(name: str) -> Path | None:
    """Return a directory in the cache, created if necessary, or None if it cannot be used.

    Its modification time is set to now. Files in it are executed, so a directory that belongs to
    another user, or to which other users can write, is not used.
    """
    home = cache_home()
    if home is None:
        return None
    folder = home / name
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        os.utime(folder)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK) and _is_own(home, folder) else None


def remove_unused(pattern: str, days: float, *, keep: Path) -> None:
    """Remove files and directories next to `keep` that match a pattern and have not been used for
    `days` days."""
    import shutil

    limit = time.time() - days * 86400.0
    for folder in keep.parent.glob(pattern):
        with suppress(OSError):
            if folder == keep or folder.stat().st_mtime >= limit:
                continue
            if folder.is_dir():
                shutil.rmtree(folder, ignore_errors=True)
            else:
                folder.unlink()


# ---- File systems


def file_system(folder: Path) -> str:
    """Return the type of the file system of a directory, which may not exist yet; empty if unknown.

    Windows only distinguishes network drives: the result is `network drive` for these.
    """
    path = os.path.realpath(folder)
    if kernel := _windows():
        drive = os.path.splitdrive(path)[0]
        return "network drive" if kernel.GetDriveTypeW(drive + "\\") == _REMOTE_DRIVE else ""
    types = _mount_types_macos() if sys.platform == "darwin" else _mount_types_linux()
    containing = [
        point for point in types if path == point or path.startswith(point.rstrip("/") + "/")
    ]
    # Mount points can be nested; the innermost, with the longest name, contains the directory.
    return types[max(containing, key=len)] if containing else ""


def _mount_types_linux() -> dict[str, str]:
    """Return types of file systems by mount point on Linux, from /proc/self/mountinfo.

    Field 5 of a line is the mount point, and the first field after ` - ` is the type. Blanks in
    the name of a mount point are written as octal escapes (`\\040`).
    """
    try:
        lines = _MOUNTS.read_text(encoding="utf-8", errors="surrogateescape").splitlines()
    except OSError:
        return {}
    types: dict[str, str] = {}
    for line in lines:
        mount_part, _, type_part = line.partition(" - ")
        mount_fields, type_fields = mount_part.split(), type_part.split()
        if len(mount_fields) > 4 and type_fields:
            escaped = mount_fields[4].encode("latin-1", "replace")
            types[escaped.decode("unicode_escape", "replace")] = type_fields[0]
    return types


def _mount_types_macos() -> dict[str, str]:
    """Return types of file systems by mount point on macOS.

    The lines of `mount` are like `//guest@server/share on /Volumes/share (smbfs, nodev, nosuid)`.
    """
    import subprocess

    try:
        listing = subprocess.run(
            ["/sbin/mount"], capture_output=True, text=True, check=False
        ).stdout
    except OSError:
        return {}
    types: dict[str, str] = {}
    for line in listing.splitlines():
        device_and_point, _, options = line.rpartition(" (")
        types[device_and_point.partition(" on ")[2]] = options.partition(",")[0].rstrip(")")
    return types


def _windows() -> Any:
    """Return the functions of the kernel of Windows; None on other systems."""
    if sys.platform != "win32":
        return None
    import ctypes

    return ctypes.windll.kernel32


# ---- Processes


@cache
def this_host() -> str:
    """Return an identifier of this machine since its last start, or of its container.

    It consists of the host name and a hash of the boot identifier and the process namespace.
    """
    import hashlib
    import platform

    name = platform.node()
    identifiers = [name]
    with suppress(OSError):  # these files exist on Linux only
        identifiers.append(Path("/proc/sys/kernel/random/boot_id").read_text())
        identifiers.append(str(Path("/proc/self/ns/pid").readlink()))
    file_name = re.sub(r"[^A-Za-z0-9_.]", "_", name)[:64]
    return f"{file_name}.{hashlib.sha256('|'.join(identifiers).encode()).hexdigest()[:8]}"


def process_start(process: int) -> int:
    """Return the start time of a process in ticks of the system; 0 if unknown or not running."""
    try:
        fields = Path(f"/proc/{process}/stat").read_bytes().rpartition(b")")[2].split()
    except OSError:
        return 0
    # The state of a process that has ended is Z (zombie) or X (dead). Field 22 of the line is the
    # start time; `fields` starts with field 3.
    return 0 if fields[0] in (b"Z", b"X") else int(fields[19])


def is_running(process: int, start: int) -> bool:
    """Return True if a process with this start time still runs, or if the system does not report
    it."""
    if start and (now := process_start(process)):
        return now == start
    if (kernel := _windows()) is None:
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return False
        except (OSError, OverflowError):  # a process of another user, which /proc may hide
            return True
        # With a known start time, /proc would report a running process; it is therefore a zombie.
        return not start
    import ctypes

    code, handle = ctypes.c_ulong(), kernel.OpenProcess(_QUERY_INFORMATION, 0, process)
    kernel.GetExitCodeProcess(handle, ctypes.byref(code))
    kernel.CloseHandle(handle)
    return bool(handle) and code.value == _STILL_ACTIVE


@contextmanager
def block_signals(signals: Collection[signal.Signals]) -> Iterator[None]:
    """Block signals during a `with` statement, if the system supports it."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    previous_mask = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous_mask)


def unblock_signals(signals: Collection[signal.Signals]) -> None:
    """Unblock signals in a process that was started while they were blocked (`block_signals`)."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, signals)


def die_with_parent(parent: int) -> None:
    """Request that this process is killed when its parent ends.

    Only Linux supports this; on other systems the process must wait for the end of its parent in a
    thread, or notice a closed pipe.
    """
    if sys.platform == "linux":
        import ctypes

        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_SIGNAL_AT_PARENTS_DEATH, signal.SIGKILL)
        if os.getppid() != parent:  # the parent ended before the request
            os._exit(1)


def spawn_detached(arguments: list[str], folder: Path) -> None:
    """Start a program with low priority that continues when this process ends, without output.

    Parameters
    ----------
    arguments : list of str
        Program and its arguments.
    folder : Path
        Working directory of the program.

    Raises
    ------
    OSError
        The program cannot be started.
    """
    import subprocess

    path = os.pathsep.join(filter(None, sys.path))
    silent: dict[str, Any] = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    if sys.platform == "win32":
        silent["creationflags"] = (
            subprocess.BELOW_NORMAL_PRIORITY_CLASS | subprocess.DETACHED_PROCESS
        )
    process = subprocess.Popen(
        arguments,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
        start_new_session=True,
        **silent,
    )
    with suppress(OSError, AttributeError):
        os.setpriority(os.PRIO_PROCESS, process.pid, _LOW)
    process.returncode = 0  # prevents a warning about a process that is not waited for


# ---- Locks


def lock(descriptor: int) -> bool:
    """Lock an open file for this process, until it is closed; False if another process has it.

    True on a file system without locks.
    """
    try:
        import fcntl
    except ImportError:
        return _lock_on_windows(descriptor)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def _lock_on_windows(descriptor: int) -> bool:
    """Lock an open file on Windows; see `lock`."""
    try:
        import msvcrt
    except ImportError:
        return True
    try:
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
    except OSError:
        return False
    return True


def available_memory() -> float:
    """Return the memory that this process can still allocate, bytes; inf if unknown."""
    limits = []
    with suppress(OSError, ValueError, IndexError), Path("/proc/meminfo").open() as lines:
        limits += [
            1024.0 * float(line.split()[1]) for line in lines if line.startswith("MemAvailable")
        ]
    try:
        import resource
    except ImportError:
        return min(limits, default=math.inf)
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    return min(
        [*limits, *([float(soft)] if soft != resource.RLIM_INFINITY else [])], default=math.inf
    )


@contextmanager
def locked(file: Path | None, on_wait: Callable[[], object]) -> Iterator[None]:
    """Hold the lock of a file, which is created if necessary.

    `on_wait` is called once if another process holds the lock. Without a file, or if the file
    cannot be created, there is no lock.
    """
    try:
        # Opening a named pipe of this name would block.
        stream = file.open("a") if file and (file.is_file() or not file.exists()) else None
    except OSError:
        stream = None
    if stream is None:
        yield
        return
    with stream:
        is_reported = False
        while not lock(stream.fileno()):
            if not is_reported:
                on_wait()
                is_reported = True
            time.sleep(0.05)
        yield


Item = TypeVar("Item")
Result = TypeVar("Result")

_SUBMITTED_PER_THREAD = 2
"""Number of submitted items per thread, including the running item, so that threads do not wait
while results are written."""


def on_threads(
    work: Callable[[Item], Result], items: Iterable[Item], jobs: int
) -> Iterator[Result]:
    """Call a function for each item on threads, and yield the results in order of completion.

    Exceptions of the function are raised here. Only a few items are submitted at a time.

    Parameters
    ----------
    work : callable
        Function of one item.
    items : iterable
        Items.
    jobs : int
        Number of threads.
    """
    from concurrent import (
        futures,
    )  # imported here, because most calls of this module do not need it

    remaining = iter(items)
    running: set[futures.Future[Result]] = set()
    pool = futures.ThreadPoolExecutor(jobs)
    try:
        while True:
            while (
                len(running) < _SUBMITTED_PER_THREAD * jobs
                and (item := next(remaining, None)) is not None
            ):
                # The context records the files that the thread reads.
                running.add(pool.submit(copy_context().run, work, item))
            if not running:
                return
            finished, running = futures.wait(running, return_when=futures.FIRST_COMPLETED)
            for future in finished:
                yield future.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


# ---- Version of tdint, for messages, packages and the JSON files of results

__version__ = "0.2.0"


@cache
def version_of_sources() -> tuple[str, str]:
    """Return the version and the hash of the sources (16 hexadecimal digits).

    The version includes the hash (`0.2.0+sources.1a2b3c4d`) unless the sources are those of the
    installed package. A checkout always includes the hash, because changes cannot be detected.
    """
    from base64 import urlsafe_b64encode
    from hashlib import sha256
    from importlib.metadata import PackageNotFoundError, distribution

    folder = Path(__file__).parent
    digests = {
        file.relative_to(folder).as_posix(): sha256(file.read_bytes())
        for file in folder.rglob("*.py")
    }
    sources_digest = sha256(
        "".join(f"{name} {digests[name].hexdigest()}\n" for name in sorted(digests)).encode()
    ).hexdigest()
    try:
        files = distribution("tdint").files or ()
    except PackageNotFoundError:  # the package is imported from a directory, not installed
        files = ()
    # The sources are those of the package if all digests match the package's list of files, which
    # writes them in Base64 without padding (RECORD file).
    package_digests = {file.as_posix(): file.hash.value for file in files if file.hash}
    is_released = all(
        package_digests.get(f"{folder.name}/{name}")
        == urlsafe_b64encode(digest.digest()).rstrip(b"=").decode()
        for name, digest in digests.items()
    )
    version = __version__ if is_released else f"{__version__}+sources.{sources_digest[:8]}"
    return version, sources_digest[:16]
