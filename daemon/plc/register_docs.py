"""`python -m daemon.plc.register_docs`: write docs/plc-registers.csv and the tables of docs/plc.md."""

import sys
from pathlib import Path

from protocols.plc.tables import csv_text, markdown_text

DOCS = Path(__file__).resolve().parents[2] / "docs"
BEGIN, END = "<!-- tables: written by python -m daemon.plc.register_docs -->\n\n", "\n<!-- end of the tables -->"


def main() -> int:
    """Write both files in this repository."""
    page = DOCS / "plc.md"
    head, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    tail = rest.partition(END)[2]
    page.write_text(head + BEGIN + markdown_text() + END + tail, encoding="utf-8")
    (DOCS / "plc-registers.csv").write_text(csv_text(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
