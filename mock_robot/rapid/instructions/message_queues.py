"""RAPID message queues between the tasks of a controller; client applications have none here."""

from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.instructions.conditions import wait_for
from mock_robot.rapid.messages import Message
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.types import Type

PREFIX = "RMQ_"
"""The queue of T_ROB1 is named RMQ_T_ROB1."""


def find_slot(task: ProgramTask, slot: Slot, name: str) -> None:
    tasks = task.services.queues.tasks
    found = next((each for each in tasks if f"{PREFIX}{each}".casefold() == name.casefold()), None)
    if found is None:
        raise RapidError("ERR_RMQ_NAME", f"no queue is named {name}")
    slot.value.task = found


def send(task: ProgramTask, slot: Slot, value: tuple[Type, Any], user: float | None) -> None:
    kind, content = value
    if not slot.value.task:
        raise RapidError("ERR_RMQ_INVALID", "RMQFindSlot comes first")
    if not task.services.queues.put(slot.value.task, Message(kind, kind.copy(content), task.name)):
        raise RapidError("ERR_RMQ_FULL", f"the queue of {slot.value.task} is full")


def on_message(task: ProgramTask, example: tuple[Type, Any], interrupt: Slot) -> None:
    interrupts, number = task.services.interrupts, interrupt.value
    task.services.queues.wanted[task.name, example[0].name] = lambda: interrupts.trigger(number)


def get_message(task: ProgramTask, message: Slot) -> None:
    found = task.services.queues.take(task.name)
    if found is None:
        raise RapidError("ERR_RMQ_NOMSG", "the queue is empty")
    message.value = found


def read_wait(task: ProgramTask, message: Slot, most_s: float | None) -> None:
    """Wait for a message."""
    found: list[Message] = []

    def came() -> bool:
        next_one = task.services.queues.take(task.name)
        found.extend([] if next_one is None else [next_one])
        return bool(found)

    late = Slot(False)
    wait_for(task, came, most_s, late)
    if late.value:
        raise RapidError("ERR_RMQ_TIMEOUT", f"no message within {most_s:g} s")
    message.value = found[0]


def get_data(task: ProgramTask, message: Slot, data: tuple[Type, Slot]) -> None:
    kind, slot = data
    if message.value.kind != kind:
        raise RapidError("ERR_RMQ_VALUE", f"the message is no {kind.name}")
    slot.value = kind.copy(message.value.value)


def empty(task: ProgramTask) -> None:
    task.services.queues.clear(task.name)


DOES = MappingProxyType(
    {
        "RMQFindSlot": find_slot,
        "RMQSendMessage": send,
        "IRMQMessage": on_message,
        "RMQGetMessage": get_message,
        "RMQReadWait": read_wait,
        "RMQGetMsgData": get_data,
        "RMQEmptyQueue": empty,
    }
)
