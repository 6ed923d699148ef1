"""What an ability beside the core adds to the daemon: one value, named at the composition root."""

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field

from fastapi import APIRouter
from pydantic import BaseModel

from daemon.api.schemas.drift import DriftTouchDocument
from daemon.application import Application
from daemon.operations import FurtherSensors, Operations
from daemon.runs.calibration_run import LoadIdentification
from daemon.runtime.tasks import SectionService, Service

Rebuilt = tuple[int, dict[str, str], bytes]
Rebuild = Callable[[Application, str], Awaitable[Rebuilt]]
"""The answer to a request that was carried out but not answered: status, headers, body; by the id of its effect."""


def rebuilt_of(status: int, document: BaseModel, location: str) -> Rebuilt:
    """The answer that is this document, with the address of what it is of."""
    headers = {"content-type": "application/json", "location": location}
    return status, headers, document.model_dump_json().encode()


MakeService = Callable[[Application], Service]
"""Makes a service, which starts after those of the core and stops before them."""

Checks = Callable[[Application, str, int], Awaitable[Sequence[DriftTouchDocument]]]
"""The latest checks of a calibration by its id, at most so many, the oldest first."""


@dataclass(frozen=True, eq=False)
class Extension:
    """An ability beside the core; every part is optional.

    links : of GET /, by what they are.
    rebuilders : of answers, by the noun of the audit log.
    checks : of a calibration, which its drift chart lists.
    identification : of an arm's errors, for the calibrations that ask for them; one extension has it.
    sections : services of sections of the settings (`OF_SERVICES`) by name, started before `services`.
    services : started and stopped with the daemon; a route finds its own by `Application.service`.
    sensors : further ones of a camera's mount, of which one extension knows.
    """

    name: str
    routers: tuple[APIRouter, ...] = ()
    links: Mapping[str, str] = field(default_factory=dict)
    rebuilders: Mapping[str, Rebuild] = field(default_factory=dict)
    checks: Checks | None = None
    identification: LoadIdentification | None = None
    sections: Mapping[str, Callable[[Application], SectionService]] = field(default_factory=dict)
    services: tuple[MakeService, ...] = ()
    sensors: Callable[[Operations], FurtherSensors] | None = None


Extensions = tuple[Extension, ...]
