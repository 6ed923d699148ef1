"""A vectorised hash table that numbers keys in order of first appearance.

Linear probing by array operations: keys that collide in a slot are written at once, the last one stays, the others
probe further. There is no sort, so a million new cubes cost as much as a million known ones.
"""

import numpy as np
from numpy.typing import NDArray

FREE = -1
FIRST_BITS = 16
LOAD = 2
"""Slots per key: a key is then found after about 1.5 probes."""

SPREAD = np.uint64(0x9E3779B97F4A7C15)
"""2^64 over the golden ratio (Knuth, The Art of Computer Programming 3, 6.4), which spreads neighbouring keys."""

Keys = NDArray[np.int64]


class CellIndex:
    """`keys` are those seen so far, by number; keys must not be negative."""

    def __init__(self) -> None:
        self._known = np.empty(0, np.int64)
        self._count = 0
        self._resize(FIRST_BITS)

    def __len__(self) -> int:
        return self._count

    @property
    def keys(self) -> Keys:
        return self._known[: self._count]

    def numbers(self, keys: Keys) -> NDArray[np.intp]:
        """Number of each key; unknown keys get new numbers. Equal neighbours are looked up once."""
        if not len(keys):
            return np.empty(0, np.intp)
        changes = keys[1:] != keys[:-1]
        if 2 * np.count_nonzero(changes) > len(keys):
            return self._look_up(keys)
        heads = np.concatenate([[0], np.flatnonzero(changes) + 1])
        return np.repeat(self._look_up(keys[heads]), np.diff(heads, append=len(keys)))

    def _look_up(self, keys: Keys) -> NDArray[np.intp]:
        if LOAD * (self._count + len(keys)) > len(self._slots):
            self._resize(int(LOAD * (self._count + len(keys))).bit_length() + 1)
        slot = self._first_slots(keys)
        held = self._slots[slot]
        open_ = np.flatnonzero(held != keys)
        while len(open_):
            free = held[open_] == FREE
            if free.any():
                self._settle(keys, slot, open_[free])
                open_ = open_[self._slots[slot[open_]] != keys[open_]]
            slot[open_] = (slot[open_] + 1) & (len(self._slots) - 1)
            held[open_] = self._slots[slot[open_]]
            open_ = open_[held[open_] != keys[open_]]
        found: NDArray[np.intp] = self._numbers[slot]
        return found

    def _settle(self, keys: Keys, slot: NDArray[np.intp], claims: NDArray[np.intp]) -> None:
        """Assign each claimed slot to one of its claimants."""
        places = slot[claims]
        self._slots[places] = keys[claims]
        winners = places[self._slots[places] == keys[claims]]
        self._numbers[winners] = -1 - np.arange(len(winners))  # equal keys overwrite each other, so one mark stays
        winners = winners[self._numbers[winners] == -1 - np.arange(len(winners))]
        numbers = np.arange(self._count, self._count + len(winners))
        self._numbers[winners] = numbers
        self._count += len(winners)
        if self._count > len(self._known):
            self._known = np.concatenate([self._known, np.empty(max(self._count, 1024), np.int64)])
        self._known[numbers] = self._slots[winners]

    def _first_slots(self, keys: Keys) -> NDArray[np.intp]:
        return ((keys.view(np.uint64) * SPREAD) >> np.uint64(64 - self._bits)).astype(np.intp)

    def _resize(self, bits: int) -> None:
        """Rehash all keys into a larger table."""
        self._bits = bits
        self._slots, self._numbers = np.full(1 << bits, FREE, np.int64), np.zeros(1 << bits, np.intp)
        keys, numbers = self.keys, np.arange(self._count)
        slot = self._first_slots(keys)
        while len(keys):
            free = self._slots[slot] == FREE
            self._slots[slot[free]] = keys[free]
            placed = self._slots[slot] == keys
            self._numbers[slot[placed]] = numbers[placed]
            keys, numbers, slot = keys[~placed], numbers[~placed], (slot[~placed] + 1) & (len(self._slots) - 1)
