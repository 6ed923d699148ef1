"""Numbers as people read them."""

import pytest

from calibration.documents.numbers import number, places, significant


@pytest.mark.parametrize(("value", "u", "text"), [
    (45.250196, 0.0381, "45.250"), (-7.20025, 0.045, "\u22127.200"), (1266.23, 1.24, "1266.2"), (0.0001, 12.0, "0"),
])  # fmt: skip
def test_a_value_ends_where_its_uncertainty_does(value: float, u: float, text: str) -> None:
    assert number(value, places(u)) == text


@pytest.mark.parametrize(("value", "text"), [(0.0381, "0.038"), (0.00999, "0.0100"), (12.4, "12"), (None, "\u2014"),
                                              (float("nan"), "\u2014"), (0.0, "0"), (1234.0, "1234")])  # fmt: skip
def test_two_digits_of_an_uncertainty(value: float | None, text: str) -> None:
    assert significant(value) == text
