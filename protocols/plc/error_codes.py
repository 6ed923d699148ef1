"""Error codes as numbers for a PLC. A number is never reused for another error."""

import json
from pathlib import Path

NO_ERROR = 0
UNKNOWN = 999
"""An error without a number: the log and the REST interface have its message."""

ERROR_CODES: dict[str, tuple[int, str]] = {
    code: (number, meaning)
    for code, (number, meaning) in json.loads(Path(__file__).with_suffix(".json").read_text("utf-8")).items()
}
"""Number and meaning of each stable code, from the sheet beside this file. Tens: 0 the PLC itself, 1 and 2 refused now,
3 and 4 robot and other devices, 5 what was seen, 6 the computer, 9 a defect."""


def number_of(code: str) -> int:
    """The number of an error's stable code."""
    return ERROR_CODES[code][0] if code in ERROR_CODES else UNKNOWN
