"""What a controller was bought and configured with: options, grants of the user, configuration."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from zlib import crc32

from mock_robot.rws.exchange import Item
from mock_robot.rws.refusals import NO_GRANT, RwsRefused
from protocols.cfg_file import CfgInstance, parse_cfg

OPTIONS: Mapping[int, tuple[str, ...]] = {
    1: ("616-1 PC Interface", "623-1 Multitasking", "689-1 Externally Guided Motion (EGM)"),
    2: ("3114-1 Multitasking", "3124-1 Externally Guided Motion", "3119-1 RobotStudio Connect"),
}
_ALWAYS = ("UAS_CFG_WRITE", "UAS_RAPID_CURRVALUE", "UAS_RAPID_EXECUTE", "UAS_BACKUP", "UAS_SYSTEM_ADMINISTRATION")
GRANTS: Mapping[int, tuple[str, ...]] = {
    1: ("UAS_FTP_READ", "UAS_FTP_WRITE", *_ALWAYS),
    2: ("UAS_FILE_ACCESS_READ_WRITE", "UAS_REMOTE_START_STOP_IN_AUTO", *_ALWAYS),
}
"""By version of the services. Names as Robot Web Services list them."""
UNNAMED = {"CAB_TASK_MODULES": "File"}
DELIVERED = (
    """SIO:CFG_1.0::
FIREWALL_MANAGEMENT:
      -Name "RapidSockets" -EnableOnPublicNet "true" -EnableOnPrivateNet "true" -EnableOnIONet "false"
      -Name "RobotWebServices" -EnableOnPublicNet "true" -EnableOnPrivateNet "true" -EnableOnIONet "false"
      -Name "UDPUC" -EnableOnPublicNet "true" -EnableOnPrivateNet "true" -EnableOnIONet "true"
""",
    """SYS:CFG_1.0::
SYS_MISC:
      -Name "NoOfRetry" -Value "4"
      -Name "ModalPayLoadMode" -Value "1"
""",
)
"""What set-up reads of the configuration, as the GoFa has it."""


@dataclass
class Equipment:
    """Settable by tests and by `handeyed mock run`. `without`: numbers of absent options; `denied`: absent grants.

    `arm`: its name, which is among the options.
    `configuration`: instances by domain and type, by the title they are listed under. What is loaded acts with the
    next restart.
    """

    arm: str = ""
    virtual: bool = False
    without: frozenset[str] = frozenset()
    denied: frozenset[str] = frozenset()
    configuration: dict[str, dict[str, dict[str, CfgInstance]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.configuration:
            for text in DELIVERED:
                self.load(text)

    def options(self, version: int) -> list[str]:
        options = (*OPTIONS[version], *([self.arm] if self.arm else []))
        return [option for option in options if option.partition(" ")[0] not in self.without]

    def grants(self, version: int) -> list[str]:
        return [grant for grant in GRANTS[version] if grant not in self.denied]

    def require(self, *names: str) -> None:
        """Refuse a user who has none of the grants. Raises RwsRefused."""
        if set(names) <= self.denied:
            raise RwsRefused(NO_GRANT)

    def instances(self, domain: str, kind: str, version: int) -> list[Item]:
        found = self.configuration.get(domain.upper(), {}).get(kind, {})
        return [
            Item(
                "cfg-dt-instance-li",
                listed_title(title, each, version),
                {"rdonly": "false", "instanceid": instance_id(title), "attrib": _attributes(each)},
            )
            for title, each in found.items()
        ]

    def load(self, text: str) -> str | None:
        """Load a file when it has no duplicates; returns what is wrong with it."""
        file = parse_cfg(text)
        if not file.domain:
            return "no header"
        types = self.configuration.setdefault(file.domain, {})
        titled = [(each.kind, title_of(each), each) for each in file.instances]
        for kind, title, _ in titled:
            if title in types.get(kind, {}):
                return f"{title} is there already"
        for kind, title, each in titled:
            types.setdefault(kind, {})[title] = each
        return None

    def text(self, domain: str) -> str:
        """A domain as the controller saves it."""
        lines = [f"{domain.upper()}:CFG_1.0:6:0::"]
        for kind, instances in self.configuration.get(domain.upper(), {}).items():
            lines += ["#", f"{kind}:", ""]
            for each in instances.values():
                lines.append("      " + " ".join(f'-{k} "{v}"' if v else f"-{k}" for k, v in each.attributes.items()))
        return "\r\n".join(lines) + "\r\n"


def listed_title(title: str, instance: CfgInstance, version: int) -> str:
    """As 1.0 lists an instance; RobotWare 7 lists it by its name, and by an id alone when it has none."""
    return title if version == 1 else instance.attributes.get("Name") or instance.attributes.get("name", "")


def instance_id(title: str) -> str:
    """A number that stays with an instance, as `instanceid` is."""
    return str(6_000_000 + crc32(title.encode()) % 1_000_000)


def _attributes(instance: CfgInstance) -> list[dict[str, str]]:
    """One without a value is TRUE."""
    return [
        {"_type": "cfg-ia-t", "_title": name, "value": value or "true"} for name, value in instance.attributes.items()
    ]


def title_of(instance: CfgInstance) -> str:
    """Title of an instance; one without a name is listed under the attributes it is about."""
    named = UNNAMED.get(instance.kind)
    if named is not None:
        return instance.attributes.get(named, "")
    if instance.kind.startswith("SYSSIG"):
        about = instance.attributes.get("Status") or instance.attributes.get("Action", "")
        return f"{about}_{instance.name}"
    return instance.name
