"""Error replies of the controllers: HTTP status, ABB code and text in one table."""

from dataclasses import dataclass


class RwsRefused(Exception):
    """An error reply. `status` is HTTP's, `code` is ABB's."""

    def __init__(self, refusal: "Refusal", text: str | None = None) -> None:
        self.status, self.code = refusal.status, refusal.code
        self.text = f"{text or refusal.text} code:{refusal.code} icode:-1"
        super().__init__(self.text)


@dataclass(frozen=True)
class Refusal:
    status: int
    code: int
    text: str


HELD_BY_ANOTHER = Refusal(403, -1073445862, "Requested resource is held by someone else")
NO_MASTERSHIP = Refusal(403, -1073445859, "The user does not have required mastership for the operation")
NO_GRANT = Refusal(403, -1073445867, "Operation not allowed for user")
REJECTED = Refusal(403, -1073445881, "Rejected")
NO_SIGNAL = Refusal(404, -1073445866, "Invalid IO signal name passed in the uri")
NO_RESOURCE = Refusal(404, -1073414146, "Resource not found")
NO_SYMBOL = {1: Refusal(400, -1073414146, "Symbol not found"), 2: Refusal(404, -1073442816, "Symbol not found")}
"""By the version of the services, as all of these tables."""
NO_MODULE = Refusal(400, -1073442816, "Module not found")
NO_MODULE_2 = Refusal(400, -1073442813, "Module not found")
WRONG_STATE = Refusal(400, -1073442809, "Operation not allowed in the current state")
BAD_ARGUMENT = Refusal(400, -1073445879, "Invalid argument value")
NO_FILE = {
    1: Refusal(404, -1073414146, "File or directory does not exist"),
    2: Refusal(404, -1073438713, "Path does not exist"),
}
NO_VOLUME = {1: NO_FILE[1], 2: Refusal(400, -1073438716, "Virtual root does not exist")}
EXISTS = Refusal(409, -1073438712, "Directory already exists")
NO_PATH = Refusal(400, -1073438708, "Path to the module is missing or does not exist")
NOT_ACCEPTABLE = Refusal(406, -1073445879, "Accept must name a media type with v=2.0")
UNSUPPORTED_MEDIA = Refusal(415, -1073445879, "Content-Type must be application/x-www-form-urlencoded;v=2.0")
LIFO_IN_2_0 = Refusal(400, -1073445879, "LIFO is not supported in v=2.0")
GONE = Refusal(410, -1073445879, "Mastership is replaced by the control station service")
NO_INSTANCE_1 = Refusal(400, -1073414146, "Unknown instance")
