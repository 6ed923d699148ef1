"""The sessions of both ends behind lines that cut, drop and add bytes."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocols.cb.client import ReplyReceived
from protocols.cb.codes import SessionState
from protocols.cb.controller import BadChecksum, RequestReceived
from protocols.cb.frames import GarbageSkipped
from protocols.cb.layouts import REQUESTS
from protocols.cb.messages import SetArmed
from tests.protocols.dirt import GARBAGE
from tests.protocols.rows import REQUEST_ROWS
from tests.protocols.session_pairs import ANSWER_OF, HELLO, asked, greeted_pair, welcome
from tests.support.cases import cases, long_enough_s

pytestmark = pytest.mark.timeout(long_enough_s())


conversations = st.lists(st.sampled_from([*REQUESTS.values()]), min_size=1, max_size=6)
messages = {type(row.message): row.message for row in REQUEST_ROWS}
dirt = st.one_of(st.binary(max_size=12), st.sampled_from([*GARBAGE.values()]))
chunks = st.one_of(st.just(1), st.integers(1, 90))


def fed(end, line, chunk):
    """The line in pieces, then silence: a false frame start waits for bytes that never come."""
    events = [event for k in range(0, len(line), chunk) for event in end.receive_data(line[k : k + chunk])]
    return events + end.abandon_half_frame()


@settings(max_examples=cases(60), deadline=None)
@given(conversations, chunks, st.data())
def test_a_conversation_survives_cutting_and_dirt_on_a_serial_line(kinds, chunk, data):
    client, controller = greeted_pair(resynchronise=True)
    for kind in kinds:
        if client.state is not SessionState.GREETED:
            asked(client, controller, HELLO, welcome())
        message = messages[kind]
        heard = fed(controller, data.draw(dirt) + client.request(message), chunk)
        (received,) = (event for event in heard if not isinstance(event, BadChecksum | GarbageSkipped))
        assert received == RequestReceived(client.last_seq, message)
        answered = fed(client, data.draw(dirt) + controller.reply(received.seq, ANSWER_OF[kind]), chunk)
        assert answered.count(ReplyReceived(client.last_seq, message, ANSWER_OF[kind])) == 1


@settings(max_examples=cases(100), deadline=None)
@given(st.binary(max_size=200))
def test_no_bytes_raise_anything_at_either_end(data):
    for resynchronise in (False, True):
        client, controller = greeted_pair(resynchronise=resynchronise)
        client.request(SetArmed(9, True))
        for end in (client, controller):
            end.receive_data(data)
            end.abandon_half_frame()
