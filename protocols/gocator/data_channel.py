"""Messages of the data channel (TCP port 3196) of Gocator line profilers, both ways: stamps and profiles.

Source: LMI Technologies, Gocator Line Profile Sensors User Manual, "Data Types" and "Data Results": a message is its
size (32u, itself included), a control word (16u: bit 15 marks the last message of a group, the rest is its type), and
content; all little endian. Stamp (type 1): count 32u at 6, size of a stamp 16u at 10, stamps from 14, each with its
frame index 64u at 0 and its time in µs 64u at 8. Profile point cloud (5) and uniform profile (6): count 32u at 8,
points a profile 32u at 12, scales of x and z 32u in nm at 16 and 20, offsets 32s in µm at 24 and 28; the values come
last, x and z (16s each) of every point, or z alone; -32768 where there is none. Firmware differs in the size of what
stands before the values, so they are counted from the message's end.
"""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

PORT = 3196
NO_VALUE = -32768
STAMP, POINT_CLOUD, UNIFORM = 1, 5, 6
VALUES_A_POINT = {POINT_CLOUD: 2, UNIFORM: 1}
LAST = 0x8000
MAX_MESSAGE_BYTES = 1 << 24
"""Of one message; a profile of 4,096 points has 16 kB, and sensors send up to some hundred profiles in one."""
MAX_MESSAGES = 256
"""Of one group."""

HEADER = struct.Struct("<IH")
STAMPS = struct.Struct("<IHBB")
ONE_STAMP = struct.Struct("<QQ40x")
PROFILE = struct.Struct("<HIIIIii16x")


class NotGocator(ValueError):
    """The bytes are not of a Gocator's data channel."""


@dataclass(frozen=True, slots=True)
class Stamp:
    """When a frame was taken, by the sensor's clock."""

    frame_index: int
    time_us: int


@dataclass(frozen=True, slots=True)
class RawProfiles:
    """`count` profiles of `width` points as they came: signed 16-bit `values`, (x, z) or z alone (`uniform`).

    mm = value * scale_nm * 1e-6 + offset_um * 1e-3; of uniform profiles x is the point's number times its scale.
    """

    uniform: bool
    count: int
    width: int
    x_scale_nm: int
    z_scale_nm: int
    x_offset_um: int
    z_offset_um: int
    values: bytes


@dataclass(frozen=True, slots=True)
class ProfileGroup:
    """Messages sent together: one stamp for each profile."""

    stamps: tuple[Stamp, ...]
    profiles: RawProfiles


class DataChannel:
    """Bytes in, groups with profiles out; messages of other types are passed over."""

    def __init__(self) -> None:
        self._bytes = bytearray()
        self._stamps: tuple[Stamp, ...] = ()
        self._profiles: RawProfiles | None = None
        self._messages = 0

    def receive(self, data: bytes) -> Iterator[ProfileGroup]:
        """The groups that end in `data`. Raises NotGocator; what follows is then lost."""
        self._bytes += data
        start = 0
        try:
            while len(self._bytes) - start >= HEADER.size:
                size, control = HEADER.unpack_from(self._bytes, start)
                if not HEADER.size <= size <= MAX_MESSAGE_BYTES:
                    raise NotGocator(f"a message of {size} bytes")
                if len(self._bytes) - start < size:
                    break
                self._take(control & ~LAST, bytes(self._bytes[start : start + size]))
                start += size
                if control & LAST and (group := self._end_group()):
                    yield group
        finally:
            del self._bytes[:start]

    def _take(self, kind: int, message: bytes) -> None:
        """Keep what a message says until its group ends; of several profile messages the first. Raises NotGocator."""
        self._messages += 1
        if self._messages > MAX_MESSAGES:
            raise NotGocator(f"a group of more than {MAX_MESSAGES} messages")
        if kind == STAMP:
            self._stamps = _stamps(message)
        elif kind in VALUES_A_POINT and self._profiles is None:
            self._profiles = _profiles(kind, message)

    def _end_group(self) -> ProfileGroup | None:
        stamps, profiles = self._stamps, self._profiles
        self._stamps, self._profiles, self._messages = (), None, 0
        if profiles is None:
            return None
        if len(stamps) != profiles.count:
            raise NotGocator(f"a group of {profiles.count} profiles and {len(stamps)} stamps")
        return ProfileGroup(stamps, profiles)


def encode(group: ProfileGroup) -> bytes:
    """The two messages of a group, as a sensor sends them."""
    stamps = b"".join(ONE_STAMP.pack(stamp.frame_index, stamp.time_us) for stamp in group.stamps)
    one, raw = STAMPS.pack(len(group.stamps), ONE_STAMP.size, 0, 0) + stamps, group.profiles
    attributes = PROFILE.pack(
        PROFILE.size - 2, raw.count, raw.width, raw.x_scale_nm, raw.z_scale_nm, raw.x_offset_um, raw.z_offset_um
    )
    return _message(STAMP, one) + _message(LAST | (UNIFORM if raw.uniform else POINT_CLOUD), attributes + raw.values)


def _message(control: int, content: bytes) -> bytes:
    return HEADER.pack(HEADER.size + len(content), control) + content


def _stamps(message: bytes) -> tuple[Stamp, ...]:
    start = HEADER.size + STAMPS.size
    if len(message) < start:
        raise NotGocator("a stamp message that is too short")
    count, size, _, _ = STAMPS.unpack_from(message, HEADER.size)
    if size < ONE_STAMP.size or len(message) != start + count * size:
        raise NotGocator(f"a stamp message of {len(message)} bytes with {count} stamps of {size} bytes")
    pairs: Sequence[tuple[int, int]] = [ONE_STAMP.unpack_from(message, start + n * size) for n in range(count)]
    return tuple(Stamp(*pair) for pair in pairs)


def _profiles(kind: int, message: bytes) -> RawProfiles:
    start = HEADER.size + PROFILE.size - 16  # what stands before the values differs from here on
    if len(message) < start:
        raise NotGocator("a profile message that is too short")
    _, count, width, x_scale, z_scale, x_offset, z_offset = struct.unpack_from("<HIIIIii", message, HEADER.size)
    length = 2 * VALUES_A_POINT[kind] * count * width
    if len(message) < start + length:
        raise NotGocator(f"a profile message of {len(message)} bytes with {count} profiles of {width} points")
    values = message[len(message) - length :]
    return RawProfiles(kind == UNIFORM, count, width, x_scale, z_scale, x_offset, z_offset, values)
