"""Numbers as other systems write them."""

import numpy as np


def fixed(value: float, decimals: int) -> str:
    """`value` with that many decimals, never as minus zero."""
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0 else text


def single(value: float) -> str:
    """`value` as a single float, RAPID's num: nine digits, which restore its every bit."""
    return f"{float(np.float32(value)) + 0.0:.9g}"
