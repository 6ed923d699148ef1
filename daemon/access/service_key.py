"""The key of a service's own group: made anew at each start, in a file that only root and that group can read.

Whoever reads it could make keys, read the store and write the settings anyway. Commands find it, curl takes it as
`-H @/run/handeyed/authorization`.
"""

import os
import secrets
from dataclasses import dataclass
from pathlib import Path

from daemon.access.keys import RandomHex, hash_key, matches, new_key
from daemon.runtime.durable_files import create_file

AUTHORIZATION = "authorization"
"""The file in the service's runtime folder: one header line, as curl reads it."""


@dataclass(frozen=True)
class ServiceKey:
    """The hash of the key; the key itself stands in the file only."""

    hash: str

    @classmethod
    def make(cls, folder: Path, random_hex: RandomHex = secrets.token_hex) -> "ServiceKey":
        """Make the key, and write its file into `folder`, readable by the folder's group. Raises OSError."""
        key, _, _ = new_key(random_hex)
        written = folder / f".{AUTHORIZATION}"
        with create_file(written) as out:
            os.fchmod(out.fileno(), 0o640)  # a service's umask leaves the group out
            out.write(f"Authorization: Bearer {key}\n".encode())
        written.replace(folder / AUTHORIZATION)
        return cls(hash_key(key))

    def opens(self, key: str) -> bool:
        """True when `key` is this key; compared in constant time."""
        return matches(key, self.hash)


def read_authorization(folder: Path) -> str | None:
    """The value of the header in the file below `folder`, "Bearer ..."; None when it is not there or not for us."""
    try:
        line = (folder / AUTHORIZATION).read_text(encoding="ascii")
    except (OSError, UnicodeError):
        return None
    return line.partition(":")[2].strip() or None
