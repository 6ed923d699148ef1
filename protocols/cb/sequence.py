"""Sequence numbers of requests: 1 to 65535, cyclic; 0 marks what a controller sends unasked."""

from protocols.counter import MAX_COUNT


def is_older(seq: int, last: int) -> bool:
    """Whether `seq` lies in the half circle before `last`: such a request was delayed and must not be executed."""
    return (seq - last) % MAX_COUNT > MAX_COUNT // 2
