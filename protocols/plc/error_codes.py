"""Error codes as numbers for a PLC. A number is never reused for another error."""

NO_ERROR = 0
UNKNOWN = 999
"""An error without a number: the log and the REST interface have its message."""

ABORTED = "the run was stopped by somebody, or is not begun because a PLC holds abort: clear abort, then trigger again"

ERROR_CODES: dict[str, tuple[int, str]] = {
    # the PLC itself
    "plc-trigger-ambiguous": (1, "two triggers rose at once: set one of them"),
    "plc-motion-not-allowed": (2, "[plc] motion = true is not set: the PLC may not move the arm"),
    "plc-silent": (3, "heartbeat_in has not changed in time"),
    "plc-not-online": (4, "the daemon is not ready for triggers yet"),
    "plc-result-pending": (5, "the last result has not been acknowledged: read it, then pulse results_ack"),
    # refused now
    "run-in-progress": (10, "another run is in progress"),
    "cell-busy": (11, "somebody else holds the cell"),
    "cell-not-ready": (12, "robot or camera would not do it now: emergency stop, motors, mode, link"),
    "interlock-open": (13, "an interlock does not allow motion: gate, part"),
    "not-still": (14, "the arm moved during a picture or scan, or did not come to rest: find what moves or shakes it"),
    "no-poses": (15, "nothing says where to look from"),
    "pose-refused": (16, "a pose, or the way to it, lies outside what [robot] allows: see the log for which"),
    "no-calibration": (17, "no calibration is applied yet"),
    "calibration-unusable": (18, "the calibration holds no transform, or was not accepted"),
    "no-scanner": (19, "the settings name no scanner"),
    "stopping": (20, "the daemon is stopping"),
    "forbidden": (21, "the PLC's role does not allow it"),
    "interrupted": (22, "the daemon was stopped while the run was in progress"),
    "aborted": (23, ABORTED),
    "abort-held": (23, ABORTED),
    "stop-unconfirmed": (25, "the controller has not confirmed that the arm is stopped and disarmed"),
    "run-stalled": (24, "the run did not get any further, and was stopped"),
    "tolerance-loosened": (26, "tolerance_wanted is larger than the settings', which forbid that"),
    # the robot and other devices
    "link-lost": (30, "the link to the controller was lost"),
    "device-unreachable": (31, "a device does not answer at its address"),
    "device-timeout": (32, "a device did not answer in time"),
    "garbled-answer": (33, "a device answered something else"),
    "answer-too-large": (34, "a device answered more than is allowed"),
    "address-not-understood": (35, "a device's address in the settings cannot be read"),
    "request-refused": (36, "refused: see the log for what"),
    "move-refused": (37, "the controller refused a move"),
    "move-failed": (38, "a move did not reach its goal"),
    "device-error": (39, "a device failed"),
    "elsewhere-than-sent": (
        41,
        "the arm reports another pose than the one it was sent to: compare units, tool and work object with the log",
    ),
    "nothing-measured": (42, "a cloud of the scanner has no points"),
    "same-again": (43, "camera or scanner sent what it had sent before"),
    "picture-unusable": (40, "the camera's picture cannot be used"),
    "device-taken": (44, "another program controls a device"),
    "wrong-device": (45, "another device answers than the settings name"),
    "library-missing": (46, "the library of a device's driver is not installed"),
    "setting-refused": (47, "a device refuses a setting"),
    "stream-stalled": (48, "the camera is connected and sends no pictures"),
    "incomplete-picture": (49, "parts of a picture are missing"),
    "device-overheated": (59, "a device is too hot to measure"),
    "clocks-apart": (66, "the clock of a line profiler runs apart from the daemon's"),
    "sweep-needed": (67, "the scanner is a line profiler: it makes no whole clouds, but sweeps"),
    # what was seen
    "target-not-seen": (50, "too few stations saw the target"),
    "target-not-found": (51, "the target was not found in a picture"),
    "undetermined": (52, "the motions do not determine X"),
    "calibration-error": (53, "the calibration could not be computed"),
    "document": (54, "a stored document cannot be read"),
    "scan-empty": (55, "the scan has no views"),
    "registration-error": (56, "the clouds could not be registered"),
    "cloud-error": (57, "a cloud of the scanner cannot be used"),
    "cloud-malformed": (57, "a cloud of the scanner cannot be used"),
    "cloud-truncated": (57, "a cloud of the scanner cannot be used"),
    "cloud-too-long": (57, "a cloud of the scanner cannot be used"),
    "cloud-unsupported": (57, "a cloud of the scanner cannot be used"),
    "cloud-io": (57, "a cloud of the scanner cannot be used"),
    "scan-unusable": (58, "the scan's clouds do not overlap, or are empty"),
    # the computer
    "storage-error": (60, "the disk cannot be read or written"),
    "storage-full": (61, "the disk is full"),
    "storage-too-new": (62, "the store was written by a newer release"),
    "storage-in-use": (63, "another daemon uses the store"),
    "not-found": (64, "no such thing is stored"),
    "storage-inconsistent": (65, "the store is damaged, cut off, moved or replaced"),
    "internal-error": (90, "a defect of handeyed: report it with the log"),
}


def number_of(code: str) -> int:
    """The number of an error's stable code."""
    return ERROR_CODES[code][0] if code in ERROR_CODES else UNKNOWN
