"""Sequence numbers: 1 to 65535 in a circle; 0 is reserved for what a controller says by itself."""

SEQ_MAX = 65535


def following(seq: int) -> int:
    """The number after `seq`, 0 left out."""
    return seq % SEQ_MAX + 1


def is_older(seq: int, last: int) -> bool:
    """Does `seq` lie in the half circle before `last`? Such a request was delayed on the way: it must not be done."""
    return (seq - last) % SEQ_MAX > SEQ_MAX // 2
