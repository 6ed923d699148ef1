"""The reader against every way bytes can be cut, torn and dirtied."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocols.cb.frames import (
    MAX_PAYLOAD_BYTES,
    ChecksumFailed,
    Frame,
    FrameReader,
    FramingBroken,
    GarbageSkipped,
)
from tests.protocols.dirt import GARBAGE, MOVE
from tests.protocols.rows import ALL_ROWS, Row
from tests.support.cases import cases, long_enough_s

pytestmark = pytest.mark.timeout(long_enough_s())

each_row = pytest.mark.parametrize("row", ALL_ROWS, ids=lambda row: row.name)
both_modes = pytest.mark.parametrize("resynchronise", [False, True], ids=["strict", "resynchronising"])

PING = next(row.encoded for row in ALL_ROWS if row.name == "ping")
each_garbage = pytest.mark.parametrize("garbage", GARBAGE.values(), ids=GARBAGE.keys())


def frames(events):
    return [event for event in events if isinstance(event, Frame)]


def fed_byte_by_byte(reader, data):
    return [event for byte in data for event in reader.feed(bytes([byte]))]


@both_modes
@each_row
def test_a_frame_comes_out_whole_or_byte_by_byte(row: Row, resynchronise):
    whole = FrameReader(resynchronise=resynchronise).feed(row.encoded)
    pieces = fed_byte_by_byte(FrameReader(resynchronise=resynchronise), row.encoded)
    assert len(whole) == 1
    assert whole == pieces
    assert whole[0].encode() == row.encoded


@both_modes
def test_merged_segments_come_out_in_order(resynchronise):
    data = b"".join(row.encoded for row in ALL_ROWS)
    assert [f.encode() for f in FrameReader(resynchronise=resynchronise).feed(data)] == [r.encoded for r in ALL_ROWS]


@each_row
@each_garbage
def test_resynchronising_finds_a_frame_behind_garbage(row: Row, garbage):
    reader = FrameReader(resynchronise=True)
    events = reader.feed(garbage + row.encoded) + reader.abandon_half_frame()
    assert [frame.encode() for frame in frames(events)] == [row.encoded]
    assert sum(event.count for event in events if isinstance(event, GarbageSkipped)) == len(garbage)


@each_row
@each_garbage
def test_garbage_behind_a_frame_does_not_touch_it(row: Row, garbage):
    for resynchronise in (True, False):
        events = FrameReader(resynchronise=resynchronise).feed(row.encoded + garbage)
        assert isinstance(events[0], Frame)
        assert events[0].encode() == row.encoded


@each_garbage
def test_strict_breaks_at_garbage_and_stays_broken(garbage):
    reader = FrameReader(resynchronise=False)
    events = reader.feed(garbage + PING) + reader.abandon_half_frame()
    assert isinstance(events[-1], FramingBroken)
    assert frames(events) == []
    assert reader.feed(PING) == [events[-1]]
    assert reader.abandon_half_frame() == [events[-1]]


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"A", "expected the magic 43 42, got 41"),
        (b"\x43\x43", "expected the magic 43 42, got 43 43"),
        (b"HTTP/1.1 400", "expected the magic 43 42, got 48 54 (a web server answers there)"),
        (b"\x43\x42\x01\x01\x01\x00\x00\x00\xf5\x03", "1013 bytes is promised, at most 1012"),
        (PING[:-1] + b"\0", "checksum"),
    ],
    ids=["not a magic", "half a magic", "a web server", "too long", "wrong sum"],
)
def test_strict_says_what_broke(data, reason):
    broken = FrameReader(resynchronise=False).feed(data)[-1]
    assert isinstance(broken, FramingBroken)
    assert reason in broken.reason


def test_a_too_long_promise_breaks_before_its_payload_comes():
    assert FrameReader(resynchronise=False).feed(GARBAGE["a header that promises 65535 bytes"][:10]) != []


@both_modes
def test_the_longest_payload_passes(resynchronise):
    longest = Frame(3, 4, bytes(range(253)) * 4)
    assert len(longest.payload) == MAX_PAYLOAD_BYTES
    assert FrameReader(resynchronise=resynchronise).feed(longest.encode()) == [longest]


@both_modes
def test_a_magic_inside_a_payload_is_payload(resynchronise):
    tricky = Frame(3, 4, b"\x43\x42" * 30 + PING)
    assert FrameReader(resynchronise=resynchronise).feed(tricky.encode()) == [tricky]


def test_a_doubled_byte_costs_one_frame_only():
    reader = FrameReader(resynchronise=True)
    events = reader.feed(MOVE[:20] + MOVE[19:] + PING)
    assert [frame.encode() for frame in frames(events)] == [PING]
    assert ChecksumFailed(4, 65535) in events


def test_half_a_frame_is_reported_and_given_up():
    reader = FrameReader(resynchronise=True)
    assert reader.feed(MOVE[:33]) == []
    assert reader.half_frame_bytes == 33
    assert sum(event.count for event in reader.abandon_half_frame()) == 33
    assert reader.half_frame_bytes == 0
    assert reader.abandon_half_frame() == []
    assert frames(reader.feed(PING))[0].encode() == PING


def test_half_a_frame_given_up_on_tcp_breaks_the_stream():
    reader = FrameReader(resynchronise=False)
    reader.feed(MOVE[:33])
    assert reader.abandon_half_frame() == [FramingBroken("a frame stopped after 33 bytes")]


@settings(max_examples=cases(60), deadline=None)
@given(st.lists(st.sampled_from(ALL_ROWS), min_size=1, max_size=6), st.data())
def test_however_the_bytes_are_cut_the_same_frames_come(rows, data):
    stream = b"".join(row.encoded for row in rows)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    for resynchronise in (False, True):
        reader = FrameReader(resynchronise=resynchronise)
        events = [e for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True) for e in reader.feed(stream[a:b])]
        assert [frame.encode() for frame in events] == [row.encoded for row in rows]


chunks = st.one_of(st.just(1), st.integers(1, 50))
dirt = st.one_of(st.binary(max_size=40), st.sampled_from(list(GARBAGE.values())))


@settings(max_examples=cases(100), deadline=None)
@given(st.lists(st.tuples(dirt, st.sampled_from(ALL_ROWS)), min_size=1, max_size=5), chunks)
def test_garbage_between_frames_never_loses_a_good_one(pairs, chunk):
    stream = b"".join(garbage + row.encoded for garbage, row in pairs)
    reader = FrameReader(resynchronise=True)
    events = [event for k in range(0, len(stream), chunk) for event in reader.feed(stream[k : k + chunk])]
    events += reader.abandon_half_frame()
    found = [frame.encode() for frame in frames(events)]
    assert [encoded for encoded in found if encoded in {row.encoded for _, row in pairs}] == [
        r.encoded for _, r in pairs
    ]


@settings(max_examples=cases(100), deadline=None)
@given(st.binary(max_size=300), st.booleans())
def test_no_bytes_raise_anything(data, resynchronise):
    reader = FrameReader(resynchronise=resynchronise)
    reader.feed(data)
    reader.abandon_half_frame()
    assert reader.half_frame_bytes == 0
