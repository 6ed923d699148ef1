"""POST /register: transform a cloud into the robot's base frame."""

from typing import Annotated

from fastapi import Query, Request, Response

from calibration.errors import DocumentError
from calibration.transforms import Array
from daemon.api.dependencies import App, api_router, in_content
from daemon.api.streaming.cloud_request import (
    CLOUD_CONTENT,
    TAKES_A_CLOUD,
    Beside,
    ForceQuery,
    PoseQuery,
    UnitQuery,
    arm_headers,
    flange_pose_of,
    media_type_of,
)
from daemon.api.streaming.cloud_response import CloudResponse, TemporaryFileResponse
from daemon.api.streaming.request_body import body_chunks, lend_body
from daemon.config.settings import MAIN_SCANNER
from daemon.errors import CalibrationUnusable
from daemon.scans.upload import NPZ, PLY, WHOLE
from registration.io.stream import CloudStream

router = api_router(tags=["register"])

Sensor = Annotated[str | None, Query(min_length=1, max_length=255, description="name of a sensor of the active rig")]
Which = Annotated[str, Query(max_length=64, description="'current', or a calibration's id")]


@router.post(
    "/register", openapi_extra=TAKES_A_CLOUD,
    **in_content("The cloud in the base frame, mm", CLOUD_CONTENT, 403, 404, 409, 413, 415, 422, 502, 503, 504, 507),
)  # fmt: skip
async def register(
    request: Request,
    app: App,
    pose: PoseQuery,
    beside: Beside,
    unit: UnitQuery = "mm",
    calibration: Which = "current",
    scanner: Sensor = None,
    force: ForceQuery = False,
) -> Response:
    """The cloud in the robot's base frame, in mm, in the format it came in, answered while it still comes in.

    Where the errors of the arm are active the flange is where the arm as built has it: `Handeyed-Arm: as-built`, with
    one standard deviation of a point there (`Handeyed-Point-Sigma-Mm`) and whether the joints are within the range of
    the session (`Handeyed-Joints-Seen`). A
    given pose without `joints` gets them by inverse kinematics, with `Handeyed-Warning: pose-without-joints`.
    A cloud of which every point is nearer than the scanner sees or farther than scanner or arm reach (1 mm and 20 m
    where neither is known) is refused without `force`; one without finite points has `Handeyed-Warning: no-points`.
    With `scanner` by that sensor of the active rig (POST /rigs), named by Handeyed-Rig, and the reported pose; a
    scanner of the settings that gives its camera_T_scanner goes by the calibration of its camera.
    """
    media_type = media_type_of(request)
    by_rig = scanner is not None and (scanner not in app.settings.scanners or app.settings.placed_by_rig(scanner))
    if by_rig and calibration != "current":
        fix = "leave it out, or leave scanner out"
        raise DocumentError.one("query", "calibration", "a sensor of a rig needs none", fix)
    if by_rig:
        assert scanner is not None
        if app.settings.robot.external_axis is not None:
            what = "a rig is placed without the external axis that [robot.external_axis] declares"
            raise CalibrationUnusable(what, f"give [scanners.{scanner}] camera_T_scanner, and leave the rig out")
        at = await flange_pose_of(app, pose, beside)
        sensors, base_T_flange = app.operations.further_sensors(app.operations), at.base_T_flange.transform()
        rig_id, base_T_scanner = await sensors.base_T_sensor(scanner, base_T_flange)
        named = {"Handeyed-Rig": rig_id}
    else:
        by_name = scanner or MAIN_SCANNER
        camera = app.settings.camera_beside(by_name) if app.settings.cameras else None
        used = await app.operations.calibrations.in_use(await app.operations.calibrations.find(calibration, camera))
        at = await flange_pose_of(app, pose, beside)

        def place() -> tuple[Array, dict[str, str]]:
            return app.scans.base_T_scanner(used, at, by_name), arm_headers(used, [at])

        as_drawn = used.arm is None  # then no inverse kinematics hold the event loop up
        base_T_scanner, of_arm = place() if as_drawn else await app.service_workers.run(place)
        named = {"Handeyed-Calibration": used.document.id, **of_arm}
    numbers = (*at.base_T_flange.translation_mm, *at.base_T_flange.quaternion_wxyz)
    check = None if force else app.scans.range_check(unit, scanner or MAIN_SCANNER)
    headers = {"Handeyed-Pose": ",".join(f"{x!r}" for x in numbers), **named}
    if media_type in WHOLE:  # their index is at the end, so they cannot be streamed
        lend_body(request.scope)
        file, points = await app.scans.transform_cloud(
            body_chunks(request.receive), media_type, unit, base_T_scanner, check
        )
        if not points:
            headers["Handeyed-Warning"] = ", ".join(filter(None, [headers.get("Handeyed-Warning"), "no-points"]))
        app.metrics.registered_points += points
        app.metrics.registered_bytes += file.stat().st_size
        return TemporaryFileResponse(file, media_type=PLY if media_type == NPZ else media_type, headers=headers)
    stream = CloudStream.of_body(media_type, base_T_scanner, unit, check)
    return CloudResponse(stream, media_type, headers, app.store.folder, app.metrics.count_cloud)
