"""The first key: whoever can read the daemon's log may make it, once."""

import hmac
from collections.abc import Callable

ALPHABET = "23456789ABCDEFGHJKLMNPQRSTUVWXYZ"
"""Nothing that is read as something else."""

GROUPS, LETTERS = 4, 4
"""80 bits; a few wrong guesses end it."""

TRIES = 5


class SetupCode:
    """One code, while the daemon runs and until it is used."""

    def __init__(self, choice: Callable[[str], str]) -> None:
        groups = ("".join(choice(ALPHABET) for _ in range(LETTERS)) for _ in range(GROUPS))
        self.text = "-".join(groups)
        self._tries = TRIES

    @property
    def usable(self) -> bool:
        return self._tries > 0

    def opens(self, given: str) -> bool:
        """Is this the code? Wrong ones are counted."""
        if not self.usable:
            return False
        right = hmac.compare_digest(_plain(given), _plain(self.text))
        self._tries = 0 if right else self._tries - 1
        return right


def _plain(code: str) -> bytes:
    return "".join(letter for letter in code.upper() if letter.isalnum()).encode()
