"""Settings and a running daemon for tests: a real server on a real port, devices from `fakes`."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx

from calibration.documents.pose import PoseDocument
from calibration.documents.session import CameraDocument
from calibration.documents.validation import validate_document
from daemon.api.extension import Extensions
from daemon.application import Application
from daemon.cell.cell import Devices
from daemon.composition import build
from daemon.config.settings import Settings, SettingsFile
from daemon.http.connection_limiter import ConnectionLimiter
from daemon.runtime.failpoints import NO_FAILPOINTS, Failpoints
from daemon.runtime.systemd import Systemd
from daemon.server import Server
from daemon.store.store import Store
from extensions.installed import INSTALLED
from tests.daemon.fakes import CAMERA, FakeCamera, FakeRobot, FakeScanner, poses_around_the_target
from tests.support.serving import serve_for_tests
from tests.support.waiting import LIMIT_S


def pose_json(base_T_flange: Any) -> dict[str, Any]:
    return PoseDocument.of(base_T_flange).model_dump(mode="json")


def settings_for(folder: Path, **changes: Any) -> Settings:
    """Settings of the fake cell; `changes` by section, e.g. calibration={"policy": "operator"}."""
    sections: dict[str, Any] = {
        "robot": {
            "address": "tcp://robot:11111",
            "box_mm": [[-2000, -2000, -500], [2000, 2000, 2500]],
            "settling": {"gap_s": 0.0, "limit_s": 0.5},
        },
        "camera": {"address": "http://camera/frame.png", "intrinsics": CameraDocument.of(CAMERA).model_dump()},
        "scanner": {"address": "http://scanner/cloud.ply"},
        "target": {"kind": "chessboard", "columns": 11, "rows": 8, "pitch_mm": 20.0},
        "calibration": {"poses": [pose_json(pose) for pose in poses_around_the_target()]},
        "server": {"port": 0},
        "storage": {"folder": str(folder), "reserve_mb": 0},
    }
    for section, values in changes.items():
        sections[section] = values if values is None else {**(sections.get(section) or {}), **values}
    return validate_document(Settings, sections, "test settings")


@dataclass(repr=False)  # asyncio's repr of the fixture's task would write all of it with each signal handler
class Bench:
    """A running daemon with fake devices, and a client that talks to it over a socket."""

    application: Application
    server: Server
    client: httpx.AsyncClient
    robot: FakeRobot
    camera: FakeCamera
    scanner: FakeScanner
    url: str = ""

    async def run_over(self, location: str, within_s: float = LIMIT_S) -> dict[str, Any]:
        """The run when it has ended."""
        answer = await self.client.get(location, params={"wait": within_s})
        run: dict[str, Any] = answer.json()
        assert run["over"], run
        return run

    async def verify(self, **body: Any) -> None:
        """A verification run, finished."""
        run = await self.run_over((await self.client.post("/verify", json=body)).headers["location"])
        assert run["state"] == "finished", run["cause"]


@dataclass
class Parts:
    """Fake devices a test may prepare before the daemon starts."""

    robot: FakeRobot = field(default_factory=FakeRobot)
    scanner: FakeScanner = field(default_factory=FakeScanner)
    camera: FakeCamera = field(init=False)
    cameras: dict[str, FakeCamera] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.camera = FakeCamera(self.robot)


@asynccontextmanager
async def serving(
    settings: Settings,
    parts: Parts | None = None,
    store: Store | None = None,
    door: ConnectionLimiter | None = None,
    at: Failpoints = NO_FAILPOINTS,
    systemd: Systemd | None = None,
    settings_file: SettingsFile | None = None,
    extensions: Extensions = INSTALLED,
) -> AsyncIterator[Bench]:
    """The daemon, up; stopped in order afterwards."""
    parts = parts or Parts()
    scanner = parts.scanner if settings.scanner else None
    scanners = {name: FakeScanner() for name in settings.scanners}
    devices = Devices(parts.robot, parts.camera, scanner, cameras=parts.cameras, scanners=scanners)
    application = build(
        settings,
        lambda _settings, _clock: devices,
        store=store,
        at=at,
        systemd=systemd,
        settings_file=settings_file,
        extensions=extensions,
    )
    async with (
        serve_for_tests(application, door, extensions=extensions) as served,
        httpx.AsyncClient(base_url=served.url, verify=False, timeout=2 * LIMIT_S) as client,
    ):
        yield Bench(application, served.server, client, parts.robot, parts.camera, parts.scanner, served.url)
