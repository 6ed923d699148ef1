"""The nodes of one cell: a VisionSystem of OPC 40100-1, and a flat folder of scalars that a PLC's client can read.

Node ids are strings that never change: NAME, NAME.VisionStateMachine.AutomaticModeStateMachine.StartSingleJob,
NAME.Cell.Ready. Modelled on OPC 40100-1: what differs stands in docs/use/opcua.md.
"""

import asyncio
import json
import logging
from collections.abc import Awaitable, Callable, Mapping
from datetime import UTC, datetime
from typing import Any

from asyncua import Node, Server, ua

from gateways.opcua.cell import Away, Cell, Refusal, quoted
from gateways.opcua.cell_state import RECIPE_OF, RECIPES, RESULT_STATES, SCALARS, CellState, time_of
from gateways.opcua.sessions import session_key
from gateways.opcua.settings import CellSettings

log = logging.getLogger(__name__)

MACHINE_VISION = "http://opcfoundation.org/UA/MachineVision"
CELLS = "urn:handeyed:cells"

VISION_SYSTEM, AUTOMATIC_MODE, STATE_CHANGED, JOB_STARTED, RESULT_READY = 1003, 1021, 1018, 1013, 1024
WARNING, ERROR = 1034, 1035
MANAGEMENT = {"ConfigurationManagement": 1006, "RecipeManagement": 1004, "ResultManagement": 1007}
STATES = {"Preoperational": 5028, "Error": 5030, "Operational": 5031}
AUTOMATIC_STATES = {"Initialized": 5056, "Ready": 5057, "SingleExecution": 5058}
"""Numbers of the nodes of types and states in the nodeset."""

AUTOMATIC = "VisionStateMachine.AutomaticModeStateMachine"
WARNING_SEVERITY, ERROR_SEVERITY = 400, 800
MAX_LISTED = 20
"""Of a list that a method answers: a message has 256 kB at the most."""

STATUS = {
    401: ua.StatusCodes.BadUserAccessDenied,
    403: ua.StatusCodes.BadUserAccessDenied,
    404: ua.StatusCodes.BadNotFound,
    409: ua.StatusCodes.BadInvalidState,
    412: ua.StatusCodes.BadInvalidState,
    422: ua.StatusCodes.BadInvalidArgument,
    429: ua.StatusCodes.BadTooManyOperations,
    502: ua.StatusCodes.BadDeviceFailure,
    503: ua.StatusCodes.BadInvalidState,
}
"""The status of a method by that of the daemon's refusal; the rest is BadUnexpectedError."""

NO_ERROR, NO_HANDLE = ua.Variant(0, ua.VariantType.Int32), ua.Variant(0, ua.VariantType.UInt32)

GIVEN = ("MeasId", "ProductId", "PartId")
"""What a client gives with a job, and gets back with its result: the ticket, and two parts of a scan's name."""


class _Scalar(ua.DataValue):  # type: ignore[misc]
    """A value of the flat folder. Nothing changes it, so that asyncua need not copy it for each subscription."""

    def __deepcopy__(self, memo: dict[int, Any]) -> "_Scalar":
        return self


class VisionSystem:
    """One cell in the address space."""

    def __init__(self, server: Server, settings: CellSettings) -> None:
        self.cell = Cell(settings, self.show, self.send_result)
        self._server = server
        self._variables: dict[str, Node] = {}
        self._events: dict[int, Any] = {}
        self._shown: dict[str, Any] = {}
        self._conditions: dict[str, tuple[str, bool]] = {}
        self._seen: dict[str | None, Mapping[str, str]] = {}
        self._given: dict[str, Mapping[str, Any]] = {}
        self._showing = asyncio.Lock()

    async def build(self) -> None:
        """Make the nodes. The types are loaded before."""
        server, name = self._server, self.cell.name
        self._types = await server.get_namespace_index(MACHINE_VISION)
        self._cells = await server.get_namespace_index(CELLS)
        system = await self._add_object(server.nodes.objects, name, VISION_SYSTEM)
        for part, type_number in MANAGEMENT.items():
            await self._add_object(system, f"{name}.{part}", type_number)
        machine = server.get_node(self._id(f"{name}.VisionStateMachine"))
        await self._add_object(machine, f"{name}.{AUTOMATIC}", AUTOMATIC_MODE)
        for method in await _methods_below(system):
            server.link_method(method, _not_supported)
        for path, called in self._methods().items():
            server.link_method(server.get_node(self._id(f"{name}.{path}")), called)
        folder = await system.add_object(self._id(f"{name}.Cell"), ua.QualifiedName("Cell", self._cells))
        for variable, (kind, what) in SCALARS.items():
            start = {"Boolean": False, "String": "", "Int32": 0, "Double": float("nan")}[kind]
            at, title = self._id(f"{name}.Cell.{variable}"), ua.QualifiedName(variable, self._cells)
            node = self._variables[variable] = await folder.add_variable(at, title, start, ua.VariantType[kind])
            await node.write_attribute(ua.AttributeIds.Description, ua.DataValue(ua.LocalizedText(what, "en")))
        text = ua.NodeId(ua.ObjectIds.String)
        arguments = [_argument("Kind", text, "calibrate, verify or scan"), _argument("Ticket", text, "new for each")]
        await folder.add_method(
            self._id(f"{name}.Cell.Start"), ua.QualifiedName("Start", self._cells), self._start,
            arguments, [_argument("RunId", text, "the run that this ticket started")],
        )  # fmt: skip
        await folder.add_method(self._id(f"{name}.Cell.Abort"), ua.QualifiedName("Abort", self._cells), self._abort)
        for event in (STATE_CHANGED, JOB_STARTED, RESULT_READY, WARNING, ERROR):
            self._events[event] = await server.get_event_generator(ua.NodeId(event, self._types), system)
        await self.show(self.cell.state)

    async def show(self, state: CellState) -> None:
        """Write what has changed, and send its events."""
        async with self._showing:
            before, after = self._shown, state.scalars()
            outer, inner = state.vision_state()
            after |= {"#outer": outer, "#inner": inner}
            for name in SCALARS:
                if name not in before or repr(before[name]) != repr(after[name]):
                    value = ua.Variant(after[name], ua.VariantType[SCALARS[name][0]])
                    await self._variables[name].write_value(_Scalar(value, SourceTimestamp=datetime.now(UTC)))
            if (outer, inner) != (before.get("#outer"), before.get("#inner")):
                await self._show_state("VisionStateMachine", outer, STATES)
                await self._show_state(AUTOMATIC, inner, AUTOMATIC_STATES)
                await self._send(STATE_CHANGED, f"{self.cell.name}: {after['State']} {after['Reason']}".strip())
            self._shown = after
            if after["RunId"] and after["RunId"] != before.get("RunId"):
                await self._send(
                    JOB_STARTED, f"{after['RunKind']} began", JobId=_variant(ua.JobIdDataType(Id=after["RunId"]))
                )
            if before.get("CalibrationId") != after["CalibrationId"]:
                applied_at = ((state.current or {}).get("applied") or {}).get("applied_at")
                node = self._server.get_node(self._id(f"{self.cell.name}.ConfigurationManagement.ActiveConfiguration"))
                await node.write_value(_variant(_configuration(after["CalibrationId"], applied_at)))
            await self._send_conditions(state.conditions)

    async def send_result(self, run: Mapping[str, Any]) -> None:
        """The event of a run that ended."""
        result = self._result_of(run)
        kinds = {"IsPartial": "Boolean", "ResultState": "Int32", "CreationTime": "DateTime", "ResultContent": "Variant"}
        fields = {name: ua.Variant(getattr(result, name), ua.VariantType[kind]) for name, kind in kinds.items()}
        ids = (*GIVEN, "ResultId", "JobId", "InternalRecipeId", "InternalConfigurationId")
        fields |= {name: _variant(getattr(result, name)) for name in ids}  # None as well: asyncua keeps the last one's
        await self._send(RESULT_READY, f"{run['kind']} {run['state']}", **fields)

    def _methods(self) -> dict[str, Callable[..., Awaitable[Any]]]:
        return {
            f"{AUTOMATIC}.StartSingleJob": self._start_single_job,
            f"{AUTOMATIC}.Abort": self._abort,
            f"{AUTOMATIC}.Stop": self._abort,
            "RecipeManagement.GetRecipeListFiltered": self._list_recipes,
            "RecipeManagement.PrepareRecipe": self._prepare_recipe,
            "RecipeManagement.UnprepareRecipe": self._unprepare_recipe,
            "ResultManagement.GetResultById": self._result_by_id,
            "ResultManagement.GetResultListFiltered": self._list_results,
            "ConfigurationManagement.GetConfigurationList": self._list_configurations,
            "ConfigurationManagement.ActivateConfiguration": self._activate,
        }

    async def _start(self, parent: ua.NodeId, kind: ua.Variant, ticket: ua.Variant) -> Any:
        started = self._begin(kind.Value or "", {"MeasId": ua.MeasIdDataType(Id=ticket.Value or "")})
        return await self._answer(started, lambda run_id: [ua.Variant(run_id, ua.VariantType.String)])

    async def _start_single_job(
        self, parent: ua.NodeId, meas_id: ua.Variant, part_id: ua.Variant, recipe_id: ua.Variant,
        product_id: ua.Variant, parameters: ua.Variant,
    ) -> Any:  # fmt: skip
        given = dict(zip(GIVEN, (meas_id.Value, product_id.Value, part_id.Value), strict=True))
        started = self._begin(_id_of(recipe_id.Value), given)
        return await self._answer(started, lambda run_id: [_variant(ua.JobIdDataType(Id=run_id)), NO_ERROR])

    async def _begin(self, kind: str, given: Mapping[str, Any]) -> str:
        ticket, *names = (_id_of(given.get(name)) for name in GIVEN)
        if kind not in RECIPES or not ticket or not (ticket.isascii() and ticket.isprintable()):
            raise Refusal(422, "ticket", "a kind and a new ticket in ASCII are needed", f"kinds: {', '.join(RECIPES)}")
        body = {"name": " ".join(filter(None, names)), "capture": True} if kind == "scan" else {}
        run = await self.cell.start(RECIPES[kind], body, ticket, session_key.get())
        self._given = {**dict(list(self._given.items())[-MAX_LISTED:]), run["id"]: self._given.get(run["id"], given)}
        return str(run["id"])

    async def _abort(self, parent: ua.NodeId, *cause: ua.Variant) -> Any:
        """Also by the specification's two methods, which have a cause and answer an error."""
        return await self._answer(self.cell.abort(session_key.get()), lambda _: [NO_ERROR] if cause else [])

    async def _list_recipes(self, parent: ua.NodeId, *filters: ua.Variant) -> Any:
        return _page([ua.RecipeIdInternalDataType(Id=name) for name in RECIPES], filters[3])

    async def _prepare_recipe(self, parent: ua.NodeId, external: ua.Variant, internal: ua.Variant) -> Any:
        name = _id_of(external.Value) or _id_of(internal.Value)
        if name not in RECIPES:
            return ua.StatusCode(ua.StatusCodes.BadNotFound)
        if not self.cell.state.ready:
            return ua.StatusCode(ua.StatusCodes.BadInvalidState)
        return [_variant(ua.RecipeIdInternalDataType(Id=name)), ua.Variant(True), NO_ERROR]

    async def _unprepare_recipe(self, parent: ua.NodeId, external: ua.Variant, internal: ua.Variant) -> Any:
        name = _id_of(external.Value) or _id_of(internal.Value)
        return [_variant(ua.RecipeIdInternalDataType(Id=name)), NO_ERROR]

    async def _result_by_id(self, parent: ua.NodeId, result_id: ua.Variant, _limit: ua.Variant) -> Any:
        asked = self.cell.get(f"/runs/{quoted(_id_of(result_id.Value))}", session_key.get())
        return await self._answer(asked, lambda run: [NO_HANDLE, _variant(self._result_of(run)), NO_ERROR])

    async def _list_results(self, parent: ua.NodeId, *filters: ua.Variant) -> Any:
        """The newest first; by ResultState and JobId where these are given, the other filters have no match here."""
        state, job = int(filters[0].Value or 0), _id_of(filters[8].Value)

        def pack(answer: Mapping[str, Any]) -> list[ua.Variant]:
            over = [run for run in answer["runs"] if run["over"]]
            wanted = [run for run in over if state in (0, RESULT_STATES[run["state"]]) and job in ("", run["id"])]
            results = [self._result_of(run) for run in wanted]
            return _page(results, filters[9], filters[10], more=answer["next"] is not None)

        return await self._answer(self.cell.get("/runs", session_key.get(), limit=MAX_LISTED), pack)

    async def _list_configurations(self, parent: ua.NodeId, *arguments: ua.Variant) -> Any:
        def pack(answer: Mapping[str, Any]) -> list[ua.Variant]:
            applied = (self.cell.state.current or {}).get("applied")
            self._seen[session_key.get()] = {"If-Match": f'"applied-{applied["sequence"]}"'} if applied else {}
            listed = [_configuration(one["id"], one["created_at"]) for one in answer["calibrations"]]
            return _page(listed, arguments[0], arguments[1], more=answer["next"] is not None)

        return await self._answer(self.cell.get("/calibrations", session_key.get(), limit=MAX_LISTED), pack)

    async def _activate(self, parent: ua.NodeId, internal_id: ua.Variant) -> Any:
        """Unless another one is active than when this key listed them last."""
        path, key = f"/calibrations/{quoted(_id_of(internal_id.Value))}/apply", session_key.get()
        applied = self.cell.post(path, key, {"applied_by": "OPC UA"}, self._seen.get(key, {}))
        return await self._answer(applied, lambda _: [NO_ERROR])

    async def _answer(self, request: Awaitable[Any], outputs: Callable[[Any], list[ua.Variant]]) -> Any:
        """The output arguments of a method, or the status of a refusal, which the log has in words."""
        try:
            return outputs(await request)
        except Refusal as refusal:
            log.warning("%s: refused: %s", self.cell.name, refusal)
            return ua.StatusCode(STATUS.get(refusal.status, ua.StatusCodes.BadUnexpectedError))
        except Away as away:
            log.warning("%s", away)
            return ua.StatusCode(ua.StatusCodes.BadCommunicationError)

    def _result_of(self, run: Mapping[str, Any]) -> Any:
        return ua.ResultDataType(
            ResultId=ua.ResultIdDataType(Id=run["id"]),
            IsPartial=not run["over"],
            ResultState=RESULT_STATES.get(run["state"], 2),
            JobId=ua.JobIdDataType(Id=run["id"]),
            CreationTime=time_of(run["updated_at"]),
            InternalRecipeId=ua.RecipeIdInternalDataType(Id=RECIPE_OF.get(run["kind"], run["kind"])),
            InternalConfigurationId=ua.ConfigurationIdDataType(Id=self._shown.get("CalibrationId", "")),
            ResultContent=[ua.Variant(_content(run), ua.VariantType.String)],
            **self._given.get(run["id"], {}),
        )

    async def _show_state(self, machine: str, state: str, numbers: Mapping[str, int]) -> None:
        current = f"{self.cell.name}.{machine}.CurrentState"
        await self._server.get_node(self._id(current)).write_value(ua.LocalizedText(state, "en"))
        number = ua.NodeId(numbers[state], self._types)
        await self._server.get_node(self._id(f"{current}.Id")).write_value(ua.Variant(number, ua.VariantType.NodeId))

    async def _send_conditions(self, conditions: dict[str, tuple[str, bool]]) -> None:
        for code in self._conditions.keys() | conditions.keys():
            if self._conditions.get(code) != conditions.get(code):
                text, is_error = conditions.get(code) or self._conditions[code]
                stops = ua.Variant(is_error and self._shown["#outer"] == "Error")  # OPC 40100-1, 11.4.4.3
                await self._send(
                    ERROR if is_error else WARNING,
                    text,
                    NodeId=ua.Variant(self._id(f"{self.cell.name}.Conditions.{code}"), ua.VariantType.NodeId),
                    ConditionName=ua.Variant(code, ua.VariantType.String),
                    Retain=ua.Variant(code in conditions, ua.VariantType.Boolean),
                    **dict.fromkeys(("StopReaction", "BlockReaction"), stops),
                    Severity=ua.Variant(ERROR_SEVERITY if is_error else WARNING_SEVERITY, ua.VariantType.UInt16),
                )
        self._conditions = conditions

    async def _send(self, kind: int, text: str, **fields: ua.Variant) -> None:
        """Send an event; optional fields of its type have no type of their own before they have a value."""
        event = self._events[kind]
        for name, value in fields.items():
            event.event.add_property(name, value.Value, value.VariantType)
        await event.trigger(message=text)

    async def _add_object(self, parent: Node, node_id: str, kind: int) -> Node:
        """An object with the mandatory parts of its type; `kind`: the type's number."""
        name = ua.QualifiedName(node_id.rpartition(".")[2], self._types if "." in node_id else self._cells)
        return await parent.add_object(self._id(node_id), name, ua.NodeId(kind, self._types), False)

    def _id(self, name: str) -> ua.NodeId:
        return ua.NodeId(name, self._cells)


async def _not_supported(parent: ua.NodeId, *arguments: ua.Variant) -> ua.StatusCode:
    return ua.StatusCode(ua.StatusCodes.BadNotSupported)


async def _methods_below(node: Node) -> list[Node]:
    methods: list[Node] = await node.get_methods()
    for child in await node.get_children(nodeclassmask=ua.NodeClass.Object):
        methods += await _methods_below(child)
    return methods


def _argument(name: str, data_type: ua.NodeId, what: str) -> ua.Argument:
    return ua.Argument(Name=name, DataType=data_type, ValueRank=-1, Description=ua.LocalizedText(what, "en"))


def _id_of(value: Any) -> str:
    """The Id of a structure of the specification; "" without one."""
    return str(getattr(value, "Id", None) or "")


def _configuration(calibration_id: str, modified: str | None) -> Any:
    at = time_of(modified) if modified else datetime(1601, 1, 1, tzinfo=UTC)
    return ua.ConfigurationDataType(
        InternalId=ua.ConfigurationIdDataType(Id=calibration_id),
        LastModified=at,
        HasTransferableDataOnFile=False,
    )


def _variant(value: Any) -> ua.Variant:
    return ua.Variant(value, ua.VariantType.ExtensionObject)


def _page(found: list[Any], most: ua.Variant, start: ua.Variant = NO_HANDLE, more: bool = False) -> list[ua.Variant]:
    """IsComplete, ResultCount, a handle, a page of the list, Error. `most`: 0 for any; `more` were not asked for."""
    first, page_size = int(start.Value or 0), min(int(most.Value or MAX_LISTED), MAX_LISTED)
    complete, page = not more and first + page_size >= len(found), found[first:][:page_size]
    count = ua.Variant(len(page), ua.VariantType.UInt32)
    listed = ua.Variant(page, ua.VariantType.ExtensionObject, is_array=True)
    return [ua.Variant(complete), count, NO_HANDLE, listed, NO_ERROR]


def _content(run: Mapping[str, Any]) -> str:
    """The run's result as JSON, with its state and cause."""
    return json.dumps({name: run.get(name) for name in ("id", "kind", "state", "cause", "result", "links")})
