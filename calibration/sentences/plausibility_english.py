"""English sentences of sessions that are no measurement, or of no possible cell (diagnosis/plausibility.py)."""

PLAUSIBILITY = {
    "circular-identity": "the robot's poses are the camera's own poses of the target, to {off_mm:.2g} mm and"
    " {off_deg:.2g} degrees: X and the target's pose are both the identity, and nothing is measured",
    "circular-product": "the robot's poses are the camera's poses of the target times a fixed pose, to {off_mm:.1g} mm:"
    " one side was computed from the other, and nothing is measured",
    "circular-residual": "the robot's poses agree with the images to {off_mm:.1g} mm, better than corners that scatter"
    " by {image_px:.2g} px let any robot: they were computed from the images, and nothing is measured",
    "exact-poses": "robot and camera agree to {off_mm:.1g} mm, which nothing measured does: they are simulated, or one"
    " side was computed from the other",
    "robot-poses-repeated": "{views:views}: the robot's pose is to the last digit that of an earlier view, and the"
    " target was seen elsewhere",
    "camera-poses-repeated": "{views:views}: the camera's pose of the target is to the last digit that of an earlier"
    " view, and the robot had moved",
    "mount-too-far": "the camera is {away_mm:.0f} mm from the flange that carries it, and {target_mm:.0f} mm from the"
    " target",
    "stand-too-far": "the camera stands {away_m:.1f} m from the robot's base, further than {most_m:.1f} m",
    "flange-in-sight": "the camera is {behind_mm:.0f} mm behind the flange's face and looks at the target through it",
    "setup-fits-either-way": "three views fit the other setup as well: in this one the flange carries what is"
    " {stated_mm:.0f} mm from it, in the other {other_mm:.0f} mm, which does not show which is right",
    "give-robots-poses": "give the poses that the controller reported, not those of a detection",
    "record-each-pose-anew": "read pose and picture anew in each view, after the arm has stopped",
    "check-setup-and-units": "check setup, the unit of the lengths, and whether the poses are those of the flange; with"
    " six views or more, or a known place of the camera, it is decided",
    "take-a-fourth-view": "take a fourth view, turned about another axis, and check setup",
    # pose_pairs/point_pairs.py
    "too-few-point-pairs": "{points} pairs of points; X needs four or more",
    "point-pairs-on-a-line": "the points lie on a line: the turn about it is not determined",
    "point-pairs-disagree": "the robot's points and the camera's disagree by {sigma_mm:.3g} mm",
    "point-pairs-noise": "{points} points of robot and camera agree to {sigma_mm:.2g} mm an axis",
    "add-point-pairs": "add points, spread over the volume that matters and not on a line",
    "compare-point-pairs": "compare pairs, units and frames: the tip's coordinates in th"
    "e base, and the camera's in its own frame",
}
