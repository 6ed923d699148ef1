"""Externally Guided Motion as far as position streams: identities, devices, start and stop."""

from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask

MAX_IDENTITIES = 4
"""A controller has four EGM processes; one that is not reset stays taken."""
MIN_SAMPLE_MS = 4.0


def reset(task: ProgramTask, identity: Slot) -> None:
    """No error for one that was never taken."""
    task.services.unit.egm.pop(id(identity), None)


def get_id(task: ProgramTask, identity: Slot) -> None:
    streams = task.services.unit.egm
    if len(streams) >= MAX_IDENTITIES and id(identity) not in streams:
        raise RapidError("ERR_UDPUC_COMM", "every EGM identity is taken: EGMReset releases one")
    streams.setdefault(id(identity), "")


def setup_uc(
    task: ProgramTask, unit: Any, identity: Slot, configuration: str, device: str, *options: bool | float | None
) -> None:
    """The device is one of the configuration."""
    if device.removesuffix(":") not in task.services.egm_devices:
        raise RapidError("ERR_UDPUC_COMM", f"no UDP unicast device is named {device}")
    _taken(task, identity)
    task.services.unit.egm[id(identity)] = "set up"


def stream_start(task: ProgramTask, identity: Slot, sample_ms: float | None) -> None:
    if sample_ms is not None and (sample_ms < MIN_SAMPLE_MS or sample_ms % MIN_SAMPLE_MS):
        raise RapidError("ERR_ARGVALERR", "a sample rate is a multiple of 4 ms")
    if _taken(task, identity) != "set up":
        raise RapidError("ERR_UDPUC_COMM", "EGMSetupUC comes first")
    task.services.unit.egm[id(identity)] = "streams"


def stream_stop(task: ProgramTask, identity: Slot) -> None:
    _taken(task, identity)
    task.services.unit.egm[id(identity)] = "set up"


def _taken(task: ProgramTask, identity: Slot) -> str:
    streams: dict[int, str] = task.services.unit.egm
    if id(identity) not in streams:
        raise RapidError("ERR_UDPUC_COMM", "EGMGetId comes first")
    return streams[id(identity)]


DOES = MappingProxyType(
    {
        "EGMReset": reset,
        "EGMGetId": get_id,
        "EGMSetupUC": setup_uc,
        "EGMStreamStart": stream_start,
        "EGMStreamStop": stream_stop,
    }
)
