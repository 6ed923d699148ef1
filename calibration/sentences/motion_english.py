"""English sentences of motions that do not determine X (closed_forms/observability.py), and what to do about them."""

MOTION = {
    "too-few-poses": "{poses} distinct robot poses with the target in view; X needs at least three",
    "pure-translation": "the flange moves without turning: X's translation is not determined in any direction",
    "too-little-rotation": "the flange turns by at most {angle_deg:.1f} degrees; X needs 10 or more",
    "parallel-axes-with-travel": "all turns are about one axis: translation along {axis}, ({x:.2f}, {y:.2f},"
    " {z:.2f}) of the flange, is not determined. These motions determine the rest of X",
    "parallel-axes-without-travel": "all turns are about one line: translation along {axis}, ({x:.2f}, {y:.2f},"
    " {z:.2f}) of the flange, and rotation about it are not determined",
    "turn-about-two-axes": "turn the flange by 30 degrees or more about two different axes between views",
    "turn-across": "if the arm can tilt, add poses turned by 30 degrees or more about an axis across {axis}. If it"
    " cannot (a palletiser, a SCARA), one number is missing: the camera's offset along that axis in mm, from the"
    " flange, or from the base for a camera beside the robot. Touching the target with a tool of known length gives"
    " it; its error shifts every registered point along that axis by as much. This version does not solve with that"
    " number yet",
    "turn-across-or-travel": "if the arm can tilt, add poses turned by 30 degrees or more about an axis across {axis}."
    " If it cannot (a palletiser, a SCARA), add poses 100 mm apart or more across {axis}, with the same turns",
}
