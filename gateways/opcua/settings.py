"""gateway.toml: which cells there are, and how clients reach the gateway."""

import os
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator


@dataclass
class GatewayError(Exception):
    """The gateway cannot start. `place`: the file and the key; `what` and `fix` are sentences for people."""

    place: str
    what: str
    fix: str

    def __str__(self) -> str:
        return f"{self.place}: {self.what}: {self.fix}"


class Table(BaseModel):
    """A table of the file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def below(self, folder: Path, *names: str) -> Self:
        """The same with the paths of these names counted from the folder."""
        return self.model_copy(update={name: folder / path for name in names if (path := getattr(self, name))})


class CellSettings(Table):
    """One daemon."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,40}$")]
    """Its node is ns=urn:handeyed:cells;s=NAME."""

    url: Annotated[str, Field(pattern=r"^https?://")]
    """Where it serves REST."""

    key_file: Path | None = None
    """A file with a viewer's key, for reading; without it the daemon asks for none."""

    ca_file: Path | None = None
    """The authority of its certificate; without it the system's authorities count."""

    def key(self) -> str | None:
        """The viewer's key. Raises GatewayError."""
        if self.key_file is None:
            return None
        try:
            return self.key_file.read_text().strip()
        except OSError as error:
            fix = "write a viewer's key into it: handeyed keys add SETTINGS gateway --role viewer"
            raise GatewayError(str(self.key_file), str(error.strerror), fix) from None


class ServerSettings(Table):
    """What clients connect to."""

    endpoint: Annotated[str, Field(pattern=r"^opc\.tcp://[^/]+:\d+/")] = "opc.tcp://0.0.0.0:4840/"
    """Address and port that the gateway listens at."""

    certificate: Path = Path("pki/own/gateway.der")
    """Its certificate, DER; made with the key when there is none, for a year."""

    private_key: Path = Path("pki/own/gateway-key.pem")
    """The key of its certificate."""

    trusted: Path = Path("pki/trusted")
    """A folder with certificates (.der, .pem, .cer, .crt) of clients, or of their authorities. Others are refused."""

    connections: Annotated[int, Field(ge=1, le=1000)] = 100
    """Sessions at a time."""


class GatewaySettings(Table):
    """The whole file."""

    cell: Annotated[tuple[CellSettings, ...], Field(min_length=1, max_length=200)]
    server: ServerSettings = ServerSettings()

    @model_validator(mode="after")
    def _names_differ(self) -> "GatewaySettings":
        names = [cell.name for cell in self.cell]
        if len(set(names)) < len(names):
            raise ValueError("two cells have one name")
        return self


def read_settings(file: Path) -> GatewaySettings:
    """The settings; paths count from the file's folder, those of [server] under systemd from the unit's state.

    Raises GatewayError.
    """
    try:
        read = GatewaySettings.model_validate(tomllib.loads(file.read_text()))
    except (OSError, UnicodeDecodeError) as error:
        raise GatewayError(str(file), str(error), "give a gateway.toml; docs/use/opcua.md has one") from None
    except tomllib.TOMLDecodeError as error:
        raise GatewayError(str(file), str(error), "correct the line") from None
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = f"{file}: {'.'.join(str(part) for part in first['loc']) or 'cells'}"
        raise GatewayError(place, first["msg"], "docs/use/opcua.md says what stands there") from None
    folder = file.resolve().parent
    cells = tuple(cell.below(folder, "key_file", "ca_file") for cell in read.cell)
    state = Path(os.environ.get("STATE_DIRECTORY", folder))  # that of the settings is not writable there
    return GatewaySettings(cell=cells, server=read.server.below(state, "certificate", "private_key", "trusted"))
