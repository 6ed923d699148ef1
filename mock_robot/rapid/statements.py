"""Compiles statements to closures. A closure returns None to continue with the next statement, or a `Flow`."""

from collections.abc import Callable
from dataclasses import replace
from enum import IntEnum
from typing import Any

from mock_robot.rapid.calls import call
from mock_robot.rapid.errors import LongJump, ProgramStopped, RaisedFurther, RapidError
from mock_robot.rapid.expressions import as_value, expression, reference
from mock_robot.rapid.interrupts import connection
from mock_robot.rapid.scope import Builtin, CompileContext, Frame, Routine, Scope, Slot
from mock_robot.rapid.syntax import Node, line_of, name, optional_part, part, parts, word
from mock_robot.rapid.tasks import EXECUTION_ERROR
from mock_robot.rapid.types import BOOL, NUM, Atom
from mock_robot.rapid.values import single

MAX_RETRIES = 4
"""The system parameter No Of Retry."""
HANDLED_ERROR = 41500
"""The mock's own event number of the warning that every handled error leaves unless its handler does SkipWarn."""


class Flow(IntEnum):
    """How a routine continues, if not with the next statement."""

    RETURNED = 1
    NEXT = 2
    AGAIN = 3


class _RaisedHere(Exception):
    """RAISE in a handler."""


class _GoTo(Exception):
    """GOTO: execution goes on at the label, which stands in this block or in one around it."""

    def __init__(self, label: str) -> None:
        self.label = label


Run = Callable[[Frame], Any]


def block(context: CompileContext, statements: list[Node]) -> Run:
    """Compile statements in sequence. The task attends between two of them; errors go to the routine's handler.

    A program that stops by itself stands at its statement, and tries it again when it is started.
    """
    labels = {name(node, 0): place for place, node in enumerate(statements) if node.data == "label"}
    context = replace(context, labels=context.labels | labels.keys())
    runs = [_KINDS[node.data](context, node) for node in statements]
    lines = [line_of(node) for node in statements]
    task, module, count = context.task, context.module, len(runs)
    in_handler = context.in_handler

    def run(frame: Frame) -> Any:
        at, retries = 0, 0
        while True:
            try:
                try:
                    for place in range(at, count):
                        at = place
                        if task.attention:
                            task.attend()
                        if flow := runs[at](frame):
                            return flow
                    return None
                except RapidError as error:
                    error.where = error.where or f"{module}:{lines[at]}"
                    flow = _handle(context, frame, error)
                except LongJump as jump:
                    routine = context.routine
                    if in_handler or routine is None or not _lists(routine, frame, jump.number):
                        raise
                    flow = _run_handler(context, frame, routine, jump.error)
                except _GoTo as goto:
                    if goto.label not in labels:
                        raise
                    at, retries = labels[goto.label], 0
                    continue
                if flow is Flow.RETURNED:
                    return flow
                if flow is Flow.NEXT:
                    at, retries = at + 1, 0
                elif (retries := retries + 1) > MAX_RETRIES:
                    text = f"retried {MAX_RETRIES} times in vain"
                    raise ProgramStopped(EXECUTION_ERROR, f"{module}:{lines[at]}", text)
            except ProgramStopped as stopped:
                task.stop_by_itself(stopped)
                retries = 0

    return run


def _handle(context: CompileContext, frame: Frame, error: RapidError) -> Flow:
    """Run the routine's own handler; without one the program stops (the caller's is not tried)."""
    if context.in_handler:
        raise ProgramStopped(EXECUTION_ERROR, error.where, f"{error} inside an ERROR handler") from error
    routine = context.routine
    assert routine is not None
    if routine.handler is None or (routine.listed and not _lists(routine, frame, context.errors.number_of(error))):
        raise ProgramStopped(EXECUTION_ERROR, error.where, f"{error}; {routine.name} has no ERROR handler") from error
    return _run_handler(context, frame, routine, error)


def _lists(routine: Routine, frame: Frame, number: float) -> bool:
    return any(listed(frame) == number for listed in routine.listed)


def _run_handler(context: CompileContext, frame: Frame, routine: Routine, error: RapidError) -> Flow:
    assert routine.handler is not None
    context.errors.errno.value = context.errors.number_of(error)
    task = context.task
    outer, task.handled = task.handled, error
    try:
        return Flow(routine.handler(frame) or Flow.RETURNED)
    except _RaisedHere:
        raise RaisedFurther(error) from None
    finally:
        task.handled = outer
        if not error.logged:
            error.logged = True
            task.services.note(HANDLED_ERROR, f"{error.where}: {error}")


def _if(context: CompileContext, node: Node) -> Run:
    """IF, ELSEIF and ELSE: the first branch whose condition holds."""
    branches = [
        (expression(context, part(each, 0), BOOL).evaluate, block(context, parts(part(each, 1))))
        for each in (node, *parts(node, "elseif"))
    ]
    run = next((block(context, parts(part(each, 0))) for each in parts(node, "else")), _nothing)
    for condition, then in reversed(branches):
        run = _choose(condition, then, run)
    return run


def _choose(condition: Run, then: Run, otherwise: Run) -> Run:
    return lambda frame: then(frame) if condition(frame) else otherwise(frame)


def _nothing(frame: Frame) -> None:
    """The empty statement."""


def _if_one(context: CompileContext, node: Node) -> Run:
    condition = expression(context, part(node, 0), BOOL).evaluate
    return _choose(condition, block(context, [part(node, 1)]), _nothing)


def _while(context: CompileContext, node: Node) -> Run:
    condition = expression(context, part(node, 0), BOOL).evaluate
    body, task = block(context, parts(part(node, 1))), context.task

    def run(frame: Frame) -> Any:
        while condition(frame):
            if task.attention:
                task.attend()
            if flow := body(frame):
                return flow
        return None

    return run


def _for(context: CompileContext, node: Node) -> Run:
    first, last = (expression(context, part(node, place), NUM).evaluate for place in (1, 2))
    stride = optional_part(node, 3)
    step = None if stride is None else expression(context, stride, NUM).evaluate
    outer, context.scope = context.scope, Scope(context.scope)
    place = context.local(name(node, 0), NUM, "loop", line_of(node)).place
    body = block(context, parts(part(node, 4)))
    context.scope = outer

    def run(frame: Frame) -> Any:
        value, end = first(frame), last(frame)
        by = (1.0 if value <= end else -1.0) if step is None else step(frame)
        slot = frame[place] = Slot(value)
        while value <= end if by > 0 else value >= end:
            slot.value = value
            if flow := body(frame):
                return flow
            value = single(value + by)
        return None

    return run


def _test(context: CompileContext, node: Node) -> Run:
    subject = as_value(context, expression(context, part(node, 0)))
    cases = []
    for case in parts(node, "case"):
        *values, body = parts(case)
        evaluates = [expression(context, value, subject.type).evaluate for value in values]
        cases.append((evaluates, block(context, parts(body))))
    default = next((block(context, parts(part(each, 0))) for each in parts(node, "default")), _nothing)
    evaluate = subject.evaluate

    def run(frame: Frame) -> Any:
        value = evaluate(frame)
        for candidates, body in cases:
            if any(candidate(frame) == value for candidate in candidates):
                return body(frame)
        return default(frame)

    return run


def _assign(context: CompileContext, node: Node) -> Run:
    symbol, kind, slot_in = reference(context, part(node, 0))
    if symbol.storage not in ("var", "pers"):
        raise context.wrong(line_of(node), f"{symbol.name} is {symbol.storage.upper()}: nothing can be assigned to it")
    if isinstance(kind, Atom) and kind.device:
        raise context.wrong(line_of(node), f"a {kind.name} has no value to assign")
    evaluate = expression(context, part(node, 1), kind).evaluate
    copy = kind.copy
    value_in = evaluate if isinstance(kind, Atom) else lambda frame: copy(evaluate(frame))

    def assign(frame: Frame) -> None:
        slot_in(frame).value = value_in(frame)

    return assign


def _return(context: CompileContext, node: Node) -> Run:
    routine, value = context.routine, optional_part(node, 0)
    assert routine is not None
    if (routine.kind == "func") is (value is None):
        raise context.wrong(line_of(node), f"RETURN in {routine.name} {'needs a' if value is None else 'has no'} value")
    if value is None:
        return lambda frame: Flow.RETURNED
    assert routine.result is not None
    evaluate, copy = expression(context, value, routine.result).evaluate, routine.result.copy

    def run(frame: Frame) -> Flow:
        frame[0] = copy(evaluate(frame))
        return Flow.RETURNED

    return run


def _raise(context: CompileContext, node: Node) -> Run:
    asked, errors, task = optional_part(node, 0), context.errors, context.task
    if context.in_handler is (asked is not None):
        raise context.wrong(line_of(node), f"RAISE {'with' if asked else 'without'} a number "
                            f"{'does not belong' if asked else 'belongs'} into an ERROR handler")  # fmt: skip
    number = None if asked is None else expression(context, asked, NUM).evaluate

    def run(frame: Frame) -> None:
        if number is None:
            raise _RaisedHere
        error = errors.error_of(value := number(frame))
        raise LongJump(error, value) if any(lists(value) for lists in task.recovery_points) else error

    return run


def _goto(context: CompileContext, node: Node) -> Run:
    label = name(node, 0)
    if label not in context.labels:
        raise context.wrong(line_of(node), f"GOTO {label}: no such label in this block or in one around it")

    def run(frame: Frame) -> None:
        raise _GoTo(label)

    return run


def _in_handler(flow: Flow) -> Callable[[CompileContext, Node], Run]:
    def compile_flow(context: CompileContext, node: Node) -> Run:
        if not context.in_handler:
            raise context.wrong(line_of(node), f"{str(node.data).upper()} belongs into an ERROR handler")
        return lambda frame: flow

    return compile_flow


def _call(context: CompileContext, node: Node) -> Run:
    symbol = context.scope.find(name(node, 0))
    if not isinstance(symbol, Routine | Builtin) or symbol.kind != "proc":
        raise context.wrong(line_of(node), f"no instruction or procedure is named {word(node, 0)}")
    run = call(context, symbol, node)

    def calling(frame: Frame) -> None:
        run(frame)

    return calling


_KINDS: dict[str, Callable[[CompileContext, Node], Run]] = {
    "if_": _if,
    "if_one": _if_one,
    "while_": _while,
    "for_": _for,
    "test": _test,
    "assign": _assign,
    "return_": _return,
    "raise_": _raise,
    "retry": _in_handler(Flow.AGAIN),
    "trynext": _in_handler(Flow.NEXT),
    "goto": _goto,
    "label": lambda context, node: _nothing,
    "connect": connection,
    "call": _call,
}
