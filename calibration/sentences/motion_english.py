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
    " the target's instead, which does as well; its error shifts every registered point along that axis by as much."
    " Give it as axis_offset: in the settings, the request, or session.json",
    "axis-offset-of-camera": "all turns are about one axis, so that the camera's coordinate along {axis} is as given,"
    " {coordinate_mm:.2f} mm with a standard deviation of {sigma_mm:.2f} mm: no view shows it",
    "axis-offset-of-target": "all turns are about one axis, so that the coordinate of the target's origin along {axis}"
    " is as given, {coordinate_mm:.2f} mm with a standard deviation of {sigma_mm:.2f} mm: no view shows it",
    "measure-offset-or-add-views": "measure the given coordinate along the axis more exactly where it is the weakest"
    " direction; else add views turned about the axis and 100 mm or more apart across it",
    "axis-offset-unused": "the motions determine X, and the given coordinate along one axis is not used",
    "measure-axis-offset": "touch a point of the target, or of a registered part, with a tool of known length: an error"
    " of this number shifts every registered point along that axis by as much",
    "remove-axis-offset": "leave axis_offset out, or compare it with the result",
    "turn-across-or-travel": "if the arm can tilt, add poses turned by 30 degrees or more about an axis across {axis}."
    " If it cannot (a palletiser, a SCARA), add poses 100 mm apart or more across {axis}, with the same turns",
    "track-not-moved": "all {views} views were taken at one position of the track: its direction shows in none of them",
    "turntable-not-moved": "all {views} views were taken at one angle of the turntable: its axis shows in none of them",
    "move-the-track": "take views at two positions of the track or more, as far apart as it is used, the target in view"
    " from each",
    "move-the-turntable": "take views at two angles of the turntable or more, 60 degrees or more apart, with the target"
    " on it",
    "track-found": "the track moves the base along ({x:.5f}, {y:.5f}, {z:.5f}), {off_deg:.2f} degrees from the given"
    " direction; over the views' positions a registered point is uncertain by U = {expanded_mm:.2g} mm",
    "turntable-found": "the turntable turns about ({x:.5f}, {y:.5f}, {z:.5f}), {off_deg:.2f} degrees from the given"
    " direction; over the views' angles a registered point is uncertain by U = {expanded_mm:.2g} mm",
    "correct-the-direction": "correct direction in external_axis: it is the way the base moves, or about which the part"
    " turns right-handed, as the reading grows; and see that number is the axis that moved",
}
