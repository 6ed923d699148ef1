"""Date and time in texts: `2026-11-22T10:15:02.118Z`, `22.11.2026 10:15:02`, and `IMG_20261122_101502` in names."""

import re
from datetime import datetime

_GAP = r"[-_.:/ ]?"
_YEAR_FIRST = rf"(?P<year>(?:19|20)\d{{2}}){_GAP}(?P<month>\d{{2}}){_GAP}(?P<day>\d{{2}})"
_DAY_FIRST = r"(?P<day>\d{1,2})\.(?P<month>\d{1,2})\.(?P<year>(?:19|20)\d{2})"
_CLOCK = rf"(?P<hour>\d{{2}}){_GAP}(?P<minute>\d{{2}}){_GAP}(?P<second>\d{{2}})(?:[._,-]?(?P<fraction>\d{{1,9}}))?"
_ZONE = r"(?P<zone>Z|[+-]\d{2}:?\d{2})?"
_FORMS = tuple(re.compile(rf"(?<!\d){date}[T_\- ]?{_CLOCK}(?!\d){_ZONE}") for date in (_YEAR_FIRST, _DAY_FIRST))


def seconds_of(text: str) -> float | None:
    """Seconds since 1970 of the first date with a time in a text, in UTC where no zone is said; None without one."""
    found = next((match for form in _FORMS if (match := form.search(text))), None)
    if found is None:
        return None
    parts = [int(found[part]) for part in ("year", "month", "day", "hour", "minute", "second")]
    try:
        moment = datetime(*parts, tzinfo=datetime.strptime(found["zone"] or "Z", "%z").tzinfo)  # type: ignore[arg-type,misc]
    except ValueError:
        return None
    return moment.timestamp() + float(f"0.{found['fraction'] or 0}")
