"""Chunks on other machines, by Dask: each goes out with all that it needs, and comes back as rows.

Dask unpickles what reaches its port: whoever reaches it runs programs there. Beyond this machine certificates are asked
for.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, wait
from contextlib import suppress
from ipaddress import ip_address
from itertools import islice
from typing import Any
from urllib.parse import urlsplit

from tdint.campaign.batch import Chunk, Done, do
from tdint.data import dataclass
from tdint.errors import AnalysisError, UsageError
from tdint.files import MOST_BYTES, read_at_most
from tdint.methods.catalogue import load_plugin
from tdint.model.plugins import files_received, files_to_send

_AHEAD = 3
"""Chunks for each thread of the workers, those they are at among them."""

_SILENT, _PATIENCE = 1.0, 10.0
"""Seconds for which a scheduler is waited for without a word, and at most."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Cluster:
    """A scheduler, and the certificates by which both sides know each other.

    Attributes
    ----------
    address : str
        tcp://HOST:PORT or tls://HOST:PORT.
    ca, cert, key : str or None
        PEM files: the authority's certificate, our own and its key.

    Raises
    ------
    UsageError
        No such address; no certificates where they are needed.
    """

    address: str
    ca: str | None = None
    cert: str | None = None
    key: str | None = None

    def __post_init__(self) -> None:
        # Whoever reaches a scheduler runs programs on it: beyond this machine certificates are a must.
        parts = _parts(self.address)
        given = [self.ca, self.cert, self.key]
        if parts.scheme == "tls":
            if None in given:
                raise UsageError(
                    f"{self.address}: give --tls-ca, --tls-cert and --tls-key, all three"
                )
            for file in given:
                try:
                    read_at_most(str(file), MOST_BYTES, UsageError)
                except OSError as error:
                    raise UsageError(f"{file}: cannot be read: {error.strerror or error}") from None
        elif any(given):
            raise UsageError(
                f"{self.address}: certificates are for an address that begins with tls://"
            )
        elif not is_loopback(parts.hostname or ""):
            raise UsageError(
                f"{self.address}: beyond this machine the connection must be encrypted, for whoever reaches the port "
                "runs programs; start scheduler and workers with --tls-ca-file, --tls-cert and --tls-key, and give a "
                "tls:// address with --tls-ca, --tls-cert and --tls-key"
            )


def _parts(address: str) -> Any:
    with suppress(ValueError):  # a port that is no number shows only when it is asked for
        parts = urlsplit(address)
        is_bare = (
            f"{parts.scheme}://{parts.netloc}".lower() == address.lower()
            and "@" not in parts.netloc
        )
        if is_bare and parts.scheme in ("tcp", "tls") and parts.hostname and parts.port:
            return parts
    raise UsageError(
        f"{address!r} is no address of a scheduler; write tcp://HOST:PORT or tls://HOST:PORT"
    )


def is_loopback(host: str) -> bool:
    """Whether a host is this machine."""
    if host == "localhost":
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


def on_cluster(
    cluster: Cluster, chunk: Callable[[int], Chunk], numbers: Sequence[int]
) -> Iterator[Done]:
    """Each chunk, in the order in which they are done. Those of a worker that is lost are done by others.

    Raises
    ------
    UsageError
        Dask is not installed, or there is no scheduler at the address.
    AnalysisError
        Workers are lost with one chunk again and again; and what chunks raise.
    """
    client = _connect(cluster)
    try:
        yield from _done(client, chunk, iter(numbers))
    finally:
        client.close()


def do_with(plugins: tuple[tuple[str, bytes], ...], chunk: Chunk) -> Done:
    """Integrate the runs of a chunk on a worker, which executes the files of plug-ins that the chunk may need first.

    Raises
    ------
    UsageError
        A plug-in that does not run there: what else it imports does not travel.
    """
    for file in files_received(plugins):
        load_plugin(file)
    return do(chunk)


def _connect(cluster: Cluster) -> Any:
    try:
        from distributed import Client, Security
    except ImportError:
        raise UsageError(
            "--dask needs Dask: pip install 'tdint[dask]', here and for the workers"
        ) from None
    # Where certificates are given nothing may go unencrypted.
    security = Security(
        tls_ca_file=cluster.ca,
        tls_client_cert=cluster.cert,
        tls_client_key=cluster.key,
        require_encryption=True,
    )
    answer: Future[Any] = Future()

    def connect() -> None:
        try:
            secured = security if cluster.ca else None
            answer.set_result(
                Client(cluster.address, security=secured, timeout=_PATIENCE, set_as_default=False)
            )
        except Exception as error:
            answer.set_exception(error)

    # On a thread, for Dask waits for ever where the port belongs to something else that says nothing.
    threading.Thread(target=connect, daemon=True).start()
    # A scheduler that answers late is waited for, and that is said; one that says nothing is given up.
    if not wait([answer], _SILENT).done:
        _log.info("%s: no scheduler answers yet; waiting for ten seconds at most", cluster.address)
        wait([answer], _PATIENCE - _SILENT)
    error = answer.exception() if answer.done() else TimeoutError("waited for ten seconds")
    if error:
        text = " ".join(str(error).split()) or type(error).__name__
        raise UsageError(f"{cluster.address}: no scheduler answers: {text}")
    return answer.result()


def _done(client: Any, chunk: Callable[[int], Chunk], numbers: Iterator[int]) -> Iterator[Done]:
    from distributed import KilledWorker, as_completed

    # Workers may lack the user's own methods: their files travel with every chunk.
    plugins = files_to_send()
    running = as_completed(loop=client.loop)

    # Some chunks more than there are threads, so that no worker waits; workers may come and go. Chunks are made as they
    # are sent: all of them at once would fill the memory.
    def go_on(under_way: int) -> int:
        threads: dict[str, int] = client.nthreads()
        width = _AHEAD * max(1, sum(threads.values()))
        for number in islice(numbers, max(0, width - under_way)):
            running.add(client.submit(do_with, plugins, chunk(number), pure=False, retries=0))
            under_way += 1
        return under_way

    under_way = go_on(0)
    for future in running:
        try:
            done: Done = future.result()
        except KilledWorker as error:
            raise AnalysisError(
                f"workers were lost again and again with the same runs: {error}"
            ) from None
        # The scheduler forgets a result that is here.
        future.release()
        yield done
        under_way = go_on(under_way - 1)
