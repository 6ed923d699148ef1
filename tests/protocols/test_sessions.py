"""The sessions of both ends: every state with every command and event, numbers, repeats, and dirt on the line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols.cb.client import (
    ClientSession,
    GarbledReply,
    GreetingLost,
    RepeatWanted,
    ReplyReceived,
    UnexpectedReply,
    Unsolicited,
)
from protocols.cb.codes import ALLOWED_COMMANDS, STATE_AFTER, Command, SessionState, Status
from protocols.cb.controller import (
    BadChecksum,
    ControllerSession,
    DuplicateAnswered,
    DuplicatePending,
    RequestReceived,
    RequestRejected,
    is_older,
)
from protocols.cb.errors import NotAllowedNow, NothingToAnswer, RequestOutstanding
from protocols.cb.frames import ChecksumFailed, Frame, FramingBroken, GarbageSkipped
from protocols.cb.layouts import COMMAND_OF
from protocols.cb.messages import (
    Bye,
    Farewell,
    GetPose,
    GetStatus,
    Hello,
    MoveAccepted,
    Ping,
    Pong,
    Refused,
    Stop,
    Stopped,
)
from protocols.counter import next_count
from tests.protocols.rows import REQUEST_ROWS, Row
from tests.protocols.session_pairs import ANSWER_OF, HELLO, MOVE, REPORT, asked, greeted_pair, welcome
from tests.support.cases import long_enough_s

pytestmark = pytest.mark.timeout(long_enough_s())

# --- what is allowed when ---


def controller_in(state):
    if state is SessionState.GREETED:
        return greeted_pair()[1]
    controller = ControllerSession(resynchronise=False)
    if state is SessionState.BROKEN:
        controller.receive_data(b"dirt")
    return controller


@pytest.mark.parametrize("state", SessionState)
@pytest.mark.parametrize("row", REQUEST_ROWS, ids=lambda row: row.name)
def test_a_controller_hands_up_what_its_state_allows(state, row: Row):
    controller = controller_in(state)
    assert controller.state is state
    (event,) = controller.receive_data(Frame(row.encoded[3], 400, row.encoded[12:]).encode())
    if row.encoded[3] in ALLOWED_COMMANDS[state]:
        assert event == RequestReceived(400, row.message)
    elif state is SessionState.BROKEN:
        assert isinstance(event, FramingBroken)
    else:
        assert isinstance(event, RequestRejected)
        assert event.status is Status.VERSION
    assert controller.state is state


def client_in(state):
    if state is SessionState.GREETED:
        return greeted_pair()[0]
    client = ClientSession(resynchronise=False)
    if state is SessionState.BROKEN:
        client.receive_data(b"dirt")
    return client


@pytest.mark.parametrize("state", SessionState)
@pytest.mark.parametrize("row", REQUEST_ROWS, ids=lambda row: row.name)
def test_a_client_sends_what_its_state_allows(state, row: Row):
    client = client_in(state)
    assert client.state is state
    if row.encoded[3] in ALLOWED_COMMANDS[state]:
        assert client.request(row.message)[3] == row.encoded[3]
    else:
        with pytest.raises(NotAllowedNow, match=state.value):
            client.request(row.message)


@pytest.mark.parametrize("row", REQUEST_ROWS, ids=lambda row: row.name)
def test_every_request_gets_its_answer(row: Row):
    client, controller = greeted_pair()
    answer = ANSWER_OF[type(row.message)]
    events = asked(client, controller, row.message, answer)
    assert events[-1] == ReplyReceived(2, row.message, answer)
    assert client.outstanding_seq is None
    assert client.state is controller.state is STATE_AFTER.get(COMMAND_OF[type(row.message)], SessionState.GREETED)


@pytest.mark.parametrize("status", [s for s in Status if s > Status.ACCEPTED and s is not Status.BAD_SUM])
def test_every_refusal_arrives_with_its_status(status):
    client, controller = greeted_pair()
    assert asked(client, controller, MOVE, Refused(status))[-1] == ReplyReceived(2, MOVE, Refused(status))


def test_after_bye_both_ends_want_a_hello():
    client, controller = greeted_pair()
    asked(client, controller, Bye(), Farewell())
    assert client.state is controller.state is SessionState.NOT_GREETED


def test_a_hello_answered_after_the_framing_broke_does_not_greet():
    client, controller = ClientSession(resynchronise=False), ControllerSession(resynchronise=False)
    controller.receive_data(client.request(HELLO) + b"dirt")
    controller.reply(client.last_seq, welcome(9))
    assert controller.state is SessionState.BROKEN


def test_a_refused_hello_does_not_greet():
    client, controller = ClientSession(resynchronise=False), ControllerSession(resynchronise=False)
    asked(client, controller, HELLO, Refused(Status.BUSY))
    assert client.state is controller.state is SessionState.NOT_GREETED


# --- numbers ---


def test_numbers_go_round_and_leave_zero_out():
    client = ClientSession(resynchronise=False, last_seq=65534)
    numbers = []
    for _ in range(3):
        client.request(Ping())
        numbers.append(client.last_seq)
        client.abandon()
    assert numbers == [65535, 1, 2]


@given(st.integers(1, 65535), st.integers(1, 32767))
def test_what_follows_is_never_older(last, steps):
    seq = last
    for _ in range(min(steps, 3)):
        seq = next_count(seq)
    assert 1 <= seq <= 65535
    assert not is_older(seq, last)
    assert is_older(last, seq)


def test_the_second_request_waits_for_the_first():
    client, _ = greeted_pair()
    client.request(GetPose())
    with pytest.raises(RequestOutstanding, match="STATUS while 2"):
        client.request(GetStatus())


def test_a_stop_overtakes_and_the_overtaken_request_is_never_repeated():
    client, controller = greeted_pair()
    controller.receive_data(client.request(MOVE))
    (stop,) = controller.receive_data(client.request(Stop()))
    late = controller.reply(2, MoveAccepted())
    assert client.receive_data(late) == [UnexpectedReply(2, 0x84)]
    assert client.repeat()[3] == Command.STOP
    assert client.receive_data(controller.reply(stop.seq, Stopped())) == [ReplyReceived(3, Stop(), Stopped())]


# --- repeats ---


def test_a_repeated_move_is_answered_again_and_not_done_again():
    client, controller = greeted_pair()
    sent = client.request(MOVE)
    controller.receive_data(sent)
    lost = controller.reply(2, MoveAccepted())
    assert client.repeat() == sent
    assert controller.receive_data(client.repeat()) == [DuplicateAnswered(2, lost)]
    assert client.receive_data(lost) == [ReplyReceived(2, MOVE, MoveAccepted())]
    assert client.receive_data(lost) == [UnexpectedReply(2, 0x84)]


def test_a_repeat_before_the_reply_is_not_handed_up():
    client, controller = greeted_pair()
    sent = client.request(GetPose())
    controller.receive_data(sent)
    assert controller.receive_data(sent) == [DuplicatePending(2)]


def test_the_same_number_with_other_content_is_refused():
    client, controller = greeted_pair()
    asked(client, controller, MOVE, MoveAccepted())
    other = Frame(Command.PING, 2).encode()
    (refused,) = controller.receive_data(other)
    assert refused.status is Status.DUPLICATE_SEQ_DIFFERENT_PAYLOAD


def test_a_delayed_request_is_not_done():
    client, controller = greeted_pair()
    delayed = client.request(MOVE)
    asked(client, controller, Stop(), Stopped())
    (refused,) = controller.receive_data(delayed)
    assert refused.status is Status.DUPLICATE_SEQ_DIFFERENT_PAYLOAD


def test_a_new_hello_begins_a_new_order_of_numbers():
    client, controller = greeted_pair()
    for _ in range(5):
        asked(client, controller, Ping(), Pong())
    restarted = ClientSession(resynchronise=False)
    asked(restarted, controller, Hello(1, 1, 8), welcome())
    asked(restarted, controller, GetStatus(), REPORT)


def test_a_reply_nobody_waits_for_is_our_own_mistake():
    _, controller = greeted_pair()
    for reply in (Pong(), Refused(Status.BUSY)):
        with pytest.raises(NothingToAnswer):
            controller.reply(1, reply)


def test_a_wrong_kind_of_answer_is_our_own_mistake():
    client, controller = greeted_pair()
    controller.receive_data(client.request(GetPose()))
    with pytest.raises(NothingToAnswer, match="Pong does not answer GET_POSE"):
        controller.reply(2, Pong())
    with pytest.raises(NothingToAnswer, match="no request"):
        ClientSession(resynchronise=False).repeat()


# --- what a controller refuses by itself ---


@pytest.mark.parametrize(
    ("frame", "status"),
    [
        (Frame(77, 5), Status.UNKNOWN_CMD),
        (Frame(0, 5), Status.UNKNOWN_CMD),
        (Frame(0x81, 5), Status.UNKNOWN_CMD),
        (Frame(Command.MOVE, 5, b"\0" * 67), Status.BAD_LEN),
        (Frame(Command.PING, 5, b"\0"), Status.BAD_LEN),
        (Frame(Command.GET_POSE, 5, b"\x07\x00"), Status.BAD_FIELD),
        (Frame(Command.PING, 0), Status.BAD_FIELD),
        (Frame(Command.PING, 5, version=2), Status.VERSION),
        (Frame(Command.HELLO, 5, b"\x02\x00\x03\x00\x07\x00\x00\x00"), Status.VERSION),
    ],
    ids=["command 77", "command 0", "a reply", "short move", "long ping", "frame 7", "seq 0", "version 2", "hello 2-3"],
)
def test_a_controller_refuses_by_itself(frame, status):
    client, controller = greeted_pair()
    (refused,) = controller.receive_data(frame.encode())
    assert isinstance(refused, RequestRejected)
    assert refused.status is status
    assert refused.answer[4:8] == frame.seq.to_bytes(2, "little") + status.to_bytes(2, "little")
    assert asked(client, controller, GetStatus(), REPORT), "the session goes on"


def test_an_unwanted_client_is_refused_whatever_it_asks():
    controller = ControllerSession(resynchronise=False, refuse_with=Status.BUSY)
    client = ClientSession(resynchronise=False)
    (refused,) = controller.receive_data(client.request(HELLO))
    assert client.receive_data(refused.answer) == [ReplyReceived(1, HELLO, Refused(Status.BUSY))]


def test_a_wrong_sum_is_answered_and_the_client_repeats():
    client, controller = greeted_pair(resynchronise=True)
    sent = client.request(MOVE)
    bad, *rest = controller.receive_data(sent[:30] + bytes([sent[30] ^ 1]) + sent[31:])
    assert isinstance(bad, BadChecksum)
    assert all(isinstance(event, GarbageSkipped) for event in rest)
    assert client.receive_data(bad.answer) == [RepeatWanted(2)]
    assert controller.receive_data(client.repeat()) == [RequestReceived(2, MOVE)]


def test_a_wrong_sum_on_tcp_is_answered_and_breaks():
    client, controller = greeted_pair()
    sent = client.request(MOVE)
    bad, broken = controller.receive_data(sent[:-1] + b"\x55")
    assert isinstance(bad, BadChecksum)
    assert isinstance(broken, FramingBroken)
    assert controller.state is SessionState.BROKEN


# --- what a client notices ---


def test_a_controller_that_restarted_behind_a_serial_line_wants_a_greeting():
    client, _ = greeted_pair(resynchronise=True)
    restarted = ControllerSession(resynchronise=True)
    (refused,) = restarted.receive_data(client.request(GetPose()))
    assert client.receive_data(refused.answer)[0] == GreetingLost()
    assert client.state is SessionState.NOT_GREETED
    assert asked(client, restarted, HELLO, welcome(10))[0] == ReplyReceived(3, HELLO, welcome(10))
    assert client.session == 10


def test_what_the_controller_says_by_itself():
    client, controller = greeted_pair()
    client.request(GetPose())
    assert client.receive_data(controller.announce(REPORT)) == [Unsolicited(REPORT, Command.STATUS)]
    assert client.outstanding_seq == 2


@pytest.mark.parametrize(
    ("frame", "event"),
    [
        (Frame(0x83, 3, b""), UnexpectedReply(3, 0x83)),
        (Frame(0x86, 2, b"\0" * 12), UnexpectedReply(2, 0x86)),
        (Frame(0x83, 2, b"\0" * 67), GarbledReply(2, "this is no Pose: 67 bytes instead of 68")),
        (Frame(0x83, 2, b"\0" * 68, status=1), GarbledReply(2, "this is no Pose: it came with status 1")),
        (Frame(0x83, 2, b"\0", status=6), GarbledReply(2, "this is no Pose: a refusal with 1 bytes of payload")),
        (Frame(0x03, 2, b"\0\0"), GarbledReply(2, "0x03 is no reply")),
        (Frame(0xF0, 2), GarbledReply(2, "0xf0 is no reply")),
        (Frame(0x83, 2, b"", version=3), GarbledReply(2, "its version is 3, not 1")),
    ],
    ids=["late", "other command", "short", "other status", "refusal with payload", "a request", "unknown", "version 3"],
)
def test_an_answer_that_is_none_leaves_the_request_outstanding(frame, event):
    client, _ = greeted_pair()
    client.request(GetPose())
    assert client.receive_data(frame.encode()) == [event]
    assert client.outstanding_seq == 2


def test_a_reply_with_a_wrong_sum_breaks_tcp_and_not_serial():
    for resynchronise, ends in ((False, FramingBroken), (True, GarbageSkipped)):
        client, controller = greeted_pair(resynchronise=resynchronise)
        controller.receive_data(client.request(GetStatus()))
        reply = controller.reply(2, REPORT)
        first, last = client.receive_data(reply[:-1] + b"\x99")[:2]
        assert first == ChecksumFailed(0x86, 2)
        assert isinstance(last, ends)


def test_half_a_reply_is_given_up_and_asked_again():
    client, controller = greeted_pair(resynchronise=True)
    controller.receive_data(client.request(GetStatus()))
    reply = controller.reply(2, REPORT)
    assert client.receive_data(reply[:15]) == []
    assert client.half_frame_bytes == 15
    assert client.abandon_half_frame() == [GarbageSkipped(15)]
    (again,) = controller.receive_data(client.repeat())
    assert client.receive_data(again.answer) == [ReplyReceived(2, GetStatus(), REPORT)]
