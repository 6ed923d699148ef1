"""Handlers of the file service."""

from collections.abc import Mapping

from mock_robot.cabinet.disk import Disk, NoVolume
from mock_robot.rws.context import RequestContext
from mock_robot.rws.exchange import DONE, Item, Reply
from mock_robot.rws.refusals import BAD_ARGUMENT, EXISTS, RwsRefused

Parts = Mapping[str, str]


def read_file(context: RequestContext, parts: Parts) -> Reply:
    path, volumes = _path(context, parts), context.world.volumes
    if path in volumes.files:
        return Reply(content=volumes.files[path])
    items = _listing(volumes, path)
    if items is None:
        raise RwsRefused(context.dialect.no_file)
    return Reply(items=items, listed=True)


def write_file(context: RequestContext, parts: Parts) -> Reply:
    """The folder must exist: it is not made."""
    path, files = _path(context, parts), context.world.volumes.files
    context.world.equipment.require("UAS_FTP_WRITE", "UAS_FILE_ACCESS_READ_WRITE")
    if not context.world.volumes.has_folder(path.rpartition("/")[0]):
        raise RwsRefused(context.dialect.no_file)
    status = 200 if path in files else 201
    files[path] = context.asked.body
    return Reply(status)


def make_folder(context: RequestContext, parts: Parts) -> Reply:
    """1.0 names the action in the form, 2.0 in the path."""
    parent, volumes, form = _path(context, parts), context.world.volumes, context.asked.form
    name = form.get("fs-newname", "")
    if not name or "/" in name or (context.dialect.version == 1 and form.get("fs-action") != "create"):
        raise RwsRefused(BAD_ARGUMENT, "Invalid/No Query Parameter")
    if not volumes.has_folder(parent):
        raise RwsRefused(context.dialect.no_file)
    if volumes.has_folder(f"{parent}/{name}") or f"{parent}/{name}" in volumes.files:
        raise RwsRefused(EXISTS)
    volumes.folders.add(f"{parent}/{name}")
    return Reply(201 if context.dialect.version == 1 else 204)


def delete_file(context: RequestContext, parts: Parts) -> Reply:
    path, volumes = _path(context, parts), context.world.volumes
    context.world.equipment.require("UAS_FTP_WRITE", "UAS_FILE_ACCESS_READ_WRITE")
    if volumes.files.pop(path, None) is None and path not in volumes.folders:
        raise RwsRefused(context.dialect.no_file)
    volumes.folders.discard(path)
    return DONE


def _listing(disk: Disk, folder: str) -> list[Item] | None:
    """Entries of a folder; None when it does not exist."""
    if not disk.has_folder(folder):
        return None
    every = {path[len(folder) + 1 :] for path in (*disk.files, *disk.folders) if path.startswith(folder + "/")}
    files = sorted(name for name in every if f"{folder}/{name}" in disk.files and "/" not in name)
    folders = sorted({name.partition("/")[0] for name in every}.difference(files))
    size = {name: str(len(disk.files[f"{folder}/{name}"])) for name in files}
    return [
        *(Item("fs-dir", name, {}) for name in folders),
        *(Item("fs-file", name, {"fs-size": size[name], "fs-readonly": "false"}) for name in files),
    ]


def _path(context: RequestContext, parts: Parts) -> str:
    try:
        return context.world.volumes.canonical(parts["path"])
    except NoVolume:
        raise RwsRefused(context.dialect.no_volume) from None
