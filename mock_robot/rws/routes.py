"""Routes of both services: method, path, action, handler. 1.0 names actions in `?action=`, 2.0 in the path."""

import re
from collections.abc import Callable, Mapping
from functools import partial

from mock_robot.rws import acting, reading, refusals
from mock_robot.rws.context import RequestContext
from mock_robot.rws.exchange import DONE, Reply
from mock_robot.rws.refusals import RwsRefused

Handler = Callable[[RequestContext, Mapping[str, str]], Reply | None]
Row = tuple[str, str, str | None, Handler]

_UNIT = "/rw/motionsystem/mechunits/(?P<mechunit>[^/]+)"
_CFG_DOMAIN = "/rw/cfg/(?P<domain>[A-Za-z]+)"
_CFG_TYPE = f"{_CFG_DOMAIN}/(?P<type>[A-Za-z_0-9]+)"
_TASK = "/rw/rapid/tasks/(?P<task>[^/]+)"

_SHARED: tuple[Row, ...] = (
    ("GET", "/rw/panel/opmode", None, reading.operating_mode),
    ("GET", "/rw/panel/speedratio", None, reading.speed_ratio),
    ("POST", "/rw/panel/speedratio", "setspeedratio", acting.set_speed_ratio),
    ("GET", "/rw/motionsystem", None, reading.motion_system),
    ("GET", "/rw/motionsystem/mechunits", None, reading.mechunits),
    ("GET", _UNIT, None, reading.mechunit),
    ("GET", f"{_UNIT}/robtarget", None, reading.robtarget),
    ("GET", f"{_UNIT}/cartesian", None, reading.cartesian),
    ("GET", f"{_UNIT}/jointtarget", None, reading.jointtarget),
    ("GET", f"{_UNIT}/baseframe", None, reading.base_frame),
    ("GET", f"{_CFG_TYPE}/instances", None, reading.configuration),
    ("DELETE", f"{_CFG_TYPE}/instances/(?P<instance>.+)", None, acting.delete_instance),
    ("GET", "/rw/rapid/execution", None, reading.execution),
    ("GET", "/rw/rapid/tasks", None, reading.tasks),
    ("GET", "/rw/iosystem/signals", None, reading.signals),
    ("GET", "/rw/iosystem/signals/(?P<signal>.+)", None, reading.signal),
    ("GET", "/rw/elog/0", None, reading.event_log),
    ("GET", "/rw/system", None, reading.system),
    ("GET", "/rw/system/options", None, reading.options),
    ("GET", "/ctrl/identity", None, reading.identity),
    ("GET", r"/ctrl/\$RAMDISK", None, reading.ramdisk),
    ("GET", "/ctrl/clock", None, reading.clock),
    ("GET", "/ctrl/network", None, reading.network),
    ("GET", r"/progress/(?P<number>\d+)", None, reading.progress),
    ("POST", "/users/rmmp", None, acting.ask_consent),
    ("POST", "/users/rmmp", "cancel", acting.cancel_consent),
    ("GET", "/users/rmmp/poll", None, acting.poll_consent),
    ("GET", "/rw/mastership", None, reading.masterships),
    ("GET", "/rw/mastership/(?P<domain>[a-z]+)", None, acting.mastership),
    ("GET", "/fileservice/(?P<path>.+)", None, acting.read_file),
    ("PUT", "/fileservice/(?P<path>.+)", None, acting.write_file),
    ("DELETE", "/fileservice/(?P<path>.+)", None, acting.delete_file),
)
_FIRST: tuple[Row, ...] = (
    ("GET", "/users/grants", None, reading.grants),
    ("POST", "/ctrl/backup", "backup", acting.back_up),
    ("POST", "/rw/cfg", "load", acting.load_configuration),
    ("POST", _CFG_DOMAIN, "saveas", acting.save_configuration),
    ("GET", "/rw/panel/ctrlstate", None, reading.controller_state),
    ("POST", "/rw/panel/ctrlstate", "setctrlstate", acting.set_controller_state),
    ("POST", "/fileservice/(?P<path>.+)", None, acting.make_folder),
    ("POST", "/rw/rapid/execution", "start", acting.start),
    ("POST", "/rw/rapid/execution", "stop", acting.stop),
    ("POST", "/rw/rapid/execution", "resetpp", acting.reset_pointer),
    ("POST", _TASK, "activate", partial(acting.select, active=True)),
    ("POST", _TASK, "deactivate", partial(acting.select, active=False)),
    ("POST", _TASK, "loadmod", acting.load_module),
    ("POST", _TASK, "unloadmod", acting.unload_module),
    ("GET", "/rw/rapid/modules", None, reading.modules),
    ("GET", f"{_TASK}/modules/(?P<module>[^/]+)", None, reading.module),
    ("GET", "/rw/rapid/symbol/data/RAPID/(?P<symbol>.+)", None, reading.symbol_value),
    ("POST", "/rw/rapid/symbol/data/RAPID/(?P<symbol>.+)", "set", acting.write_symbol),
    ("GET", "/rw/rapid/symbol/properties/RAPID/(?P<symbol>.+)", None, reading.symbol_properties),
    ("POST", "/rw/iosystem/signals/(?P<signal>.+)", "set", acting.write_signal),
    ("POST", "/rw/mastership(?:/(?P<domain>[a-z]+))?", "request", acting.request_mastership),
    ("POST", "/rw/mastership(?:/(?P<domain>[a-z]+))?", "release", acting.release_mastership),
)
_SECOND: tuple[Row, ...] = (
    ("GET", "/uas/user/grants", None, reading.grants),
    ("POST", "/ctrl/backup/create", None, acting.back_up),
    ("POST", "/rw/cfg/load", None, acting.load_configuration),
    ("POST", f"{_CFG_DOMAIN}/saveas", None, acting.save_configuration),
    ("GET", "/rw/panel/ctrl-state", None, reading.controller_state),
    ("POST", "/rw/panel/ctrl-state", None, acting.set_controller_state),
    ("POST", "/fileservice/(?P<path>.+)/create", None, acting.make_folder),
    ("POST", "/rw/rapid/execution/start", None, acting.start),
    ("POST", "/rw/rapid/execution/stop", None, acting.stop),
    ("POST", "/rw/rapid/execution/resetpp", None, acting.reset_pointer),
    ("POST", "/rw/rapid/tasks/activate", None, partial(acting.select, active=True)),
    ("POST", "/rw/rapid/tasks/deactivate", None, partial(acting.select, active=False)),
    ("POST", f"{_TASK}/loadmod", None, acting.load_module),
    ("POST", f"{_TASK}/unloadmod", None, acting.unload_module),
    ("GET", f"{_TASK}/modules", None, reading.modules),
    ("GET", f"{_TASK}/modules/(?P<module>[^/]+)", None, reading.module),
    ("GET", "/rw/rapid/symbol/RAPID/(?P<symbol>.+)/data", None, reading.symbol_value),
    ("POST", "/rw/rapid/symbol/RAPID/(?P<symbol>.+)/data", None, acting.write_symbol),
    ("GET", "/rw/rapid/symbol/RAPID/(?P<symbol>.+)/properties", None, reading.symbol_properties),
    ("POST", "/rw/iosystem/signals/(?P<signal>.+)/set-value", None, acting.write_signal),
    ("POST", "/rw/mastership(?:/(?P<domain>edit|motion))?/request", None, acting.request_mastership),
    ("POST", "/rw/mastership(?:/(?P<domain>edit|motion))?/release", None, acting.release_mastership),
    ("POST", "/rw/mastership/watchdog", None, acting.nothing_to_do),
    ("POST", "/rw/infostream/disconnectclient", None, acting.nothing_to_do),
    ("POST", "/rw/_istream/streamdisconnect", None, acting.nothing_to_do),
)


ROUTES = {
    version: tuple((method, re.compile(path), verb, handler) for method, path, verb, handler in rows)
    for version, rows in ((1, (*_SHARED, *_FIRST)), (2, (*_SHARED, *_SECOND)))
}


def answer_request(context: RequestContext) -> Reply:
    """Find the handler in its version of the services and call it. Raises RwsRefused."""
    asked, known = context.asked, False
    for method, pattern, verb, handler in ROUTES[context.version]:
        match = pattern.fullmatch(asked.path)
        if match is None or method != asked.method:
            continue
        known = True
        if method != "POST" or verb == asked.action:
            return handler(context, match.groupdict()) or DONE
    raise RwsRefused(refusals.BAD_ARGUMENT if known else refusals.NO_RESOURCE, "Invalid action" if known else None)
