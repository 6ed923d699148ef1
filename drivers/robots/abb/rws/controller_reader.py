"""What a controller says of itself over Robot Web Services: options, grants, configuration, RAPID symbols, files."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from drivers.errors import RequestRefused
from drivers.robots.abb.rws.address import RwsAddress
from drivers.robots.abb.rws.client import RwsClient
from drivers.robots.abb.rws.dialect import Dialect
from drivers.robots.abb.rws.parsing import Values
from drivers.timing import Timing
from protocols.cfg_file import CfgInstance

ABSENT = ("NOT_FOUND", "BAD_ARGUMENT", "GONE")
"""Statuses of a refusal of something that this RobotWare, or this controller, does not have."""


@dataclass(frozen=True)
class ConfigurationInstance:
    """An instance of the configuration as it is listed; RobotWare 7 gives some of them an id and no title.

    `attributes`: as text, {} where the controller does not list them.
    """

    title: str
    instance_id: str = ""
    attributes: Mapping[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """As in a configuration file: its name, or the module, signal or file that it is about."""
        return CfgInstance("", dict(self.attributes), 0).name or self.title

    def agrees_with(self, wanted: CfgInstance) -> bool:
        """Whether what is listed of it is as in a fragment, where an attribute without a value is TRUE."""
        return all(
            self.attributes.get(name, value).casefold() == (value or "true").casefold()
            for name, value in wanted.attributes.items()
            if value or name in self.attributes
        )


class ControllerReader:
    """One session with the controller that changes nothing. Every method raises DeviceError."""

    def __init__(self, address: RwsAddress, timing: Timing | None = None) -> None:
        self.address, self._timing = address, timing or Timing()
        self.client = RwsClient(f"robot {address.address}", address, self._timing)

    async def __aenter__(self) -> Self:
        await self.client.find()
        return self

    async def __aexit__(self, *error: object) -> None:
        await self.client.close()

    @property
    def device(self) -> str:
        return self.client.device

    @property
    def version(self) -> int:
        """Version of the services: 1 on RobotWare 6, 2 on 7."""
        return self._dialect.version

    @property
    def _dialect(self) -> Dialect:
        return self.client.require_dialect()

    async def read(self, path: str, query: Mapping[str, str] | None = None) -> list[dict[str, Any]] | None:
        """Resources at a path; None when the controller does not have it."""
        try:
            return await self.client.get(path, query)
        except RequestRefused as refused:
            if refused.status in ABSENT:
                return None
            raise

    async def read_first(self, path: str) -> Values:
        """The first resource at a path; {} when there is none."""
        return next(iter(await self.read(path) or ()), {})

    async def read_panel(self) -> Values:
        """`ctrlstate`, `opmode` and `ctrlexecstate`, as far as they can be read."""
        paths = (self._dialect.controller_state, "/rw/panel/opmode", "/rw/rapid/execution")
        return {key: value for path in paths for key, value in (await self.read_first(path)).items()}

    async def read_options(self) -> tuple[str, ...] | None:
        """Options of the system, as "623-1 Multitasking"; None when the controller does not list them."""
        found = await self.read("/rw/system/options")
        return None if found is None else tuple(_texts(found, "option"))

    async def read_grants(self) -> tuple[str, ...] | None:
        """Grants of the user in session, as "UAS_CFG_WRITE"; None when the controller does not list them."""
        found = await self.read(self._dialect.call("grants")[0])
        if found is None:
            return None
        return tuple(str(each.get("grantname") or each.get("_title", "")) for each in found)

    async def read_base_frame(self, mechunit: str) -> tuple[float, ...] | None:
        """World to base: x, y, z in mm and quaternion (w, x, y, z); None when it cannot be read."""
        values = await self.read_first(f"/rw/motionsystem/mechunits/{mechunit}/baseframe")
        try:
            return tuple(float(values[key]) for key in ("x", "y", "z", "q1", "q2", "q3", "q4"))
        except (KeyError, TypeError, ValueError):
            return None

    async def read_mastership(self) -> Values:
        """Who holds the mastership that loading needs; {} where there is none, as on RobotWare 8."""
        return await self.read_first(f"/rw/mastership/{'rapid' if self.version == 1 else 'edit'}")

    async def read_instances(self, domain: str, kind: str) -> tuple[ConfigurationInstance, ...]:
        """Instances of a type of the configuration."""
        found = await self.read(f"/rw/cfg/{domain}/{kind}/instances")
        return tuple(
            ConfigurationInstance(
                str(each.get("_title", "")).removeprefix(f"{domain}/{kind}/"),
                str(each.get("instanceid", "")),
                {str(one.get("_title")): str(one.get("value", "")) for one in each.get("attrib", ())},
            )
            for each in found or ()
        )

    async def read_modules(self, task: str) -> tuple[str, ...]:
        found = await self.read(*self._dialect.call("modules", task=task))
        return tuple(str(each.get("name") or each.get("_title", "")) for each in found or ())

    async def read_symbol(self, name: str) -> str | None:
        """Value of task/module/symbol in RAPID's spelling; None when there is none."""
        values = await self.read_first(self._dialect.call("symbol", name=name, what="data")[0])
        return str(values["value"]) if "value" in values else None

    async def read_type(self, name: str) -> str | None:
        """Type of task/module/symbol; None when there is none."""
        values = await self.read_first(self._dialect.call("symbol", name=name, what="properties")[0])
        return str(values["dattyp"]) if "dattyp" in values else None

    async def read_file(self, path: str) -> bytes | None:
        """Content of a file below HOME; None when there is none."""
        return await self.client.get_file(path)


def _texts(value: Any, name: str) -> Iterator[str]:
    """Every text called `name`, at any depth: RWS 2.0 nests what 1.0 lists."""
    if isinstance(value, dict) and isinstance(value.get(name), str):
        yield value[name]
    inside = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    yield from (text for each in inside for text in _texts(each, name))
