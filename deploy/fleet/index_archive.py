"""Write OUT/outcomes.parquet, a row for each finished scan of `register-archive --out OUT`: `index_archive.py OUT`.

Each time whole, by one listing and the manifest and report of each scan, read many at a time where the place allows it.
Grafana, DuckDB and pandas then read one file instead of 10,000 folders. Needs the extras `archive` and `parquet`
(`pip install 'handeyed[archive,parquet]'`), for S3 `s3` too.
"""

import io
import json
import sys
from typing import Any

try:
    import fsspec
    import pyarrow
    import pyarrow.parquet
except ImportError as error:
    sys.exit(f"{error.name} is not installed: pip install 'handeyed[archive,parquet]'")

OUTCOMES = "outcomes.parquet"
MANIFEST, REPORT = "manifest.json", "report.json"

COLUMNS = pyarrow.schema(
    [
        ("scan", pyarrow.string()),
        ("calibration_id", pyarrow.string()),
        ("points", pyarrow.int64()),
        ("accepted", pyarrow.bool_()),
        ("rms_mm", pyarrow.float64()),  # between overlapping views, as merged; null where none overlap
        ("rms_before_mm", pyarrow.float64()),  # the same before a refinement
        ("input_sha256", pyarrow.string()),
        ("cloud_sha256", pyarrow.string()),
    ]
)


def outcomes(system: Any, path: str) -> tuple[list[dict[str, Any]], list[str]]:
    """The rows, by the scans' names, and the folders whose two documents cannot be read."""
    found = sorted(file.rpartition("/")[0] for file in system.find(path) if file.endswith(f"/{MANIFEST}"))
    files = [f"{folder}/{name}" for folder in found for name in (MANIFEST, REPORT)]
    contents = system.cat(files, on_error="return") if files else {}
    rows, unreadable = [], []
    for folder in found:
        try:
            manifest, report = (json.loads(contents[f"{folder}/{name}"]) for name in (MANIFEST, REPORT))
            [cloud] = [file["sha256"] for file in manifest["files"] if file["name"] != REPORT]
            rms = report["rms_mm"]
            row = {name: manifest[name] for name in COLUMNS.names if name in manifest} | {
                "rms_mm": rms["before"] if rms["after"] is None else rms["after"],
                "rms_before_mm": rms["before"],
                "cloud_sha256": cloud,
            }
            pyarrow.Table.from_pylist([row], COLUMNS)
        except (TypeError, ValueError, KeyError, pyarrow.ArrowException):
            unreadable.append(folder)
        else:
            rows.append(row)
    return sorted(rows, key=lambda row: str(row["scan"])), unreadable


def index_archive(url: str) -> tuple[int, list[str]]:
    """Write the index into the folder at `url`; the number of rows, and the folders left out."""
    system, path = fsspec.core.url_to_fs(url.rstrip("/"))
    rows, unreadable = outcomes(system, path)
    written = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.Table.from_pylist(rows, COLUMNS), written)
    part = f"{path}/.{OUTCOMES}.part"
    system.pipe_file(part, written.getvalue())
    system.mv(part, f"{path}/{OUTCOMES}")  # a reader sees the old one or the new one
    return len(rows), unreadable


if __name__ == "__main__":
    place = sys.argv[1].rstrip("/")
    count, left_out = index_archive(place)
    for folder in left_out:
        sys.stderr.write(f"{folder}: {MANIFEST} and {REPORT} cannot be read: give register-archive again\n")
    sys.stdout.write(f"{place}/{OUTCOMES}: {count} scans\n")
    sys.exit(3 if left_out else 0)
