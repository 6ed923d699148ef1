"""Answers and samples that are late, lost, doubled or swapped never become a wrong value, on any line we speak."""

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocols.cb.client import ClientSession, ReplyReceived
from protocols.cb.codes import REPLY_BIT, Capability, Command, Status
from protocols.cb.frames import Frame
from protocols.cb.layouts import pack
from protocols.cb.messages import GetPose, Hello, Pose, Welcome
from protocols.modbus.bank import Identification, respond
from protocols.modbus.bit_reader import AnswerKind, BitReader
from protocols.modbus.client_framing import ClientFraming, RtuFraming, TcpFraming
from protocols.modbus.codes import Function
from protocols.modbus.mbap import Adu, MbapReader
from protocols.plc.bank import PlcBank
from protocols.plc.codes import TRIGGERS, ControlBit
from protocols.plc.events import CellStatus, Effect, HandshakeEvent, RegistersWritten, StartAccepted, StartCommand
from protocols.plc.handshake import Handshake, Phase, Rules, react, register_image
from tests.protocols.line_trouble import (
    BUSY,
    CARRY,
    COUNTER_BITS,
    DEVICES,
    GIVE_UP,
    IN_ANY_ORDER,
    TICK,
    CountingDevice,
    Line,
    device_of,
)
from tests.protocols.rows import NO_AXES, STANDS
from tests.support.cases import cases, long_enough_s

pytestmark = [pytest.mark.timeout(4 * long_enough_s()), pytest.mark.slow]

UNIT = 3
INPUTS = Function.READ_DISCRETE_INPUTS
in_any_order = st.lists(IN_ANY_ORDER, max_size=150)


# --- interlocks ---


class Cell:
    """A reader of the counter, its device, and the bytes between them."""

    def __init__(self, framing: ClientFraming, device: CountingDevice) -> None:
        self.framing, self.device = framing, device
        numbered = isinstance(framing, TcpFraming)
        self.reader = BitReader([(INPUTS, address) for address in range(COUNTER_BITS)], numbered)
        self.there, self.back = Line(), Line()
        self.begun: int | None = None
        self.readings = 0

    def step(self, what: str) -> None:
        if self.begun is None:
            self.begun = self.device.counter
            self.reader.begin()
            self._ask()
        if what == TICK:
            self.device.counter += 1
        elif what == BUSY:
            self.device.busy = True
        elif what == GIVE_UP:
            self.begun = None
        elif what != CARRY:
            (self.back if self.back.waiting else self.there).trouble(what)
        elif self.back.waiting:
            for pdu in self.framing.feed(self.back.waiting.popleft()):
                if self.reader.receive(pdu) is AnswerKind.AWAITED:
                    self._ask()
        elif self.there.waiting:
            self._answer(self.there.waiting.popleft())

    def _ask(self) -> None:
        request = self.reader.request()
        if request is not None:
            self.there.waiting.append(self.framing.encode(request))
            return
        if self.reader.bits:
            value = sum(value << address for (_, address), value in self.reader.bits.items())
            assert self.begun is not None
            assert self.begun < value <= self.device.counter
            self.readings += 1
        self.begun = None

    def _answer(self, request: bytes) -> None:
        """What the device makes of a frame."""
        if isinstance(self.framing, RtuFraming):
            answer = self.answer(request[1:-2])
        else:
            (adu,) = MbapReader().feed(request)
            pdu = self.device.answer(adu.pdu)
            answer = pdu and Adu(adu.transaction, adu.unit, pdu).encode()
        if answer:
            self.back.waiting.append(answer)

    def answer(self, pdu: bytes) -> bytes:
        """A frame for an RTU line; empty: the device does not answer."""
        answer = self.device.answer(pdu)
        return RtuFraming(UNIT).encode(answer) if answer else b""


stale_lengths = st.lists(st.sampled_from([16, 24, 32, 40]), max_size=2, unique=True)
names = st.sampled_from(sorted(DEVICES))


@settings(max_examples=cases(300), deadline=None)
@given(names, in_any_order, stale_lengths, st.integers(1, 3))
def test_interlocks_over_rtu(name: str, steps: list[str], stale: list[int], times: int) -> None:
    """A wire may begin with answers to a former process, a gateway may swap them; read again when trouble ends."""
    cell = Cell(RtuFraming(UNIT), device_of(name))
    if cell.device.size >= 40:
        for length in stale:
            cell.back.waiting.extend(times * [cell.answer(struct.pack(">BHH", INPUTS, 0, length))])
    for what in steps:
        cell.step(what)
    before, attempts = cell.readings, 0
    while cell.device.refuses and cell.readings == before:
        attempts += 1
        assert attempts < 30
        for what in [*20 * [CARRY], GIVE_UP]:
            cell.step(what)


@settings(max_examples=cases(200), deadline=None)
@given(names, in_any_order)
def test_interlocks_over_tcp(name: str, steps: list[str]) -> None:
    cell = Cell(TcpFraming(UNIT), device_of(name))
    for what in steps:
        cell.step(what)


@settings(max_examples=cases(200), deadline=None)
@given(st.binary(max_size=80), st.lists(st.integers(1, 12), min_size=1))
def test_frames_are_found_behind_whatever_the_line_brings(dirt: bytes, pieces: list[int]) -> None:
    pdu = b"\x02\x02\x12\x34"
    line, framing, found = dirt + RtuFraming(UNIT).encode(pdu), RtuFraming(UNIT), []
    while line:
        piece, line = line[: pieces[0]], line[pieces[0] :]
        pieces = [*pieces[1:], pieces[0]]
        found += framing.feed(piece)
    assert found[-1:] == [pdu]


# --- the CB link ---


def pose_of(count: int) -> Pose:
    """A pose that shows which request it answers."""
    return Pose((float(count), 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0, 0, 0, 0), NO_AXES, 0, STANDS)


@settings(max_examples=cases(200), deadline=None)
@given(in_any_order, st.booleans(), st.integers(0, 65535))
def test_poses_of_the_cb_link(steps: list[str], resynchronise: bool, last_seq: int) -> None:
    """What is received as the answer to a request was made for that request, after it was made."""
    client = ClientSession(resynchronise=resynchronise, last_seq=last_seq)
    client.request(Hello(1, 1, 7))
    welcome = pack(Welcome(1, Capability(7), 9, 1, 1024, 6))
    client.receive_data(Frame(Command.HELLO | REPLY_BIT, client.last_seq, welcome, Status.OK).encode())
    there, back, counter, begun = Line(), Line(), 0, None
    for what in steps:
        if begun is None:
            begun = counter
            there.waiting.append(client.request(GetPose()))
        if what == TICK:
            counter += 1
        elif what == BUSY:
            there.waiting.append(client.repeat())
        elif what == GIVE_UP:
            client.abandon()
            begun = None
        elif what != CARRY:
            (back if back.waiting else there).trouble(what)
        elif back.waiting:
            for event in client.receive_data(back.waiting.popleft()):
                if isinstance(event, ReplyReceived):
                    assert isinstance(event.reply, Pose)
                    assert begun < event.reply.position_mm[0] <= counter
                    begun = None
        elif there.waiting:
            counter += 1
            seq = int.from_bytes(there.waiting.popleft()[4:6], "little")
            back.waiting.append(Frame(Command.GET_POSE | REPLY_BIT, seq, pack(pose_of(counter)), Status.OK).encode())


# --- the PLC's registers ---

WORDS = st.sampled_from([0, *TRIGGERS, ControlBit.ABORT, ControlBit.RESULTS_ACK, ControlBit.CLEAR_ERROR])


class Plc:
    """The registers behind Modbus requests; a command that is begun is accepted at once."""

    def __init__(self) -> None:
        self.state = Handshake(Rules(motion_allowed=True))
        self.effects: list[Effect] = []
        self.take(CellStatus(ready=True, in_force=True))

    def take(self, event: HandshakeEvent) -> None:
        reaction = react(self.state, event)
        self.state = reaction.state
        self.effects += reaction.effects
        if any(isinstance(effect, StartCommand) for effect in reaction.effects):
            self.take(StartAccepted())

    def request(self, pdu: bytes) -> bytes:
        bank = PlcBank(
            lambda: register_image(self.state), lambda words, _: self.take(RegistersWritten(words)), may_write=True
        )
        return respond(pdu, bank, Identification("v", "p", "1"))


writes = st.lists(
    st.one_of(
        WORDS.map(lambda word: struct.pack(">BHH", Function.WRITE_REGISTER, 0, int(word))),
        WORDS.map(lambda word: struct.pack(">BHHBHH", Function.WRITE_REGISTERS, 0, 2, 4, int(word), 7)),
        WORDS.map(lambda word: struct.pack(">BHHH", Function.MASK_WRITE_REGISTER, 0, 0, int(word))),
        st.tuples(st.integers(0, 6), st.booleans()).map(
            lambda bit: struct.pack(">BHH", Function.WRITE_COIL, bit[0], 0xFF00 if bit[1] else 0)
        ),
    ),
    max_size=10,
)


@settings(max_examples=cases(200), deadline=None)
@given(writes, st.data())
def test_a_request_that_comes_several_times_is_done_once(requests: list[bytes], data: st.DataObject) -> None:
    """Triggers, aborts and acknowledgements are edges: the same value once more is none."""
    once, often = Plc(), Plc()
    for pdu in requests:
        answer = once.request(pdu)
        for _ in range(data.draw(st.integers(1, 3))):
            assert often.request(pdu) == answer
        assert (once.state, once.effects) == (often.state, often.effects)
    assert once.state.phase in (Phase.IDLE, Phase.RUNNING)
