"""`handeyed keys ...`: manage API keys. Changes take effect in a running daemon at once."""

import getpass
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from daemon.cli.errors import UnreadableInput
from daemon.cli.output import CommandGroup, Json, print_answer

if TYPE_CHECKING:
    from daemon.access.keys import KeyRecord
    from daemon.store.access_keys import KeyService

Answer = TypeVar("Answer")

app = typer.Typer(
    cls=CommandGroup,
    name="keys",
    no_args_is_help=True,
    help="Add, list, rotate and revoke keys: viewer, operator or admin.",
)

Config = Annotated[Path, typer.Argument(help="The daemon's settings.")]
Name = Annotated[str, typer.Argument(help="Whose key: a person's or a system's name, or a key's id.")]
Days = Annotated[float, typer.Option(help="Days of validity; 0: until revoked.", min=0, max=36_500)]


@app.command()
def add(
    config: Config,
    name: Name,
    role: Annotated[str, typer.Option(help="viewer, operator or admin.")] = "operator",
    days: Days = 365,
    json: Json = False,
) -> None:
    """Make a key. It is shown only once; its hash is stored. With the first key, requests without one are refused."""
    from daemon.access.roles import ROLES

    if role not in ROLES:
        raise UnreadableInput("--role", f"{role[:40]!r} is no role", f"use {', '.join(ROLES)}")
    from daemon.access.actor_names import validate_key_name

    try:
        validate_key_name(name)
    except ValueError as error:
        what, _, fix = str(error).rpartition("; ")
        raise UnreadableInput("NAME", what, fix) from None
    key, record = _with_key_service(config, lambda service: service.add(name, ROLES[role], _me(), days or None))
    _show(key, record, json)


@app.command("list")
def list_keys(config: Config, json: Json = False) -> None:
    """List all keys, also expired and revoked ones, by id, role and name."""
    from daemon.runtime.clock import Clock

    now = Clock().timestamp()
    records = _with_key_service(config, lambda service: service.keys.all())
    rows = [{**{k: v for k, v in vars(r).items() if k != "hash"}, "state": r.state(now)} for r in records]
    none = "there are no keys: the service lets only root and its group move the arm, a daemon started by hand anybody"
    lines = (f"{r.id}  {r.role:<9}{r.state(now):<8}  {_until(r):<31}  {r.name}" for r in records)
    print_answer(json, rows, "\n".join(lines) or none)


@app.command()
def rotate(
    config: Config,
    name: Name,
    days: Days = 365,
    overlap_h: Annotated[float, typer.Option(help="Hours that the old key stays valid.", min=0, max=8760)] = 24.0,
    json: Json = False,
) -> None:
    """Make a new key of the same name and role; the old one expires after the overlap."""
    key, record = _with_key_service(config, lambda service: service.rotate(name, _me(), days or None, overlap_h))
    _show(key, record, json)


@app.command()
def revoke(config: Config, name: Name) -> None:
    """Revoke every valid key of that name at once."""
    ids = _with_key_service(config, lambda service: service.revoke(name, _me()))
    typer.echo(f"revoked: {', '.join(ids)}")


def valid_keys(config: Path) -> "list[KeyRecord]":
    from daemon.runtime.clock import Clock

    now = Clock().timestamp()
    return [record for record in _with_key_service(config, lambda service: service.keys.all()) if record.valid(now)]


def _with_key_service(config: Path, work: "Callable[[KeyService], Coroutine[Any, Any, Answer]]") -> Answer:
    import asyncio

    from daemon.config.settings import load_settings
    from daemon.runtime.clock import Clock
    from daemon.store.access_keys import AccessKeys, KeyService
    from daemon.store.opening import open_offline

    with open_offline(Path(load_settings(config).storage.folder)) as database:
        return asyncio.run(work(KeyService(AccessKeys(database), Clock())))


def _me() -> Any:
    from daemon.store.actor import AuditContext

    return AuditContext(getpass.getuser(), "command line")


def _show(key: str, record: "KeyRecord", json: bool) -> None:
    shown = {"key": key, "id": record.id, "name": record.name, "role": record.role}
    print_answer(json, {**shown, "expires_at": record.expires_at}, key)
    if not json:
        how = "Send it as 'Authorization: Bearer KEY'; commands take it from HANDEYED_KEY."
        typer.echo(f"{record.role} key of {record.name}, {_until(record)}; it is shown this once. {how}", err=True)


def _until(record: "KeyRecord") -> str:
    return f"until {record.expires_at}" if record.expires_at else "without end"
