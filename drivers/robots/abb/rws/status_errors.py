"""Maps an error response (ABB's code, HTTP status) to a driver error, in one table."""

from drivers.errors import DeviceError, DeviceUnreachable, GarbledAnswer, RequestRefused

WHAT_TO_DO: dict[int, tuple[str, str, str]] = {
    -1073445862: ("MASTERSHIP_HELD", "somebody else holds the mastership", "let them release it, then ask again"),
    -1073445859: ("MASTERSHIP_MISSING", "it needs mastership", "nothing else may hold it; in manual mode grant RMMP"),
    -1073445881: (
        "REJECTED",
        "the controller rejects it in this mode",
        "switch to automatic, or grant it at the pendant",
    ),
    -1073445867: ("USER_NOT_ALLOWED", "the user may not do that", "give the user the grant in the controller's UAS"),
    -1073414146: ("NOT_FOUND", "the controller has no such resource", "check mechunit, task and file names"),
    -1073442816: ("NOT_FOUND", "the controller has no such symbol or module", "check the name"),
    -1073442813: ("NOT_FOUND", "the controller has no such module", "check the name"),
    -1073442809: ("WRONG_STATE", "not in the state the controller is in", "stop the program, or switch the motors on"),
    -1073445879: ("BAD_ARGUMENT", "the controller does not take an argument", "check tool, work object and frame"),
    -1073438713: ("NOT_FOUND", "the controller has no such file", "check the path"),
    -1073438708: ("NOT_FOUND", "the controller has no such file", "check the path"),
}
BY_STATUS: dict[int, tuple[str, str, str]] = {
    401: ("UNAUTHORIZED", "user or password is refused", "write rws://user:password@host, or password_file"),
    403: ("FORBIDDEN", "the user may not do that", "give the user the grant in the controller's UAS"),
    404: ("NOT_FOUND", "the controller has no such resource", "check mechunit and the version of RobotWare"),
    406: ("NOT_ACCEPTABLE", "no media type of ours will do", "set version= in the address to the controller's"),
    410: (
        "GONE",
        "this RobotWare has moved it: RobotWare 8 has no mastership any more, but write access of a control station",
        "load the modules with RobotStudio or at the pendant; reading, stopping and copying files work",
    ),
    415: ("UNSUPPORTED_MEDIA", "no media type of ours will do", "set version= in the address to the controller's"),
}
TOO_MANY = "its 70 sessions are taken, or it is asked more than 20 times a second"


def error_of_response(device: str, doing: str, status: int, code: int | None, message: str) -> DeviceError:
    """The error for a response with that HTTP status."""
    if status == 503:
        return DeviceUnreachable(
            device, f"{doing}: it answers 503, {TOO_MANY}", "close other clients of its web services"
        )
    if status >= 500:
        return DeviceUnreachable(
            device, f"{doing}: it answers {status}", "look at the controller; restart it if it stays"
        )
    row = (WHAT_TO_DO.get(code or 0) if status in (400, 403, 404) else None) or BY_STATUS.get(status)
    if row is None:
        what = f"{doing}: it answers {status}"
        return GarbledAnswer(device, what, "check that Robot Web Services listen at this address")
    name, what, fix = row
    said = f" ({message or code})" if code else ""
    return RequestRefused(device, f"{doing} was refused, {what}{said}", fix, name)
