"""Which requests over Modbus TCP are taken for older ones that come again."""

import pytest

from protocols.modbus.mbap import KEPT, Adu, RequestNumbers

PRESS, RELEASE, READ = b"press", b"release", b"read"
Request = tuple[int, bytes]

STORIES: dict[str, tuple[list[Request], list[bool]]] = {
    "numbered": ([(1, PRESS), (2, RELEASE), (3, PRESS), (4, RELEASE)], [False] * 4),
    "an old press after the release": ([(1, PRESS), (2, RELEASE), (1, PRESS)], [False, False, True]),
    "several old ones, in any order": (
        [(1, PRESS), (2, RELEASE), (3, READ), (2, RELEASE), (1, PRESS), (1, PRESS), (4, PRESS)],
        [False, False, False, True, True, True, False],
    ),
    "the newest at once again is harmless": ([(1, PRESS), (1, PRESS), (2, RELEASE)], [False] * 3),
    "one number for all": ([(0, PRESS), (0, RELEASE), (0, PRESS), (0, RELEASE)], [False] * 4),
    "a number given to another request": ([(1, PRESS), (2, RELEASE), (1, READ), (2, RELEASE)], [False] * 4),
    "numbers that begin again": ([*((k % 100, PRESS) for k in range(300))], [False] * 300),
}


@pytest.mark.parametrize(("requests", "repeated"), STORIES.values(), ids=STORIES.keys())
def test_what_comes_again_is_recognised_by_its_number(requests: list[Request], repeated: list[bool]) -> None:
    numbers = RequestNumbers()
    assert [numbers.is_repeated(Adu(number, 1, pdu)) for number, pdu in requests] == repeated


def test_only_the_latest_are_remembered() -> None:
    numbers = RequestNumbers()
    for number in range(1000):
        assert not numbers.is_repeated(Adu(number, 1, READ))
    assert [numbers.is_repeated(Adu(number, 1, READ)) for number in (1000 - KEPT, 999 - KEPT)] == [True, False]
