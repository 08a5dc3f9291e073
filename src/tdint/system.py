"""The machine: what operating systems do in different ways, each name that only some of them have,
with what is done without it; and work on its processors, in threads, for compiled loops let Python
go on meanwhile."""

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
"""How far below others, of 19: on a busy machine a tenth of a processor is left for it."""

_MOUNTS = Path("/proc/self/mountinfo")
_REMOTE_DRIVE = 4
"""DRIVE_REMOTE of Windows' GetDriveTypeW."""

_MAY_ASK, _STILL_ACTIVE = 0x1000, 259
"""PROCESS_QUERY_LIMITED_INFORMATION of Windows' OpenProcess, STILL_ACTIVE of its
GetExitCodeProcess."""

START_OF_PROCESSES = "fork" if sys.platform == "linux" and hasattr(os, "fork") else "spawn"
"""Forked processes have all that this one has loaded; where forking is not safe, they load it from
the cache."""


def processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


_FINE = 1e-5
"""The longest tick, s, of a clock that times marches: a hundredth of the shortest ones, which take
a millisecond."""

CLOCKS = {"thread_time": "processor time of the thread", "perf_counter": "wall time"}


@cache
def clock() -> str:
    """The clock that times marches, a key of `CLOCKS` and a function of the module `time`.

    Other work on the machine does not count as processor time. Windows adds it up by ticks of 16
    ms, whatever resolution it tells: where the clock is seen to tick as coarsely, wall time is
    taken.
    """
    ticks = []
    deadline = time.perf_counter() + 0.1  # s; a clock that stands still is none
    for _ in range(3):  # an interrupt may count for one
        begin = time.thread_time()
        while (now := time.thread_time()) == begin:
            if time.perf_counter() > deadline:
                return "perf_counter"
        ticks.append(now - begin)
    return "thread_time" if min(ticks) <= _FINE else "perf_counter"


def seconds() -> float:
    """What `clock` shows, s."""
    return float(getattr(time, clock())())


def load() -> float | None:
    """Processes that ran or waited for a processor in the last minute, on average; None where
    nobody counts them."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None


def processor() -> str:
    """What the system calls this machine's processor."""
    with suppress(OSError):
        for line in (
            Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        ):
            name, _, value = line.partition(":")
            if name.strip() == "model name":
                return " ".join(value.split())
    return platform.processor() or platform.machine() or "a processor that tells no name"


def memory() -> int | None:
    """This machine's memory, bytes; None where it does not tell."""
    if hasattr(os, "sysconf"):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if (kernel := _windows()) is None:
        return None
    import ctypes

    kilobytes = ctypes.c_ulonglong()
    kernel.GetPhysicallyInstalledSystemMemory(ctypes.byref(kilobytes))
    return 1024 * kilobytes.value or None


def do_not_wait(descriptor: int) -> None:
    """Have writing to a pipe that is full fail; on Windows, before Python 3.12, it waits."""
    if hasattr(os, "set_blocking"):
        os.set_blocking(descriptor, False)


def unnamed_file() -> BinaryIO:
    """A file in memory to write and read, which needs no folder; where there is none, what is
    written is lost."""
    if hasattr(os, "memfd_create"):
        return os.fdopen(os.memfd_create("tdint"), "w+b")
    return Path(os.devnull).open("w+b")


# ---- Who owns what is loaded


def is_trusted(file: os.stat_result, also: int) -> bool:
    """Whether a file belongs to the user, to root or to the user `also`, and others cannot write
    it.

    True on Windows, which keeps a user's folders by other means.
    """
    if not hasattr(os, "geteuid"):
        return True
    return file.st_uid in {os.geteuid(), 0, also} and not file.st_mode & 0o022


def _is_own(home: Path, folder: Path) -> bool:
    """Whether nobody else may put anything into a folder or, by renaming it within its home, in its
    place.

    The folder must be this user's and closed to others. Its home may be root's, and open if it is
    sticky, as /tmp. True on Windows.
    """
    if not hasattr(os, "getuid"):
        return True
    try:
        itself, above = folder.lstat(), home.stat()
    except OSError:
        return False
    closed = stat.S_ISDIR(itself.st_mode) and not itself.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    kept = not above.st_mode & stat.S_IWOTH or bool(above.st_mode & stat.S_ISVTX)
    return itself.st_uid == os.getuid() and closed and above.st_uid in (os.getuid(), 0) and kept


# ---- What is kept between runs, in one folder of the user: compiled kernels, reference solutions


def cache_home() -> Path | None:
    """TDINT_CACHE_DIR, else the platform's folder for caches; None for a user without a home."""
    if chosen := os.environ.get("TDINT_CACHE_DIR"):
        return Path(chosen)
    if sys.platform == "linux":  # as platformdirs has it, without its import
        base = Path(os.environ.get("XDG_CACHE_HOME", ""))
        with suppress(RuntimeError):  # nobody's home
            base = base if base.is_absolute() else Path("~/.cache").expanduser()
        home = base / "tdint"
    else:
        import platformdirs

        home = platformdirs.user_cache_path("tdint", appauthor=False)
    return home if home.is_absolute() else None


def cache_subfolder(name: str) -> Path | None:
    """A folder in the cache, made if it is missing and marked as used now; None if it cannot be
    written.

    What is loaded from it is run: a folder that belongs to another user, or that others may write
    to, is not used.
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
    """Remove files or folders beside `keep` by a pattern of their names that were not used for some
    days."""
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
    """The kind of the file system that a folder lies on, or will, as the system calls it; empty
    where it does not tell.

    Windows tells no more than that a drive is on the network: that is `network drive`.
    """
    path = os.path.realpath(folder)
    if kernel := _windows():
        drive = os.path.splitdrive(path)[0]
        return "network drive" if kernel.GetDriveTypeW(drive + "\\") == _REMOTE_DRIVE else ""
    kinds = _kinds_told_by_mount() if sys.platform == "darwin" else _kinds_of_linux()
    inside = [point for point in kinds if path == point or path.startswith(point.rstrip("/") + "/")]
    return kinds[max(inside, key=len)] if inside else ""


def _kinds_of_linux() -> dict[str, str]:
    try:
        lines = _MOUNTS.read_text(encoding="utf-8", errors="surrogateescape").splitlines()
    except OSError:
        return {}
    kinds: dict[str, str] = {}
    for line in lines:
        before, _, after = line.partition(" - ")
        words, kind = before.split(), after.split()
        if len(words) > 4 and kind:
            point = words[4].encode("latin-1", "replace").decode("unicode_escape", "replace")
            kinds[point] = kind[0]
    return kinds


def _kinds_told_by_mount() -> dict[str, str]:
    """Of macOS: lines like `//guest@server/share on /Volumes/share (smbfs, nodev, nosuid)`."""
    import subprocess

    try:
        told = subprocess.run(["/sbin/mount"], capture_output=True, text=True, check=False).stdout
    except OSError:
        return {}
    kinds: dict[str, str] = {}
    for line in told.splitlines():
        where, _, kind = line.rpartition(" (")
        kinds[where.partition(" on ")[2]] = kind.partition(",")[0].rstrip(")")
    return kinds


def _windows() -> Any:
    """The functions of Windows' kernel; None elsewhere."""
    if sys.platform != "win32":
        return None
    import ctypes

    return ctypes.windll.kernel32


# ---- Processes


@cache
def this_host() -> str:
    """This machine since it was started, or the container of it whose processes we can see: its
    name, and a hash."""
    import hashlib
    import platform

    name = platform.node()
    seen = [name]
    with suppress(OSError):
        seen.append(Path("/proc/sys/kernel/random/boot_id").read_text())
        seen.append(str(Path("/proc/self/ns/pid").readlink()))
    plain = re.sub(r"[^A-Za-z0-9_.]", "_", name)[:64]
    return f"{plain}.{hashlib.sha256('|'.join(seen).encode()).hexdigest()[:8]}"


def process_start(process: int) -> int:
    """When a process was started, in ticks of the system; 0 where it does not tell, or there is
    none."""
    try:
        fields = Path(f"/proc/{process}/stat").read_bytes().rpartition(b")")[2].split()
    except OSError:
        return 0
    return 0 if fields[0] in (b"Z", b"X") else int(fields[19])  # the 22nd field of all


def is_running(process: int, start: int) -> bool:
    """Whether a process that was started then is still there; True where the system does not
    tell."""
    if start and (now := process_start(process)):
        return now == start
    if (kernel := _windows()) is None:
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return False
        except (OSError, OverflowError):  # Another user's, of which /proc may tell nothing
            return True
        return not start  # else it would tell its start: it has ended, and nobody has asked how
    import ctypes

    code, handle = ctypes.c_ulong(), kernel.OpenProcess(_MAY_ASK, 0, process)
    kernel.GetExitCodeProcess(handle, ctypes.byref(code))
    kernel.CloseHandle(handle)
    return bool(handle) and code.value == _STILL_ACTIVE


@contextmanager
def held_back(signals: Collection[signal.Signals]) -> Iterator[None]:
    """Let signals wait; where that is not possible they do not."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def let_through(signals: Collection[signal.Signals]) -> None:
    """Take signals again in a process that was started while they were `held_back`."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, signals)


def end_with(parent: int) -> None:
    """Have this process killed when the one that started it ends; Linux does that, elsewhere its
    pipe tells it."""
    if sys.platform == "linux":
        import ctypes

        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_SIGNAL_AT_PARENTS_DEATH, signal.SIGKILL)
        if os.getppid() != parent:  # It ended before that was asked for.
            os._exit(1)


def start_apart(arguments: list[str], folder: Path) -> None:
    """Start a program of low priority in a folder that goes on when this process ends, and says
    nothing.

    Raises OSError where it cannot be started."""
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
    process.returncode = 0  # nobody waits for it


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
    """Bytes of memory that this process may still take, as far as the system tells; inf if it does
    not."""
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
def locked(file: Path | None, waiting: Callable[[], object]) -> Iterator[None]:
    """Hold the lock of a file, which is made; `waiting` is called once if another process has it.

    Nothing is locked where there is no file or it cannot be made.
    """
    try:
        # A named pipe in its place would be waited for.
        stream = file.open("a") if file and (file.is_file() or not file.exists()) else None
    except OSError:
        stream = None
    if stream is None:
        yield
        return
    with stream:
        told = False
        while not lock(stream.fileno()):
            if not told:
                waiting()
                told = True
            time.sleep(0.05)
        yield


Item = TypeVar("Item")
Result = TypeVar("Result")

_AHEAD = 2
"""Items that each thread has, the one that it is at among them: none waits for who writes the
results."""


def on_threads(
    work: Callable[[Item], Result], items: Iterable[Item], jobs: int
) -> Iterator[Result]:
    """What `work` makes of each item, in the order in which they are done; what it raises is raised
    here.

    No more than a few items are under way or waiting to be taken.
    """
    from concurrent import futures  # not for who asks for their number

    waiting = iter(items)
    running: set[futures.Future[Result]] = set()
    pool = futures.ThreadPoolExecutor(jobs)
    try:
        while True:
            while len(running) < _AHEAD * jobs and (item := next(waiting, None)) is not None:
                running.add(pool.submit(copy_context().run, work, item))  # what it reads is noted
            if not running:
                return
            finished, running = futures.wait(running, return_when=futures.FIRST_COMPLETED)
            for future in finished:
                yield future.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


# ---- The version of tdint: for people, for packages, and for files that say what wrote them

__version__ = "0.2.0"


@cache
def version_of_sources() -> tuple[str, str]:
    """The version, with the sources' hash behind it unless they are those that the installed
    package came with (`0.2.0+sources.1a2b3c4d`), and that hash, 16 hexadecimal digits.

    Nothing tells a checkout that was changed from one that was not: none calls itself a release.
    """
    from base64 import urlsafe_b64encode
    from hashlib import sha256
    from importlib.metadata import PackageNotFoundError, distribution

    folder = Path(__file__).parent
    digests = {
        file.relative_to(folder).as_posix(): sha256(file.read_bytes())
        for file in folder.rglob("*.py")
    }
    of_all = sha256(
        "".join(f"{name} {digests[name].hexdigest()}\n" for name in sorted(digests)).encode()
    ).hexdigest()
    try:
        files = distribution("tdint").files or ()
    except PackageNotFoundError:  # Imported from a folder, not installed.
        files = ()
    packed = {file.as_posix(): file.hash.value for file in files if file.hash}
    released = all(
        packed.get(f"{folder.name}/{name}")
        == urlsafe_b64encode(digest.digest()).rstrip(b"=").decode()
        for name, digest in digests.items()
    )
    return (__version__ if released else f"{__version__}+sources.{of_all[:8]}"), of_all[:16]
