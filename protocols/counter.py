"""Counters of one 16-bit word: 1 to 65535, cyclic; 0 means that nothing has been counted yet."""

MAX_COUNT = 65535


def next_count(count: int) -> int:
    """The number after `count`, skipping 0."""
    return count % MAX_COUNT + 1
