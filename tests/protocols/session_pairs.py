"""A client and a controller session that have greeted each other, and one request there and back."""

from protocols.cb.client import ClientSession
from protocols.cb.codes import Capability, Flag, MoveKind, Status
from protocols.cb.controller import ControllerSession, RequestReceived
from protocols.cb.messages import Hello, Move, Report, Welcome
from tests.protocols.rows import FLANGE, NO_AXES, REPLY_ROWS, REQUEST_ROWS

HELLO = Hello(1, 1, 7)
MOVE = Move(*FLANGE, NO_AXES, 100.0, MoveKind.JOINT)
REPORT = Report(Flag.AUTO, 3, Status.OK, 1000, 5)
ANSWER_OF = {type(q.message): a.message for q, a in zip(REQUEST_ROWS, REPLY_ROWS, strict=True)}


def welcome(session=9):
    return Welcome(1, Capability(7), session, 1, 1024, 6)


def greeted_pair(*, resynchronise=False, session=9):
    client, controller = ClientSession(resynchronise=resynchronise), ControllerSession(resynchronise=resynchronise)
    (hello,) = controller.receive_data(client.request(HELLO))
    client.receive_data(controller.reply(hello.seq, welcome(session)))
    return client, controller


def asked(client, controller, message, answer):
    """One request, there and back."""
    (received,) = controller.receive_data(client.request(message))
    assert received == RequestReceived(client.last_seq, message)
    return client.receive_data(controller.reply(received.seq, answer))
