"""The one-time set-up code in the daemon's log, with which the first key is made."""

import hmac
from collections.abc import Callable

ALPHABET = "23456789ABCDEFGHJKLMNPQRSTUVWXYZ"
"""Without 0, 1, I and O, which are easily misread."""

GROUPS, LETTERS = 4, 4
"""16 letters of 32: 80 bits."""

MAX_ATTEMPTS = 5


class SetupCode:
    """A random code, valid until it is used, MAX_ATTEMPTS wrong ones were given, or the daemon ends."""

    def __init__(self, choice: Callable[[str], str]) -> None:
        groups = ("".join(choice(ALPHABET) for _ in range(LETTERS)) for _ in range(GROUPS))
        self.text = "-".join(groups)
        self._tries = MAX_ATTEMPTS

    @property
    def usable(self) -> bool:
        return self._tries > 0

    def redeem(self, given: str) -> bool:
        """Use up the code if `given` is it and return True; otherwise count a wrong attempt and return False."""
        if not self.usable:
            return False
        right = hmac.compare_digest(plain_code(given), plain_code(self.text))
        self._tries = 0 if right else self._tries - 1
        return right


def plain_code(code: str) -> bytes:
    """The letters and digits of a typed code in upper case."""
    return "".join(letter for letter in code.upper() if letter.isalnum()).encode()
