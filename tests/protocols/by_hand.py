"""A second encoder, written from the tables of docs/cb-link.md alone; shares no code with protocols/."""

from collections.abc import Iterable

import numpy as np

CODES = {"u16": "<u2", "i16": "<i2", "u32": "<u4", "f32": "<f4", "u8": "u1"}

ROWS: dict[str, tuple[int, str]] = {
    "ping": (1, ""),
    "hello": (2, "u16 u16 u16 u16"),
    "get pose": (3, "u16"),
    "move": (4, "f32 " * 7 + "i16 " * 4 + "f32 " * 6 + "f32 u16 u16"),
    "stop": (5, ""),
    "status": (6, ""),
    "arm": (7, "u16 u16"),
    "get joints": (8, ""),
    "bye": (9, ""),
    "move joints": (10, "f32 " * 13),
    "get error": (11, ""),
    "set output": (12, "u16 u16"),
    "get setup": (13, ""),
    "pong": (0x81, ""),
    "welcome": (0x82, "u16 " * 6),
    "pose": (0x83, "f32 " * 7 + "i16 " * 4 + "f32 " * 6 + "u32 u16 u16"),
    "accepted": (0x84, ""),
    "stopped": (0x85, ""),
    "report": (0x86, "u16 u16 u16 u16 u32"),
    "arming done": (0x87, ""),
    "joints": (0x88, "f32 " * 12),
    "farewell": (0x89, ""),
    "joint move accepted": (0x8A, ""),
    "error": (0x8B, "u32 " + "u8 " * 160),
    "output done": (0x8C, ""),
    "setup": (0x8D, "f32 " * 13),
}
"""Command number and payload layout of every message."""


def checksum(data: bytes) -> int:
    """Fletcher-16 in closed form: the plain sum, and the sum weighted by the distance from the end."""
    plain = sum(data) % 255
    weighted = sum((len(data) - k) * byte for k, byte in enumerate(data)) % 255
    return weighted * 256 + plain


def frame(name: str, seq: int, values: Iterable[float] = (), status: int = 0) -> bytes:
    """The bytes of a message as the tables say it."""
    command, layout = ROWS[name]
    codes = layout.split()
    numbers = list(values)
    assert len(codes) == len(numbers), f"{name} has {len(codes)} values"
    payload = b"".join(np.array(v).astype(CODES[code]).tobytes() for code, v in zip(codes, numbers, strict=True))
    head = bytes([0x43, 0x42, 1, command])
    for number in (seq, status, len(payload)):
        head += bytes([number % 256, number // 256])
    total = checksum(head + payload)
    return head + bytes([total % 256, total // 256]) + payload
