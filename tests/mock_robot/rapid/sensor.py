"""A sensor that guides a controller by EGM: the other end of protocols/egm/messages.py."""

from collections.abc import Iterable

from protocols.egm.messages import Correction, MessageType
from protocols.egm.protobuf import double_field, integer_field, message_field


def encode_correction(correction: Correction) -> bytes:
    """Encode a packet as a sensor sends it."""
    across = correction.across_path_mm
    kind = MessageType.PATH_CORRECTION if across else MessageType.CORRECTION
    header = message_field(1, (integer_field(1, correction.seqno), integer_field(2, 0), integer_field(3, kind)))
    if across:
        return header + message_field(2, (message_field(1, _doubles(across)), integer_field(2, 0)))
    joints = message_field(1, (double_field(1, value) for value in correction.joints_deg))
    pose = (
        message_field(1, _doubles(correction.position_mm)),
        message_field(2, _doubles(correction.quaternion_wxyz)),
    )
    planned = (
        *((joints,) if correction.joints_deg else ()),
        *((message_field(2, pose),) if correction.position_mm else ()),
    )
    return header + message_field(2, planned)


def _doubles(values: Iterable[float]) -> Iterable[bytes]:
    return (double_field(number, value) for number, value in enumerate(values, 1))
