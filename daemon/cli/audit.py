"""`handeyed audit verify`: check the audit log's hash chain."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import CommandError, ExitStatus, UnreadableInput
from daemon.cli.output import CommandGroup, Json, print_answer

if TYPE_CHECKING:
    from daemon.access.audit_chain import AuditAnchor

app = typer.Typer(
    cls=CommandGroup, name="audit", no_args_is_help=True, help="The audit log: check that it is unchanged."
)


@app.command()
def verify(
    config: Annotated[Path, typer.Argument(help="The daemon's settings.")],
    anchor: Annotated[
        list[str] | None,
        typer.Option(
            help="ROW:HASH noted earlier, from the daemon's log or by you; the log must still hold it. May be repeated."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Check that no row was edited, removed or reordered, and that the end is not cut off.

    Exit status: 0 the log is whole, 1 it is not.
    """
    from daemon.config.settings import load_settings
    from daemon.store.audit_log import check_audit_log
    from daemon.store.database import DATABASE_NAME

    database = Path(load_settings(config).storage.folder) / DATABASE_NAME
    rows, found = check_audit_log(database, [_anchor(text) for text in anchor or []])
    words = "\n".join(found) or f"the audit log is whole: {rows} rows"
    print_answer(json, {"rows": rows, "whole": not found, "flaws": found}, words)
    raise typer.Exit(ExitStatus.FAILED if found else ExitStatus.OK)


@app.command()
def acknowledge(config: Annotated[Path, typer.Argument(help="The daemon's settings.")]) -> None:
    """Accept that the log is not whole, with the service stopped: what is wrong is written into it, as a row of yours.

    The anchor that is not met is kept as audit-anchor.json.unmet. Exit status: 0 accepted, or the log is whole.
    """
    import getpass

    from daemon.config.settings import load_settings
    from daemon.runtime.clock import Clock
    from daemon.store import audit_log, consistency
    from daemon.store.actor import AuditContext
    from daemon.store.database import DATABASE_NAME
    from daemon.store.opening import open_despite_faults, require_owner

    folder = Path(load_settings(config).storage.folder)
    require_owner(folder)
    if (damage := consistency.find_damage(folder / DATABASE_NAME)) is not None:
        raise CommandError(str(folder), damage.what, damage.fix)
    with open_despite_faults(folder) as database:
        if consistency.find_fault(database.path) is None:
            typer.echo("the audit log is whole: there is nothing to accept")
            return
        context = AuditContext(getpass.getuser(), "command line")
        flaws, aside = audit_log.acknowledge(database, context, Clock().timestamp())
    typer.echo("\n".join(("accepted, and noted in the log:", *flaws)))
    if aside is not None:
        typer.echo(f"the anchor that is not met is kept: {aside}")


def _anchor(text: str) -> "AuditAnchor":
    from daemon.access.audit_chain import AuditAnchor

    sequence, _, digest = text.partition(":")
    if not (sequence.isdigit() and len(digest) == 64):
        raise UnreadableInput("--anchor", f"{text[:80]!r} is not ROW:HASH", "copy it from the daemon's log")
    return AuditAnchor(int(sequence), digest.lower())
