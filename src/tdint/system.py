"""Functions that depend on the operating system: clocks, memory, files, processes, locks, threads.

Functions of the standard library that exist on some systems only are called here, with a fallback
for the other systems. Compiled loops release the global interpreter lock, so threads run in
parallel.
"""

from __future__ import annotations

import errno
import math
import os
import platform
import re
import signal
import stat
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import copy_context
from functools import cache
from pathlib import Path
from typing import IO, Any, BinaryIO, TypeVar

_SIGNAL_AT_PARENTS_DEATH = 1
"""Constant PR_SET_PDEATHSIG of the Linux function prctl."""

_LOW_PRIORITY = 10
"""Niceness (0 to 19) of background processes. On a busy machine, a process with this niceness gets
about a tenth of a processor."""

_MOUNTS = Path("/proc/self/mountinfo")
"""Linux file that lists the mounted file systems."""

_REMOTE_DRIVE = 4
"""Constant DRIVE_REMOTE of the Windows function GetDriveTypeW."""

_QUERY_INFORMATION, _STILL_ACTIVE = 0x1000, 259
"""Constant PROCESS_QUERY_LIMITED_INFORMATION of the Windows function OpenProcess, and constant
STILL_ACTIVE of the Windows function GetExitCodeProcess."""

START_OF_PROCESSES = "fork" if sys.platform == "linux" and hasattr(os, "fork") else "spawn"
"""Start method of processes. Forked processes inherit the loaded kernels. On systems where forking
is not safe, processes are spawned and load the kernels from the cache."""


def processors() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


_MAX_TICK = 1e-5
"""Maximum tick of a clock that measures time loops, s: a hundredth of the duration of the shortest
loops, which is a millisecond."""

CLOCKS = {"thread_time": "processor time of the thread", "perf_counter": "wall time"}
"""Clocks for time loops: description by the name of the function of the module `time`."""


@cache
def clock() -> str:
    """Return the name of the clock for time loops, a key of `CLOCKS`.

    Processor time is preferred, because it excludes other work on the machine. Windows counts it in
    ticks of 16 ms, regardless of the resolution that it reports. The tick is therefore measured,
    and wall time is used if the tick exceeds `_MAX_TICK`.
    """
    ticks = []
    deadline = time.perf_counter() + 0.1  # s; after this time the clock is considered stopped
    # Measure three ticks and use the shortest, because an interrupt may lengthen a tick.
    for _ in range(3):
        start = time.thread_time()
        while (now := time.thread_time()) == start:
            if time.perf_counter() > deadline:
                return "perf_counter"
        ticks.append(now - start)
    return "thread_time" if min(ticks) <= _MAX_TICK else "perf_counter"


def seconds() -> float:
    """Return the time of `clock`, s."""
    return float(getattr(time, clock())())


def load() -> float | None:
    """Return the average number of running or waiting processes of the machine in the last minute;
    None if the system does not report it.
    """
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None


def processor() -> str:
    """Return the name of the processor of the machine, such as `AMD EPYC 7763`."""
    with suppress(OSError):  # the file exists on Linux only
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
        for line in text.splitlines():
            name, _, value = line.partition(":")
            if name.strip() == "model name":
                return " ".join(value.split())
    return platform.processor() or platform.machine() or "unknown processor"


def memory() -> int | None:
    """Return the size of the physical memory of the machine, bytes; None if it is unknown."""
    if hasattr(os, "sysconf"):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if (kernel := _windows()) is None:
        return None
    import ctypes

    kilobytes = ctypes.c_ulonglong()
    kernel.GetPhysicallyInstalledSystemMemory(ctypes.byref(kilobytes))
    return 1024 * kilobytes.value or None  # the value remains 0 if the call fails


def set_nonblocking(descriptor: int) -> None:
    """Make writing to a full pipe fail instead of blocking.

    `descriptor` is the file descriptor of the pipe. No effect on Windows before Python 3.12.
    """
    if hasattr(os, "set_blocking"):
        os.set_blocking(descriptor, False)


def unnamed_file() -> IO[bytes]:
    """Open a temporary file without a name: in memory on Linux, elsewhere in the directory of
    temporary files, or the null device without such a directory."""
    if hasattr(os, "memfd_create"):
        return os.fdopen(os.memfd_create("tdint"), "w+b")
    from tempfile import TemporaryFile  # imported late: a hundredth of the time of a run

    try:
        return TemporaryFile()
    except OSError:
        return Path(os.devnull).open("w+b")


# ---- Ownership of files that are loaded


def is_trusted(file: os.stat_result, trusted_user: int) -> bool:
    """Return True if a file has a trusted owner and no other user can write to it.

    Always True on Windows, which protects the directories of a user by other means.

    Parameters
    ----------
    trusted_user : int
        Identifier of a user that is trusted in addition to the current user and root.
    """
    if not hasattr(os, "geteuid"):
        return True
    is_writable_for_others = file.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return file.st_uid in {os.geteuid(), 0, trusted_user} and not is_writable_for_others


def _is_protected(parent: Path, folder: Path) -> bool:
    """Return True if no other user can write to a directory or replace it by renaming.

    The directory must belong to this user and must not be writable for other users. Its parent may
    belong to root, and may be writable for all users if it has the sticky bit, like /tmp. Always
    True on Windows.
    """
    if not hasattr(os, "getuid"):
        return True
    try:
        folder_status, parent_status = folder.lstat(), parent.stat()
    except OSError:
        return False
    user = os.getuid()
    # `lstat` does not follow a symbolic link, so a link is not accepted as a directory.
    is_directory = stat.S_ISDIR(folder_status.st_mode)
    can_others_write = bool(folder_status.st_mode & (stat.S_IWGRP | stat.S_IWOTH))
    # In a directory with the sticky bit, users can rename only their own files.
    has_sticky_bit = bool(parent_status.st_mode & stat.S_ISVTX)
    can_others_rename = bool(parent_status.st_mode & stat.S_IWOTH) and not has_sticky_bit
    return (
        is_directory
        and folder_status.st_uid == user
        and not can_others_write
        and parent_status.st_uid in (user, 0)
        and not can_others_rename
    )


# ---- Cache directory of the user: compiled kernels and reference solutions


def cache_home() -> Path | None:
    """Return the cache directory of tdint: the environment variable TDINT_CACHE_DIR, otherwise the
    directory `tdint` in the cache directory of the user; None if the user has no home directory."""
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
    """Return the directory `name` of the cache, which is created if necessary.

    None is the result if the directory cannot be used. Files in the directory are executed, so it
    must belong to this user, and other users must not be able to write to it. Its modification time
    is set to the current time, so that `remove_unused` keeps it.
    """
    home = cache_home()
    if home is None:
        return None
    folder = home / name
    try:
        _make_private(folder)
        os.utime(folder)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK) and _is_protected(home, folder) else None


def user_key() -> bytes | None:
    """Return the secret of this user, 32 random bytes in the cache, which are created at the first
    call; None if there is no directory to which only this user can write."""
    folder = cache_subfolder("keys")
    if folder is None:
        return None
    file = folder / "journals"
    try:
        if not file.exists():
            part = folder / f".{os.urandom(8).hex()}"
            with os.fdopen(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as new:
                new.write(os.urandom(32))
            part.replace(file)
        return file.read_bytes()
    except OSError:
        return None


def _make_private(folder: Path) -> None:
    """Create a directory and its missing parents for this user only. With a umask of 000, they
    would otherwise be writable for other users, and would be refused at the next call."""
    if not folder.exists():
        _make_private(folder.parent)
        folder.mkdir(exist_ok=True, mode=0o700)


def date() -> str:
    """Return the date of `SOURCE_DATE_EPOCH` (s since 1970, UTC; reproducible-builds.org), or
    today's date, as YYYY-MM-DD."""
    seconds = os.environ.get("SOURCE_DATE_EPOCH", "")
    day = time.gmtime(int(seconds)) if seconds.isdecimal() else time.localtime()
    return time.strftime("%Y-%m-%d", day)


def remove_unused(pattern: str, days: float, *, keep: Path) -> None:
    """Remove files and directories of the cache that have not been used for some time.

    Parameters
    ----------
    pattern : str
        Glob pattern of the names to remove, in the parent directory of `keep`.
    days : float
        Minimum time since the last modification, days.
    """
    import shutil

    oldest_kept = time.time() - days * 86400.0  # a day has 86400 s
    for path in keep.parent.glob(pattern):
        with suppress(OSError):  # another process may remove the same path
            if path == keep or path.stat().st_mtime >= oldest_kept:
                continue
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink()


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
    # Mount points that are the directory or contain it. `rstrip` is for the mount point "/".
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

    `mount` prints lines such as `//guest@server/share on /Volumes/share (smbfs, nodev, nosuid)`.
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
    """Return the library kernel32, which contains the system functions of Windows; None on other
    systems."""
    if sys.platform != "win32":
        return None
    import ctypes

    return ctypes.windll.kernel32


# ---- Processes


@cache
def this_host() -> str:
    """Return an identifier of the machine since its last start, or of its container.

    It consists of the host name and a hash of the boot identifier and the process namespace.
    """
    import hashlib
    import platform

    name = platform.node()
    identifiers = [name]
    with suppress(OSError):  # these files exist on Linux only
        identifiers.append(Path("/proc/sys/kernel/random/boot_id").read_text())
        identifiers.append(str(Path("/proc/self/ns/pid").readlink()))
    # The identifier is part of file names. Therefore special characters are replaced, and the name
    # is limited to 64 characters.
    file_name = re.sub(r"[^A-Za-z0-9_.]", "_", name)[:64]
    return f"{file_name}.{hashlib.sha256('|'.join(identifiers).encode()).hexdigest()[:8]}"


def process_start(process: int) -> int:
    """Return the start time of a process in ticks of the system; 0 if unknown or not running."""
    try:
        fields = Path(f"/proc/{process}/stat").read_bytes().rpartition(b")")[2].split()
    except OSError:
        return 0
    # `fields` starts with field 3 of the line (see proc(5)), the state: Z (zombie) or X (dead) for
    # a process that has ended. The start time is field 22, which has the index 19.
    return 0 if fields[0] in (b"Z", b"X") else int(fields[19])


def is_running(process: int, start: int) -> bool:
    """Return True if a process is running.

    Parameters
    ----------
    start : int
        Start time of the process from `process_start`, which distinguishes it from a later process
        with the same identifier; 0 if unknown. If the system does not report whether the process is
        running, the result is True.
    """
    if start and (present_start := process_start(process)):
        return present_start == start
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


@contextmanager
def hold_signals() -> Iterator[None]:
    """Handle a signal that ends the process after a `with` statement, in the main thread only.

    A blocked signal would be handled if another thread received it.
    """
    received: list[int] = []
    handlers: dict[signal.Signals, Any] = {}
    if threading.current_thread() is threading.main_thread():
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            number = getattr(signal, name, None)
            if number and signal.getsignal(number) not in (None, signal.SIG_IGN):
                handlers[number] = signal.signal(number, lambda number, _: received.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for received_number in received[:1]:
            signal.raise_signal(received_number)


def unblock_signals(signals: Collection[signal.Signals]) -> None:
    """Unblock signals in a process that was started while they were blocked (`block_signals`)."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, signals)


def die_with_parent(parent: int) -> None:
    """Request that this process is killed when its parent process ends. `parent` is the identifier
    of the parent process.

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

    Raises
    ------
    OSError
        The program cannot be started.
    """
    import subprocess

    # The program must be able to import the same modules as this process.
    path = os.pathsep.join(filter(None, sys.path))
    options: dict[str, Any] = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    if sys.platform == "win32":
        options["creationflags"] = (
            subprocess.BELOW_NORMAL_PRIORITY_CLASS | subprocess.DETACHED_PROCESS
        )
    process = subprocess.Popen(
        arguments,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
        start_new_session=True,
        **options,
    )
    with suppress(OSError, AttributeError):
        os.setpriority(os.PRIO_PROCESS, process.pid, _LOW_PRIORITY)
        # Linux can share its time between sessions, regardless of the priorities in a session.
        Path(f"/proc/{process.pid}/autogroup").write_text(f"{_LOW_PRIORITY}\n")
    # A return code prevents the warning of `subprocess` that the process is still running.
    process.returncode = 0


# ---- Locks


def lock(descriptor: int) -> bool:
    """Lock an open file for this process until the file is closed, without waiting.

    Return True if the file is locked, or if its file system does not support locks. Return False if
    another process has locked it. `descriptor` is the file descriptor of the file.
    """
    try:
        import fcntl
    except ImportError:
        return _lock_on_windows(descriptor)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:  # another process has locked the file
        return False
    except OSError:  # the file system does not support locks
        return True
    return True


def _lock_on_windows(descriptor: int) -> bool:
    """Lock an open file on Windows, and return True; return False if another process has locked it.
    `descriptor` is the file descriptor of the file."""
    try:
        import msvcrt
    except ImportError:  # the system is not Windows and has no `fcntl`
        return True
    try:
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
    except OSError:
        return False
    return True


def available_memory() -> float:
    """Return the memory that this process can allocate, bytes; inf if unknown.

    The result is the available memory of the machine (Linux only), or the limit of the address
    space of the process (`ulimit -v`) if this is smaller.
    """
    limits = []
    # The file has a line such as `MemAvailable: 16384 kB`.
    with suppress(OSError, ValueError, IndexError), Path("/proc/meminfo").open() as lines:
        limits += [
            1024.0 * float(line.split()[1]) for line in lines if line.startswith("MemAvailable")
        ]
    try:
        import resource
    except ImportError:  # Windows has no such limits
        return min(limits, default=math.inf)
    soft_limit, _hard_limit = resource.getrlimit(resource.RLIMIT_AS)
    if soft_limit != resource.RLIM_INFINITY:
        limits.append(float(soft_limit))
    return min(limits, default=math.inf)


def lock_failure(file: Path) -> str | None:
    """Return the reason why a file cannot be locked, if its file system does not support locks (or
    has no free locks); None if it supports locks.

    The locks of the library SQLite (`fcntl`) are tested; `lock` uses other locks. The
    caller has no such lock, because this function would remove it.
    """
    try:
        import fcntl
    except ImportError:  # Windows
        return None
    with suppress(OSError), file.open("rb") as stream:
        try:
            fcntl.lockf(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except (BlockingIOError, PermissionError):  # another process has locked the file
            return None
        except OSError as error:
            return error.strerror or str(error)
    return None


def is_at(descriptor: int, file: Path) -> bool:
    """Return True if an open file is still the file with this path: it was neither removed nor
    replaced."""
    try:
        return os.path.samestat(os.fstat(descriptor), file.stat())
    except OSError:
        return False


def is_special(name: str | Path) -> bool:
    """Return True if a path is a directory, a named pipe or a device; False for a regular file or a
    missing file. Opening a named pipe would block.

    The status is read once: another process may create or remove the file at any time.
    """
    try:
        return not stat.S_ISREG(Path(name).stat().st_mode)
    except (OSError, ValueError):  # the caller opens the file next, which reports the error
        return False


def open_to_lock(file: Path, *, create: bool = True) -> BinaryIO:
    """Open a file for locking, and create it if necessary. A symbolic link is not followed: it may
    be in a directory from somebody else.

    Raises
    ------
    OSError
        The file is a symbolic link, or cannot be opened or created.
    """
    if file.is_symlink():
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
    flags = os.O_APPEND | os.O_WRONLY | getattr(os, "O_NOFOLLOW", 0) | (os.O_CREAT if create else 0)
    return os.fdopen(os.open(file, flags, 0o666), "ab")


def _open_if_possible(file: Path | None, create: bool) -> BinaryIO | None:
    """Open a file for locking; None if this is not possible."""
    try:
        return open_to_lock(file, create=create) if file and not is_special(file) else None
    except OSError:
        return None


@contextmanager
def locked(
    file: Path | None, on_wait: Callable[[], object], *, create: bool = True
) -> Iterator[None]:
    """Lock a file during a `with` statement. The statement starts when the lock is available.

    The process with the lock may remove the file at the end of the statement: waiting processes
    then lock the new file of this name.

    Parameters
    ----------
    file : Path | None
        File, which is created if necessary and with `create`. Without a file, or if the file cannot
        be created or is a symbolic link, the statement starts without a lock.
    on_wait : callable
        Function that is called a single time if another process has locked the file.
    """
    is_reported = False
    # On a file system with unstable inode numbers, each attempt would fail.
    for _ in range(_MAX_REOPENED):
        stream = _open_if_possible(file, create)
        if file is None or stream is None:
            break
        with stream:
            while not lock(stream.fileno()):
                if not is_reported:
                    on_wait()
                    is_reported = True
                time.sleep(0.05)  # s, between two attempts
            # A removed file does not exclude processes that create it again.
            if is_at(stream.fileno(), file):
                yield
                return
    yield


_MAX_REOPENED = 1000
"""Maximum number of times that a lock file is opened again, because another process has removed
it."""

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
        Function that receives an item and returns its result.
    items : iterable
        Items; None is not allowed.
    """
    # Import here, because most uses of the module do not need threads.
    from concurrent import futures

    remaining = iter(items)
    running: set[futures.Future[Result]] = set()
    pool = futures.ThreadPoolExecutor(jobs)
    try:
        while True:
            while (
                len(running) < _SUBMITTED_PER_THREAD * jobs
                and (item := next(remaining, None)) is not None
            ):
                # The thread runs in a copy of the present context (`contextvars`), which contains
                # the records of the files that the command reads.
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
    """Return the version of tdint, and the first 16 hexadecimal digits of the SHA-256 of its
    sources.

    If the sources differ from the installed package, the version includes the start of the hash:
    `0.2.0+sources.1a2b3c4d`. The version of a checkout always includes it, because a checkout has
    no list of unchanged files.
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
    # The sources are unchanged if all digests match the list of files of the installed package
    # (RECORD), which contains digests in Base64 without padding.
    package_digests = {file.as_posix(): file.hash.value for file in files if file.hash}
    is_released = all(
        package_digests.get(f"{folder.name}/{name}")
        == urlsafe_b64encode(digest.digest()).rstrip(b"=").decode()
        for name, digest in digests.items()
    )
    version = __version__ if is_released else f"{__version__}+sources.{sources_digest[:8]}"
    return version, sources_digest[:16]
