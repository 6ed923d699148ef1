"""Every place that opens a file it did not write: what is no file, or no such file, is refused, in bounded time."""

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from calibration.documents.validation import parse_document
from calibration.errors import DocumentError
from daemon.cli.errors import CommandError
from daemon.cli.robot_setup import module_files as rapid_modules
from daemon.config.settings import load_settings, parse_settings
from daemon.runtime.bounded_read import read_document
from daemon.sessions.session_files import ImageError, read_grey
from daemon.sessions.session_reader import open_session
from daemon.tools.batch_registration.remote_folder import ArchiveError, RemoteFolder
from daemon.tools.batch_registration.tasks import file_hash
from daemon.tools.support_bundle.bundle import gather
from daemon.webhooks.dispatcher import SecretUnusable, read_secrets
from registration.errors import CloudError
from registration.io.convert import move_file
from registration.io.reading import PARSERS, SPECIAL, open_cloud
from registration.points.rigid_motion import RigidMotion
from registration.scan_folder import ScanDocument, read_scan
from tests.registration.clouds import BASE_T_CAMERA

HUGE_BYTES = 1 << 43
"""8 TB, of which nothing is on the disk."""


def make_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))


HOSTILE: dict[str, Callable[[Path], object]] = {
    "nothing": lambda path: None,
    "pipe": os.mkfifo,
    "folder": Path.mkdir,
    "socket": make_socket,
    "device without end": lambda path: path.symlink_to("/dev/zero"),
    "terminal": lambda path: path.symlink_to("/dev/tty"),
    "link to itself": lambda path: path.symlink_to(path),
    "link to a pipe": lambda path: (os.mkfifo(path.with_name("pipe")), path.symlink_to("pipe")),
    "unreadable": lambda path: path.symlink_to("/proc/self/mem"),
    "empty": lambda path: path.write_bytes(b""),
    "zeros": lambda path: path.write_bytes(bytes(5000)),
    "huge": lambda path: (path.touch(), os.truncate(path, HUGE_BYTES)),
}


def first_points(path: Path) -> None:
    with open_cloud(path) as cloud:
        next(cloud.blocks(), None)


def move(path: Path) -> None:
    move_file(path, path.with_name(f"out{path.suffix}"), RigidMotion.of(BASE_T_CAMERA, "mm"))


def settings_beside(fragment: Path) -> Path:
    """An empty settings file, whose fragment this is."""
    file = fragment.parents[1] / "handeyed.toml"
    file.write_text("")
    return file


DOORS: dict[str, tuple[str, Callable[[Path], object], type[Exception] | tuple[type[Exception], ...]]] = {
    "settings": ("a.toml", load_settings, DocumentError),
    "fragment of the settings": ("conf.d/a.toml", lambda path: load_settings(settings_beside(path)), DocumentError),
    "document": ("a.json", lambda path: parse_document(ScanDocument, read_document(path), "a"), DocumentError),
    "session": ("session.json", lambda path: open_session(path.parent), DocumentError),
    "picture of a session": ("a.png", read_grey, ImageError),
    "scan": ("scan.json", lambda path: read_scan(path.parent), (DocumentError, CloudError)),
    "secrets of a webhook": ("a", read_secrets, SecretUnusable),
    "RAPID modules": ("a.mod", lambda path: rapid_modules(path.parent), CommandError),
    **{f"cloud {suffix}": (f"a{suffix}", first_points, CloudError) for suffix in (*PARSERS, *SPECIAL)},
    **{f"moved cloud {suffix}": (f"a{suffix}", move, CloudError) for suffix in (".ply", ".pcd", ".las", ".npy")},
}

HARMLESS = {
    ("RAPID modules", "empty"),
    ("RAPID modules", "zeros"),
    ("secrets of a webhook", "zeros"),
    *((f"cloud {suffix}", kind) for suffix in (".bin", ".f32") for kind in ("empty", "zeros", "huge")),
}
"""What is no fault: any bytes are a cloud of octets, a secret, or a module."""


@pytest.mark.timeout(600)
@pytest.mark.parametrize("kind", HOSTILE)
@pytest.mark.parametrize("door", DOORS)
def test_no_reader_hangs_or_fills_the_memory(tmp_path: Path, door: str, kind: str) -> None:
    name, read, error = DOORS[door]
    (tmp_path / name).parent.mkdir(exist_ok=True)
    HOSTILE[kind](tmp_path / name)
    if (door, kind) in HARMLESS:
        read(tmp_path / name)
        return
    with pytest.raises(error):
        read(tmp_path / name)


@pytest.mark.timeout(600)
@pytest.mark.parametrize("kind", [pytest.param(kind, marks=[pytest.mark.slow] * (kind == "huge")) for kind in HOSTILE])
def test_an_archive_and_a_support_bundle_go_on_beside_it(tmp_path: Path, kind: str) -> None:
    HOSTILE[kind](tmp_path / "a")
    try:
        assert not (RemoteFolder(str(tmp_path)).read("a") or b"").strip(b"\0")
    except (OSError, ArchiveError):
        assert kind not in ("empty", "zeros", "nothing")
    if kind not in ("empty", "zeros", "huge"):
        with pytest.raises(OSError, match=r"^\[Errno"):
            file_hash(tmp_path / "a")
    found = gather(tmp_path / "a", tmp_path / "a").files
    assert len(found["log.txt"]) <= 20_000_000
    assert "could not be gathered" in found["settings.json"] or kind == "empty"


BEYOND = {
    "brackets": "[" * 200_000,
    "braces": '{"a":' * 200_000,
    "digits": "9" * 200_000,
    "closed brackets": "[" * 100_000 + "]" * 100_000,
}


@pytest.mark.parametrize("kind", BEYOND)
def test_a_document_too_deep_or_with_endless_numbers_is_refused(kind: str) -> None:
    for read in (
        lambda text: parse_settings(f"a = {text}".encode(), "a.toml"),
        lambda text: parse_document(ScanDocument, text.encode(), "a.json"),
    ):
        with pytest.raises(DocumentError) as refused:
            read(BEYOND[kind])
        assert len(str(refused.value)) < 400
