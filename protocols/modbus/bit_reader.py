"""Reads coils and discrete inputs over Modbus so that no answer is taken for the answer to another question.

Modbus RTU numbers neither questions nor answers. What identifies an answer is its shape: the function code and its
number of value bytes, or that it is an exception. So the questions are made to differ in shape:

- All bits of one kind are requested in one question, from the first address to the last. - The same span is also
requested 8, 16 and 24 bits longer, with a question of the other function between when the device refuses those. - A
question is sent only when no answer still to come has the shape of its answer. Until it is answered, it is repeated,
and no other is sent.

A serial line is one wire with one device: answers may be arbitrarily late, lost, or repeated, but they come in the
order of their questions. After the answer to a question nothing older can follow, so the next answer of another shape
belongs to the next question. A value counts only when its question was first sent within the current reading: an answer
to a question of an earlier reading shows only that the line is up to date.

Before the first reading of a process, the line may hold answers to questions of the process before. These have at most
two shapes, so the first two answers of three different shapes are discarded; fewer when the device has no three.

Modbus TCP numbers its answers; the shapes then protect against a serial gateway that confuses them. There a question
may be sent all the same when the device leaves no other.
"""

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum

from protocols.modbus.codes import ERROR_BIT, MAX_READ_BITS, ExceptionCode, Function
from protocols.modbus.words import bits_of

Bit = tuple[Function, int]
"""READ_COILS or READ_DISCRETE_INPUTS, and an address."""

Shape = tuple[int, int]
"""Function code and number of value bytes; of an exception the code with ERROR_BIT, and 0."""

LONGER_BITS = (8, 16, 24)
MAX_ADDRESS = 65535
TO_PROVE = 3
"""Number of shapes answered before the line is known to hold nothing older; the last of these answers is used."""
MAX_UNANSWERED = 2
"""Attempts of a question the device need not support; then another one is tried."""
NO_SUCH_BITS = (ExceptionCode.ILLEGAL_DATA_ADDRESS, ExceptionCode.ILLEGAL_DATA_VALUE)
OTHER = {Function.READ_COILS: Function.READ_DISCRETE_INPUTS, Function.READ_DISCRETE_INPUTS: Function.READ_COILS}


@dataclass(frozen=True)
class ReadBits:
    """A question for `count` bits: READ_COILS or READ_DISCRETE_INPUTS."""

    function: Function
    address: int
    count: int


class AnswerKind(Enum):
    AWAITED = "it answers the question"
    REPEATED = "it answers an older question, or the same once more"
    UNFIT = "it answers no question that was asked"


@dataclass(frozen=True)
class BitGroup:
    """Bits of one function requested by one question, in order."""

    function: Function
    addresses: tuple[int, ...]

    @property
    def count(self) -> int:
        """Number of bits from the first address to the last."""
        return self.addresses[-1] - self.addresses[0] + 1

    @property
    def question(self) -> ReadBits:
        return ReadBits(self.function, self.addresses[0], self.count)

    @property
    def longer_questions(self) -> tuple[ReadBits, ...]:
        """The same bits and some after them, which a device need not have."""
        first = self.addresses[0]
        counts = (self.count + more for more in LONGER_BITS)
        return tuple(
            ReadBits(self.function, first, count)
            for count in counts
            if count <= MAX_READ_BITS and first + count <= MAX_ADDRESS + 1
        )

    @property
    def other_question(self) -> ReadBits:
        """As many bits of the other function: its answer or refusal has another shape."""
        return ReadBits(OTHER[self.function], self.addresses[0], self.count)

    def halves(self) -> "tuple[BitGroup, BitGroup]":
        """Two groups, split at the widest gap between two addresses."""
        at = max(range(1, len(self.addresses)), key=lambda i: self.addresses[i] - self.addresses[i - 1])
        return BitGroup(self.function, self.addresses[:at]), BitGroup(self.function, self.addresses[at:])


@dataclass
class _PendingQuestion:
    """A question on the line, and the shapes its pending answers may have."""

    question: ReadBits
    shapes: frozenset[Shape]
    times: int = 0
    in_this_reading: bool = True


@dataclass(eq=False)
class BitReader:
    """Generates questions and evaluates answers. Call `begin`, send what `request` returns, pass answers to `receive`.

    Call `request` once after `begin` and after each AWAITED answer, until it returns None. `numbered`: the transport
    matches answers to requests.
    """

    wanted: Iterable[Bit]
    numbered: bool = False
    bits: dict[Bit, bool] = field(default_factory=dict, init=False)
    exceptions: dict[Bit, int] = field(default_factory=dict, init=False)
    _groups: tuple[BitGroup, ...] = field(init=False)
    _open: list[BitGroup] = field(default_factory=list, init=False)
    _line: list[_PendingQuestion] = field(default_factory=list, init=False)
    _outstanding: bool = field(default=False, init=False)
    _to_prove: int = field(init=False)
    _known: dict[ReadBits, Shape] = field(default_factory=dict, init=False)
    _silent: set[ReadBits] = field(default_factory=set, init=False)
    _asked_last: dict[ReadBits, int] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        self._to_prove = 0 if self.numbered else TO_PROVE
        self._groups = tuple(group for function in OTHER for group in _groups(function, self.wanted))

    def begin(self) -> None:
        """Start a reading: only questions first sent from now on fill `bits` and `exceptions`."""
        self.bits, self.exceptions = {}, {}
        self._open = list(self._groups)
        for asked in self._line:
            asked.in_this_reading = False

    def request(self) -> bytes | None:
        """The PDU to send now; None when every bit is in `bits` or in `exceptions`."""
        question = self._next_question()
        if question is None:
            return None
        if not self._outstanding:
            self._line.append(_PendingQuestion(question, frozenset({_shape_of(question), _refusal_of(question)})))
            self._outstanding = True
        self._line[-1].times += 1
        self._asked_last[question] = max(self._asked_last.values(), default=0) + 1
        return struct.pack(">BHH", question.function, question.address, question.count)

    def receive(self, pdu: bytes) -> AnswerKind:
        shape = _shape_in(pdu)
        fitting = [i for i, asked in enumerate(self._line) if shape in asked.shapes]
        if shape is None or not fitting:
            return AnswerKind.UNFIT
        if not self._to_prove:
            del self._line[: fitting[0]]  # answers come in order: nothing older follows
        newest = self._line[-1]
        if not self._outstanding or any(shape in asked.shapes for asked in self._line[:-1]):
            return AnswerKind.REPEATED
        self._take(newest, shape, pdu)
        return AnswerKind.AWAITED

    def _take(self, asked: _PendingQuestion, shape: Shape, pdu: bytes) -> None:
        """Process the answer to the newest question."""
        self._outstanding = False
        wanted = asked.in_this_reading and bool(self._open) and asked.question in self._questions_for(self._open[0])
        if asked.times == 1:
            asked.shapes = frozenset({shape})
        if not shape[0] & ERROR_BIT or pdu[1] in (ExceptionCode.ILLEGAL_FUNCTION, *NO_SUCH_BITS):
            self._known[asked.question] = shape
        self._to_prove = max(self._to_prove - 1, 0)
        if self._to_prove:
            return  # the questions stay, so that the next ones have other shapes
        self._line = [asked]
        if wanted:
            self._note(self._open[0], asked.question, pdu)

    def _note(self, group: BitGroup, question: ReadBits, pdu: bytes) -> None:
        """Store values, or an exception, for the bits of a group."""
        if not pdu[0] & ERROR_BIT:
            values = bits_of(pdu[2:], group.count)
            self.bits |= {(group.function, each): values[each - group.addresses[0]] for each in group.addresses}
        elif pdu[1] in NO_SUCH_BITS and question != group.question:
            return  # the device has the bits, but not so many after them
        elif pdu[1] in NO_SUCH_BITS and len(group.addresses) > 1:
            halves = group.halves()
            self._groups = tuple(part for each in self._groups for part in (halves if each == group else (each,)))
            self._open[:1] = halves
            return
        else:
            self.exceptions |= {(group.function, each): pdu[1] for each in group.addresses}
        del self._open[0]

    def _next_question(self) -> ReadBits | None:
        """The newest question again while unanswered, otherwise one whose answer cannot be confused."""
        if not self._outstanding:
            return self._new_question() if self._open else None
        newest = self._line[-1]
        needed = {group.question for group in self._groups} | self._known.keys()  # answered, or must be
        if newest.times < MAX_UNANSWERED or newest.question in needed:
            return newest.question
        self._silent.add(newest.question)
        other = self._conclusive_question() or self._question_by_number()
        self._outstanding = other is None
        return other or newest.question

    def _new_question(self) -> ReadBits:
        """The next question when everything on the line was answered."""
        if (question := self._conclusive_question()) is not None:
            return question
        if self._to_prove:  # the device has no three shapes
            self._to_prove = 0
            del self._line[:-1]
        elif (question := self._question_by_number()) is not None:
            return question
        else:
            self._silent.clear()
        question = self._conclusive_question()
        assert question is not None, "there is always one of the other function"
        return question

    def _question_by_number(self) -> ReadBits | None:
        """The shortest question for the next group of bits, if its answer is identified by its number."""
        if not self.numbered:
            return None
        self._line.clear()
        return self._open[0].question

    def _conclusive_question(self) -> ReadBits | None:
        """A conclusive question for the next group of bits, else any; those not sent for longest first."""
        between = [
            question
            for group in self._groups
            for question in (group.question, *group.longer_questions, group.other_question)
        ]
        for questions in (self._questions_for(self._open[0]), between):
            for question in sorted(questions, key=lambda each: self._asked_last.get(each, 0)):
                if question not in self._silent and self._is_conclusive(question):
                    return question
        return None

    def _questions_for(self, group: BitGroup) -> list[ReadBits]:
        """Questions that give the values of a group; the longer ones after the shortest was answered."""
        if self._known.get(group.question) != _shape_of(group.question):
            return [group.question]
        longer = (each for each in group.longer_questions if self._known.get(each) != _refusal_of(each))
        return [group.question, *longer]

    def _is_conclusive(self, question: ReadBits) -> bool:
        """Whether none of its answers can be taken for a pending one."""
        known = self._known.get(question)
        expected = {_shape_of(question), _refusal_of(question)} if known is None else {known}
        return all(expected.isdisjoint(asked.shapes) for asked in self._line)


def _groups(function: Function, wanted: Iterable[Bit]) -> Iterator[BitGroup]:
    """One group, or several when the addresses lie further apart than one question reaches."""
    addresses = tuple(sorted({address for kind, address in wanted if kind is function}))
    waiting = [BitGroup(function, addresses)] if addresses else []
    while waiting:
        group = waiting.pop(0)
        if group.count > MAX_READ_BITS:
            waiting[:0] = group.halves()
        else:
            yield group


def _shape_of(question: ReadBits) -> Shape:
    return question.function, (question.count + 7) // 8


def _refusal_of(question: ReadBits) -> Shape:
    return question.function | ERROR_BIT, 0


def _shape_in(pdu: bytes) -> Shape | None:
    """Shape of an answer; None when the PDU's length contradicts its content."""
    if len(pdu) < 2:
        return None
    if pdu[0] & ERROR_BIT:
        return (pdu[0], 0) if len(pdu) == 2 else None
    return (pdu[0], pdu[1]) if len(pdu) == 2 + pdu[1] else None
