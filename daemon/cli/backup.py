"""`handeyed backup` and `handeyed restore`: the store as one tar file."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from daemon.cli.errors import CommandError
from daemon.cli.keys import revoke, valid_keys

Config = Annotated[Path, typer.Argument(help="The daemon's settings.")]


def backup(
    config: Config,
    out: Annotated[Path, typer.Option("--out", "-o", help="The tar file to write; - for standard output.")] = Path(
        "handeyed-backup.tar"
    ),
) -> None:
    """Write the store into one file, while the daemon runs or not. It holds hashes of keys, but no keys."""
    from daemon.config.settings import load_settings
    from daemon.runtime.clock import Clock
    from daemon.store.backup import back_up, write_backup
    from daemon.store.database import storage_errors
    from daemon.store.opening import open_offline

    store = Path(load_settings(config).storage.folder)
    made_at, piped = Clock().timestamp(), str(out) == "-"
    if piped and sys.stdout.isatty():
        raise CommandError("-", "a terminal shows no tar file", "send it on: handeyed backup ... --out - | restic ...")
    with open_offline(store) as database:
        if piped:
            with storage_errors(Path("standard output")):
                write_backup(store, database, sys.stdout.buffer, made_at, store)
                sys.stdout.flush()
            return
        count = back_up(store, database, out, made_at)
    typer.echo(f"{out}: {count} files, {out.stat().st_size / 1e6:.1f} MB")


def restore(
    source: Annotated[Path, typer.Argument(help="A file written by 'handeyed backup'.")],
    config: Config,
    revoke_keys: Annotated[bool, typer.Option(help="Revoke every key that the backup holds.")] = False,
) -> None:
    """Restore a backup into the store's folder of the settings; refused when anything of a store is there.

    Keys that were revoked since the backup was made are valid again, unless you revoke all of them.
    """
    from daemon.config.settings import load_settings
    from daemon.store.opening import require_owner
    from daemon.store.restore import restore as restore_store

    store = Path(load_settings(config).storage.folder)
    require_owner(store)
    count = restore_store(source, store)
    typer.echo(f"{store}: {count} files restored")
    for record in valid_keys(config):
        if revoke_keys:
            revoke(config, record.id)
        else:
            typer.echo(
                f"valid, also if it was revoked since: the {record.role} key {record.id} of {record.name}", err=True
            )
