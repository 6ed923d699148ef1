"""Sequence numbers of requests: 1 to 65535, cyclic; 0 marks what a controller sends unasked."""

MAX_SEQ = 65535


def next_seq(seq: int) -> int:
    """The number after `seq`, skipping 0."""
    return seq % MAX_SEQ + 1


def is_older(seq: int, last: int) -> bool:
    """Whether `seq` lies in the half circle before `last`: such a request was delayed and must not be executed."""
    return (seq - last) % MAX_SEQ > MAX_SEQ // 2
