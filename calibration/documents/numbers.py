"""Numbers as reports print them: two significant digits of an uncertainty, and its value to the same place."""

import math

MINUS, DASH = "\u2212", "\u2014"


def number(value: float | None, decimals: int) -> str:
    """`value` with that many decimals and a true minus sign; a dash for None."""
    if value is None or not math.isfinite(value):
        return DASH
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0 else text.replace("-", MINUS)


def places(uncertainty: float | None, most: int = 6) -> int:
    """Decimals that leave two significant digits of `uncertainty`; 3 when it is not known."""
    if uncertainty is None or not math.isfinite(uncertainty) or uncertainty <= 0:
        return 3
    return min(most, max(0, 1 - math.floor(math.log10(uncertainty))))


def significant(value: float | None, digits: int = 2) -> str:
    """`value` with that many significant digits, without an exponent."""
    if value is None or not math.isfinite(value):
        return DASH
    if value == 0:
        return "0"
    return number(value, max(0, digits - 1 - math.floor(math.log10(abs(value)))))
