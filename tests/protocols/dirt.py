"""What a line brings that belongs to no frame."""

from tests.protocols.rows import ALL_ROWS

MOVE = next(row.encoded for row in ALL_ROWS if row.name == "move")
GARBAGE = {
    "a zero": b"\0",
    "half a magic": b"\x43",
    "a magic": b"\x43\x42",
    "three halves": b"\x43\x42\x43",
    "twenty magics": b"\x43\x42" * 20,
    "a header that promises 1012 bytes": b"\x43\x42\x01\x04\x01\x00\x00\x00\xf4\x03\x00\x00",
    "a header that promises 65535 bytes": b"\x43\x42\x01\x04\x01\x00\x00\x00\xff\xff\x00\x00",
    "half a move": MOVE[:40],
    "a move without its last byte": MOVE[:-1],
    "a move with a flipped bit": MOVE[:30] + bytes([MOVE[30] ^ 4]) + MOVE[31:],
    "text": b"ABB IRC5 ready\r\n",
    "a break": b"\0" * 50,
}
