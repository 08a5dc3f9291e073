"""Ctrl-C and SIGTERM end a command in time, whatever it is at.

Python sees a signal between two of its own instructions only (`tdint_cli.errors` makes exceptions of both there). Where
a library works on for longer, a thread that the system tells of the signal ends the process: without a temporary file,
and without processes left behind.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from tdint.system import do_not_wait
from tdint_cli.errors import INTERRUPTED, TERMINATED
from tdint_cli.terminal.streams import complain

_PATIENCE = 0.3
"""How long the command may take to end on its own, s."""


def end_in_time() -> Callable[[], None]:
    """Watch for both signals until this process ends. What comes back is to be called when the command has ended and
    said so: threads may be waited for then, which another signal ends without a word."""
    if threading.current_thread() is not threading.main_thread():
        return lambda: None
    said = threading.Event()
    source, told = os.pipe()
    do_not_wait(told)
    threading.Thread(target=_watch, args=(source, said), daemon=True).start()
    signal.set_wakeup_fd(told, warn_on_full_buffer=False)
    return partial(_leave_to_the_watch, said)


def _leave_to_the_watch(said: threading.Event) -> None:
    said.set()
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, lambda *_: None)  # Python itself would show a traceback.


def _watch(source: int, said: threading.Event) -> None:
    # A signal that is ignored is not told; the first one counts.
    while data := os.read(source, 1):
        if data[0] in (signal.SIGINT, signal.SIGTERM):
            threading.Event().wait(_PATIENCE)
            _end(data[0], said)


def _end(number: int, said: threading.Event) -> None:
    import multiprocessing

    from tdint.files import remove_unfinished

    with suppress(Exception):
        for process in multiprocessing.active_children():
            process.kill()
        remove_unfinished()
        if not said.is_set():
            complain("Interrupted" if number == signal.SIGINT else "Terminated")
    os._exit(INTERRUPTED if number == signal.SIGINT else TERMINATED)
