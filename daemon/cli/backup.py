"""`handeyed backup` and `handeyed restore`: the store as one tar file."""

from pathlib import Path
from typing import Annotated

import typer

Config = Annotated[Path, typer.Argument(help="The daemon's settings.")]


def backup(
    config: Config,
    out: Annotated[Path, typer.Option("--out", "-o", help="The tar file to write.")] = Path("handeyed-backup.tar"),
) -> None:
    """Write the store into one file, while the daemon runs or not. It holds hashes of keys, but no keys."""
    from daemon.config.settings import load_settings
    from daemon.runtime.clock import Clock
    from daemon.store.backup import back_up
    from daemon.store.offline import open_offline

    store = Path(load_settings(config).storage.folder)
    with open_offline(store) as database:
        count = back_up(store, database, out, Clock().timestamp())
    typer.echo(f"{out}: {count} files, {out.stat().st_size / 1e6:.1f} MB")


def restore(
    source: Annotated[Path, typer.Argument(help="A file written by 'handeyed backup'.")],
    config: Config,
) -> None:
    """Restore a backup into the store's folder of the settings; refused when a store exists there."""
    from daemon.config.settings import load_settings
    from daemon.store.backup import restore as restore_store

    store = Path(load_settings(config).storage.folder)
    count = restore_store(source, store)
    typer.echo(f"{store}: {count} files restored")
