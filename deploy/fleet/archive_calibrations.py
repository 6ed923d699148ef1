"""Copy each calibration that was applied, once, into FOLDER/CELL/ID.json: `archive_calibrations.py CELL URL FOLDER`.

HANDEYED_KEY: a viewer's key of that cell; HANDEYED_CA: its authority.pem. The folder is sent on by
`rclone copy --immutable FOLDER REMOTE:BUCKET`, which refuses to change what is there.
"""

import os
import re
import sys
from pathlib import Path

from handeyed import Client

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


def archive(daemon: Client, folder: Path) -> list[str]:
    """Write those that are not there yet, each completely or not at all; returns their ids, oldest first."""
    folder.mkdir(parents=True, exist_ok=True)
    applied = (row["calibration_id"] for row in reversed(daemon.get("/calibrations?limit=500")["applied"]))
    written = []
    for calibration_id in dict.fromkeys(applied):
        file = folder / f"{calibration_id}.json"
        if NAME.fullmatch(calibration_id) and not file.exists():
            part = file.with_name(f".{file.name}.part")
            part.unlink(missing_ok=True)  # what a machine that stopped left is read-only
            part.write_bytes(daemon.read(f"/calibrations/{calibration_id}"))
            part.chmod(0o444)
            os.link(part, file)  # never replaces one that is there
            part.unlink()
            written.append(calibration_id)
    return written


if __name__ == "__main__":
    cell, url, kept = sys.argv[1:]
    if not NAME.fullmatch(cell):
        sys.exit(f"{cell!r} is no name of a cell: letters, digits, dots and dashes")
    with Client(url) as daemon:
        for name in archive(daemon, Path(kept) / cell):
            sys.stdout.write(f"{cell}/{name}.json\n")
