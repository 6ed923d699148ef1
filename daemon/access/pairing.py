"""Codes that a person types in: the one-time set-up code in the daemon's log, with which the first key is made; pairing
codes, eight letters from a screen that is signed in, for one that is not; and a limit of attempts."""

import hmac
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass

from daemon.access.roles import Role

ALPHABET = "23456789ABCDEFGHJKLMNPQRSTUVWXYZ"
"""Without 0, 1, I and O, which are easily misread."""

SETUP_GROUPS, SETUP_LETTERS = 4, 4
"""16 letters of 32: 80 bits."""

MAX_SETUP_ATTEMPTS = 5


class SetupCode:
    """A random code, valid until it is used, MAX_SETUP_ATTEMPTS wrong ones were given, or the daemon ends."""

    def __init__(self, choice: Callable[[str], str]) -> None:
        groups = ("".join(choice(ALPHABET) for _ in range(SETUP_LETTERS)) for _ in range(SETUP_GROUPS))
        self.text = "-".join(groups)
        self._tries = MAX_SETUP_ATTEMPTS

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


LETTERS = 8
"""8 letters of 32: 40 bits, with MAX_GUESSES a chance of 5e-12."""

MAX_PAIRING_S = 300.0
MAX_GUESSES = 5
"""Wrong codes, from anywhere, after which every open code ends."""


@dataclass(frozen=True)
class Pairing:
    """An open code: whose key it stands for, up to which role, and until when on the monotonic clock.

    `parent`: hash of the session that made it; None when a key did.
    """

    code: str
    key_id: str
    role: Role
    ends_s: float
    parent: str | None = None


class PairingCodes:
    """The open codes: one a key, each valid once, for MAX_PAIRING_S."""

    def __init__(self, choice: Callable[[str], str], monotonic_s: Callable[[], float]) -> None:
        self._choice, self._monotonic_s = choice, monotonic_s
        self._open: dict[str, Pairing] = {}
        self._guesses_left = MAX_GUESSES

    def begin(self, key_id: str, role: Role, parent: str | None = None) -> str:
        """A new code for this key, as "ABCD-EFGH"; an earlier one of the key ends."""
        if not self._open:
            self._guesses_left = MAX_GUESSES
        letters = "".join(self._choice(ALPHABET) for _ in range(LETTERS))
        code = f"{letters[:4]}-{letters[4:]}"
        self._open[key_id] = Pairing(code, key_id, role, self._monotonic_s() + MAX_PAIRING_S, parent)
        return code

    def redeem(self, given: str) -> Pairing | None:
        """Use up the code; None for one that is not open, which counts as a guess."""
        now_s = self._monotonic_s()
        self._open = {key_id: pairing for key_id, pairing in self._open.items() if now_s < pairing.ends_s}
        matching = [p for p in self._open.values() if hmac.compare_digest(plain_code(p.code), plain_code(given))]
        if matching:
            return self._open.pop(matching[0].key_id)
        self._guesses_left -= bool(self._open)
        if self._guesses_left <= 0:
            self._open.clear()
        return None


MAX_ATTEMPTS = 10
WINDOW_S = 60.0
MAX_NETWORKS = 10_000
"""Networks that are remembered; the one that tried longest ago is forgotten for one more."""


class AttemptLimit:
    """Counts attempts: MAX_ATTEMPTS in WINDOW_S for each network, successful or not."""

    def __init__(self, monotonic_s: Callable[[], float]) -> None:
        self._monotonic_s = monotonic_s
        self._attempts: OrderedDict[str, deque[float]] = OrderedDict()

    def allows(self, network: str) -> bool:
        """Count one attempt; False when there were too many. A refused attempt is not counted."""
        now_s = self._monotonic_s()
        times = self._attempts.setdefault(network, deque())
        self._attempts.move_to_end(network)
        while len(self._attempts) > MAX_NETWORKS:
            self._attempts.popitem(last=False)
        while times and now_s - times[0] >= WINDOW_S:
            times.popleft()
        if len(times) >= MAX_ATTEMPTS:
            return False
        times.append(now_s)
        return True
