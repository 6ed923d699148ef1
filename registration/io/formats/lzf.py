"""Decompresses LZF (Lehmann), used by PCD `DATA binary_compressed`, in bounded memory."""

from collections.abc import Callable, Iterator

WINDOW = 1 << 13
"""Longest distance of a back reference."""

FLUSH = 1 << 18


class LzfDamaged(Exception):
    """`position` in the compressed bytes of a truncated token or of a reference before the start."""

    def __init__(self, position: int) -> None:
        self.position = position
        super().__init__(f"damaged at byte {position}")


def decompress(read: Callable[[int], bytes], length: int) -> Iterator[bytes]:
    """Decompress `length` bytes, in pieces. `read(n)` returns at most n bytes. Raises LzfDamaged."""
    pending, window, done = b"", b"", 0
    while done < length:
        more = read(min(FLUSH, length - done - len(pending)))
        pending += more
        complete = done + len(pending) == length
        if not more and not complete:
            raise LzfDamaged(done + len(pending))
        used, out = _expand(pending, window, complete, done)
        yield out[len(window) :]
        window, pending, done = out[-WINDOW:], pending[used:], done + used


def _expand(data: bytes, window: bytes, last: bool, base: int) -> tuple[int, bytes]:
    """Expand complete tokens of `data`: (bytes used, `window` with the output appended)."""
    out = bytearray(window)
    position, end = 0, len(data)
    safe = end if last else end - 34
    while position < safe:
        control = data[position]
        if control < 32:
            stop = position + control + 2
            if stop > end:
                raise LzfDamaged(base + position)
            out += data[position + 1 : stop]
            position = stop
            continue
        size, start = control >> 5, position
        position += 1
        if size == 7:
            if position >= end:
                raise LzfDamaged(base + start)
            size += data[position]
            position += 1
        if position >= end:
            raise LzfDamaged(base + start)
        back = ((control & 31) << 8) + data[position] + 1
        position += 1
        size += 2
        source = len(out) - back
        if source < 0:
            raise LzfDamaged(base + start)
        if back >= size:
            out += out[source : source + size]
        else:
            out += (out[source:] * (size // back + 1))[:size]
    return position, bytes(out)
