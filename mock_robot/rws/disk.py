"""Handlers of the file service."""

from collections.abc import Mapping

from mock_robot.rws.context import RequestContext
from mock_robot.rws.exchange import DONE, Reply
from mock_robot.rws.refusals import RwsRefused
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
    path, files = _path(context, parts), context.world.volumes.files
    status = 200 if path in files else 201
    files[path] = context.asked.body
    return Reply(status)


def delete_file(context: RequestContext, parts: Parts) -> Reply:
    if context.world.volumes.files.pop(_path(context, parts), None) is None:
        raise RwsRefused(context.dialect.no_file)
    return DONE


def _path(context: RequestContext, parts: Parts) -> str:
    try:
        return context.world.volumes.canonical(parts["path"])
    except NoVolume:
        raise RwsRefused(context.dialect.no_volume) from None
