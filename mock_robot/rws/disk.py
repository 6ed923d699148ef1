"""Handlers of the file service."""

from collections.abc import Mapping

from mock_robot.rws.context import RequestContext
from mock_robot.rws.exchange import DONE, Reply
from mock_robot.rws.refusals import BAD_ARGUMENT, EXISTS, RwsRefused
from mock_robot.rws.volumes import NoVolume

Parts = Mapping[str, str]


def read_file(context: RequestContext, parts: Parts) -> Reply:
    path, volumes = _path(context, parts), context.world.volumes
    if path in volumes.files:
        return Reply(content=volumes.files[path])
    items = volumes.listing(path)
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


def _path(context: RequestContext, parts: Parts) -> str:
    try:
        return context.world.volumes.canonical(parts["path"])
    except NoVolume:
        raise RwsRefused(context.dialect.no_volume) from None
