"""Run the chunks of a campaign on a Dask cluster.

Each chunk is sent to a worker with all its input, and the worker returns table rows. Dask unpickles
everything it receives, so anyone who can connect to its port can execute code. TLS certificates are
therefore required unless the scheduler runs on this machine.
"""

from __future__ import annotations

import logging
import re
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, wait
from ipaddress import ip_address
from itertools import islice
from typing import Any

from tdint.errors import AnalysisError, UsageError
from tdint.files import MOST_BYTES, read_at_most
from tdint.methods.catalogue import load_plugin
from tdint.model.plugins import files_received, files_to_send
from tdint.studies.campaign.chunks import Chunk, ChunkResult, run_chunk

_SUBMITTED_PER_THREAD = 3
"""Number of submitted chunks per worker thread, including the chunk that is running."""

_NOTICE_AFTER, _TIMEOUT = 1.0, 10.0
"""Seconds after which the user is informed that the scheduler has not responded, and after which to
give up."""

_log = logging.getLogger(__name__)


def check_address(address: str) -> bool:
    """Check the address of a Dask scheduler, tcp://HOST:PORT or tls://HOST:PORT, and return True if
    the connection is encrypted.

    Anyone who can connect to a scheduler can execute code there, so a scheduler on another machine
    requires certificates, which are read from the configuration of Dask.

    Raises
    ------
    UsageError
        The address is invalid, or an unencrypted connection would leave this machine.
    """
    match = _ADDRESS.fullmatch(address)
    if not match or not 0 < int(match["port"]) < 2**16:
        raise UsageError(
            f"invalid scheduler address {address!r}; expected tcp://HOST:PORT or tls://HOST:PORT"
        )
    has_certificates = match["scheme"].lower() == "tls"
    if not (has_certificates or is_loopback(match["host"].strip("[]").lower())):
        raise UsageError(
            f"{address}: connections to another machine must be encrypted, because anyone who can "
            "connect to the port can execute code; start scheduler and workers with --tls-ca-file, "
            "--tls-cert and --tls-key, and use a tls:// address"
        )
    return has_certificates


_ADDRESS = re.compile(
    r"(?i)(?P<scheme>tcp|tls)://(?P<host>\[[0-9a-f:.%]+\]|[^][@/?#:\s]+):(?P<port>[0-9]{1,5})"
)
"""Address of a scheduler, without a path, a query or a user name."""


def is_loopback(host: str) -> bool:
    """Return True if a host name or IP address refers to this machine."""
    if host == "localhost":
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


def on_cluster(
    address: str, chunk: Callable[[int], Chunk], numbers: Sequence[int]
) -> Iterator[ChunkResult]:
    """Run chunks on a Dask cluster and yield their results in order of completion. `address` is the
    address of the scheduler.

    Chunks of a worker that fails are re-run on another worker.

    Parameters
    ----------
    chunk : callable
        Creates the chunk with a given number; called when the chunk is submitted.

    Raises
    ------
    UsageError
        Dask is not installed, or no scheduler responds at the address.
    AnalysisError
        Workers were lost repeatedly while running the same chunk. Exceptions raised by a chunk are
        also raised here.
    """
    client = _connect(address)
    # Imported after the connection, which reports that Dask is not installed.
    from distributed import KilledWorker, as_completed

    # Workers may not have the user's plug-ins, so the plug-in files are sent with every chunk.
    plugins, remaining = files_to_send(), iter(numbers)
    running = as_completed(loop=client.loop)

    def submit_more(pending: int) -> int:
        """Submit further chunks and return the number of pending chunks.

        `pending` is the number of chunks that are submitted and not completed. Its limit exceeds
        the number of threads, so that no worker is idle.
        """
        # Workers may join and leave, so the number of threads is requested each time.
        threads_by_worker: dict[str, int] = client.nthreads()
        limit = _SUBMITTED_PER_THREAD * max(1, sum(threads_by_worker.values()))
        # A chunk is created when it is submitted: all chunks together may not fit in memory.
        for number in islice(remaining, max(0, limit - pending)):
            # With `pure=False`, Dask does not search for equal chunks to reuse their results.
            running.add(
                client.submit(run_chunk_with_plugins, plugins, chunk(number), pure=False, retries=0)
            )
            pending += 1
        return pending

    try:
        pending = submit_more(0)
        for future in running:
            try:
                result: ChunkResult = future.result()
            except KilledWorker as error:
                raise AnalysisError(
                    f"workers of the cluster failed repeatedly during the same runs: {error}; the "
                    "logs of the workers state the reason, such as insufficient memory"
                ) from None
            # The result was transferred; let the scheduler free its memory.
            future.release()
            yield result
            pending = submit_more(pending - 1)
    finally:
        client.close()


def run_chunk_with_plugins(plugins: tuple[tuple[str, bytes], ...], chunk: Chunk) -> ChunkResult:
    """Run a chunk on a worker, after loading the plug-ins that it may need.

    Parameters
    ----------
    plugins : tuple of (str, bytes)
        File name and contents of each plug-in of the user.

    Raises
    ------
    UsageError
        A plug-in fails on the worker. Only the plug-in file is sent, not the other modules that it
        imports.
    """
    for file in files_received(plugins):
        load_plugin(file)
    return run_chunk(chunk)


def _connect(address: str) -> Any:
    """Connect to the Dask scheduler of a cluster and return the client. UsageError is raised if
    Dask is not installed, a certificate is missing, or no scheduler responds at the address.
    """
    try:
        from distributed import Client, Security
    except ImportError:
        raise UsageError(
            "--dask requires Dask, which is not installed; install it on this machine and on the "
            "workers with: pip install 'tdint[dask]'"
        ) from None
    security = _security(Security(require_encryption=True), address)
    connection: Future[Any] = Future()

    def connect() -> None:
        """Create the client, and store it or its exception in `connection`."""
        try:
            client = Client(address, security=security, timeout=_TIMEOUT, set_as_default=False)
            connection.set_result(client)
        except Exception as error:
            connection.set_exception(error)

    # Connect in a thread: Dask ignores its timeout if another program owns the port and does not
    # respond.
    threading.Thread(target=connect, daemon=True).start()
    if not wait([connection], _NOTICE_AFTER).done:
        _log.info("%s: no response from the scheduler yet; waiting up to ten seconds", address)
        wait([connection], _TIMEOUT - _NOTICE_AFTER)
    error = (
        connection.exception()
        if connection.done()
        else TimeoutError("the connection timed out after ten seconds")
    )
    if error:
        text = " ".join(str(error).split()) or type(error).__name__
        raise UsageError(
            f"{address}: no scheduler responds ({text}); start a Dask scheduler, or "
            "correct the address"
        )
    return connection.result()


_CERTIFICATES = {
    "tls_ca_file": "DASK_DISTRIBUTED__COMM__TLS__CA_FILE",
    "tls_client_cert": "DASK_DISTRIBUTED__COMM__TLS__CLIENT__CERT",
    "tls_client_key": "DASK_DISTRIBUTED__COMM__TLS__CLIENT__KEY",
}
"""Fields of `distributed.Security` that an encrypted connection requires, and the environment
variables that set them in the configuration of Dask."""


def _security(configured: Any, address: str) -> Any:
    """Return the certificates in the configuration of Dask for an encrypted connection; None for a
    connection within this machine. UsageError names a certificate that is not configured or cannot
    be read; the error of the connection would not name it.
    """
    if not check_address(address):
        return None
    for name, variable in _CERTIFICATES.items():
        file = getattr(configured, name)
        if not file:
            raise UsageError(
                f"{address}: the configuration of Dask contains no {name}, which a tls:// "
                f"address requires; set it there, or by the environment variable {variable}"
            )
        try:
            read_at_most(str(file), MOST_BYTES, UsageError)
        except OSError as error:
            raise UsageError(f"{file}: cannot read the file: {error.strerror or error}") from None
    return configured
