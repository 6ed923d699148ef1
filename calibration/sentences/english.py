"""English: the template of each sentence by its id.

A place {name:form} is filled by the parameter of that name, in Python's format language; `views` lists indices of
views. Findings first; then what to do; then why a view is not used; then parts of other sentences. Those of the
detection stand in `detection_english`, those of the cell's state in `cell_english`, those of motions that do not
determine X in `motion_english`, those of what is no measurement in `plausibility_english`, those of an arm's own
errors in `arm_english`.
"""

from collections.abc import Mapping
from types import MappingProxyType

from calibration.sentences.arm_english import ARM
from calibration.sentences.cell_english import CELL
from calibration.sentences.detection_english import SEEN

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


FINDINGS = {
    # calibration/verdict.py
    "point-uncertain": "a mapped point is uncertain by U = {expanded_mm:.2g} mm (k = {coverage_factor:g}, at {point};"
    " tolerance {tolerance_mm:g} mm), most by {weakest}",
    "robot-noise": "the robot's poses scatter by {translation_mm:.2g} mm and {rotation_deg:.2g} degrees",
    "robot-noise-translation": "the robot's poses scatter by {translation_mm:.2g} mm",
    "poses-contradict-images": "poses and images contradict each other by {translation_mm:.2g} mm and"
    " {rotation_deg:.2g} degrees, more than any robot errs by",
    "poses-contradict-images-held-out": "poses and images contradict each other by {translation_mm:.2g} mm and"
    " {rotation_deg:.2g} degrees, more than any robot errs by, and views left out are missed by {hold_out_mm:.3g} mm",
    "many-rejected": "{rejected} of {views} views contradict the others: which of the two are right is not certain",
    "many-rejected-scans": "{rejected} of {views} views contradict the others",
    "axes-nearly-parallel": "the axes of the robot's motions are within {angle_deg:.1f} degrees of each other",
    "image-noise": "corners scatter by {image_px:.2g} px",
    "nothing-held-out": "three views leave none to check the others with",
    "inverted-fits-as-well": "the images agree with the robot's poses and with their inverses as well, which give"
    " another X, and nothing shows which are right",
    "hold-out-large": "views left out are missed by {hold_out_mm:.2g} mm, {expected_mm:.2g} mm was expected",
    "leave-out-larger": "without a part of the views ({grouped_by}) a mapped point moves {times:.2g} times as"
    " far as the noise explains: neighbouring views share an error. By them it is uncertain by {sigma_mm:.2g} mm (one"
    " standard deviation); U contains this",
    # calibration/solver/findings.py
    "views-not-used": "{views:views} not used: {why}",
    "corners-left-out": "{corners} corners lie too far from where their view's others put them",
    "board-turned": "{views:views}: the board was read the wrong way round; the corners were renumbered",
    "target-not-as-drawn": "the target's points are {in_plane_mm:.2f} mm from the drawing in its plane and"
    " {out_of_plane_mm:.2f} mm out of it (RMS); their true places were estimated and used",
    "target-larger": "measured by the robot's travel, the target is {percent:.2f} % larger than described;"
    " the solution uses the measured size",
    "target-smaller": "measured by the robot's travel, the target is {percent:.2f} % smaller than described;"
    " the solution uses the measured size",
    "principal-point-off": "views and robot agree better with the given principal point moved by"
    " ({right_px:+.2f}, {down_px:+.2f}) px; the solution uses the moved one",
    "tolerance-out-of-reach": "{tolerance_mm:.2g} mm is not within reach of this arm: {views} views will leave"
    " {expanded_mm:.2g} mm; a target measured or certified {with_measured_target_mm:.2g} mm, an arm with Absolute"
    " Accuracy besides {with_absolute_accuracy_mm:.2g} mm, twice the views {with_twice_the_views_mm:.2g} mm",
    "focal-length-off": "views and robot agree better with a focal length {percent:+.2f} % from the given one; the"
    " solution uses it",
    "size-contradicted": "the target's size is stated to within {stated_percent:.2g} %, but measured by the robot's"
    " travel it differs by {percent:+.2f} %; the solution uses the measured size",
    "camera-contradicted": "the camera is stated to be calibrated as it is now, but views and robot agree better with"
    " other intrinsics",
    "robot-trend": "the robot's errors are alike in neighbouring poses: about {translation_mm:.2g} mm and"
    " {rotation_deg:.2g} degrees follow the pose; what this adds to the uncertainty is counted",
    "pose-disagrees": "{views:views} not used: the robot's pose and the image contradict all other views",
    "duplicate-poses": "{views:views} repeat the robot pose of an earlier view: they add little",
    "starts-disagree": "started from {methods:, } the solution ends elsewhere; the likelier one is given",
    "starts-ambiguous": "started from {methods:, } the solution ends elsewhere; both are about as likely, and which is"
    " right is not certain",
    "not-converged": "the estimate did not settle",
    "noise-assumed": "{views} views do not determine the robot's noise well: levels around {translation_mm:g} mm and"
    " {rotation_deg:g} degrees were assumed as likely",
    "three-pose": "Eq. 7 gave a matrix {distance:.2g} from a rotation (Frobenius norm), which was projected to one;"
    " the axes of the two motions are {angle_deg:.1f} degrees apart; the paper's X is camera_T_flange, the inverse of"
    " the transform given here",
    # intrinsics/estimate.py, solve.py, solver: no X
    "images-repeated": "{repeated} of {views} views show the image of another view again",
    "target-unseen": "the target was found in {found} of {views} views: {why}",
    "target-nowhere": "the target is not seen, and nothing says where it is",
    "mount-unknown": "nothing is known of where the camera sits on the flange",
    "stand-unknown": "nothing is known of where the camera stands beside the robot",
    "too-few-views": "{views} usable views cannot determine the camera, the least is {least}",
    "no-tilt": "the views leave the focal length uncertain by {percent:.0f} %",
    "no-estimate": "the robot's poses and the images contradict each other so much that no estimate of X exists",
    "no-start": "no closed form finds an X from the robot's poses and the images",
    # calibration/diagnosis, planning/what_if.py
    "explained": "{finding}. {comparison}",
    "explained-or": "{finding}. {comparison}. Nearly as likely: {other}",
    "comparison-moving": "{comparison}. With it a mapped point moves by {effect_mm:.2g} mm",
    "comparison": "Robot and images disagree by {before: and } as they came, by {after: and } with this explanation",
    "intrinsics-do-not-fit": "the given intrinsics leave {before_px:.3f} px where others leave {after_px:.3f} px"
    " (fx {fx:.1f}, fy {fy:.1f}, cx {cx:.1f}, cy {cy:.1f}); they misplace the target by {percent:.2f} % of its"
    " distance",
    "intrinsics-of-another-size": "the given intrinsics leave {before_px:.3f} px where others leave {after_px:.3f} px"
    " (fx {fx:.1f}, fy {fy:.1f}, cx {cx:.1f}, cy {cy:.1f}): they are those of pictures {times:.4g} times as large;"
    " they misplace the target by {percent:.2f} % of its distance",
    "lens-moving": "{finding}. With the others a mapped point moves by {effect_mm:.2g} mm",
    "mount-not-as-expected": "the camera was found {off_mm:.1f} mm and {off_deg:.1f} degrees from where it was"
    " expected",
    "target-not-as-described": "the target is another one than was described: {what: and } of {views} views",
    "target-shown": "the target is another one than was described: {what: and } of {views} views; {shown}",
    "better-poses": "{poses} planned poses would leave U = {planned_mm:.2g} mm (k = 2), these {taken} leave"
    " {taken_mm:.2g} mm",
    "better-poses-open": "{poses} planned poses would leave U = {planned_mm:.2g} mm (k = 2), these leave X open",
    # calibration/pose_pairs, observations/measured_poses.py, diagnosis/measured.py
    "camera-hardly-moves": "the camera hardly moves compared with its errors: how long its millimetres are is not"
    " determined",
    "robot-pose-not-finite": "the robot's pose {row} is not made of numbers",
    "camera-pose-not-finite": "the camera's pose {row} is not made of numbers",
    "points-noise": "measured points scatter by {across_mm:.2g} mm across the line of sight and {along_mm:.2g} mm along"
    " it",
    "points-left-out": "{points} points lie too far from where their view's others put them",
    "points-size": "the measured points are {ratio:.4f} times as far apart as the target is described",
    "measured-pose-disagrees": "{views:views} not used: the robot's pose and the camera's contradict all other views",
    "lengths-longer": "measured by the robot's travel, the camera's lengths are {percent:.2f} % longer than true; the"
    " solution uses corrected ones",
    "lengths-shorter": "measured by the robot's travel, the camera's lengths are {percent:.2f} % shorter than true; the"
    " solution uses corrected ones",
    "camera-noise": "the camera's poses scatter by {translation_mm:.2g} mm and {rotation_deg:.2g} degrees",
    "camera-noise-beyond": "the camera's poses scatter by {translation_mm:.2g} mm and {rotation_deg:.2g} degrees beyond"
    " their covariance",
    "noises-assumed": "{views} views do not determine the noise of robot and camera well: levels of the robot around"
    " {translation_mm:g} mm and {rotation_deg:g} degrees were assumed as likely",
    "lengths-in-unit": "{what} in {unit}",
    "lengths-of-size": "{what} {ratio:.3g} times as long as they should be",
    "camera-poses-inverted": "the camera's poses are inverted: they map camera coordinates to the target"
    " (target_T_camera); or {other}",
    "camera-quaternion-w-last": "the quaternions of camera_T_target are written x, y, z, w; here the scalar comes"
    " first",
    "camera-reading": "of camera_T_target, {what}",
    # registration/calibrate
    "sphere-centre": "the sphere's centre lies at ({x_mm:.2f}, {y_mm:.2f}, {z_mm:.2f}) mm in base; over the views it"
    " scatters by {x_spread_mm:.2f}, {y_spread_mm:.2f}, {z_spread_mm:.2f} mm",
    "sphere-centre-on-flange": "the sphere's centre lies at ({x_mm:.2f}, {y_mm:.2f}, {z_mm:.2f}) mm on the flange; over"
    " the views it scatters by {x_spread_mm:.2f}, {y_spread_mm:.2f}, {z_spread_mm:.2f} mm",
    "sphere-views": "{views} views of the sphere",
    "sphere-ambiguous": "two solutions {off_deg:.0f} degrees apart fit equally well",
    "sphere-leaves-rotation": "the views of the sphere do not fix X's rotation",
    "sphere-leaves-translation": "the views of the sphere do not fix X's translation",
    "profiler-undetermined": "the sweeps do not determine the profiler's {free: and }",
    "profiler-rotation-x": "rotation about x",
    "profiler-rotation-y": "rotation about y",
    "profiler-rotation-z": "rotation about z",
    "profiler-translation-x": "translation along x",
    "profiler-translation-y": "translation along y",
    "profiler-translation-z": "translation along z",
    "profiler-clock-offset": "clock offset",
    "profiler-sweeps": "{sweeps} sweeps show their sphere or plane",
    "profiler-ambiguous": "two solutions {off_deg:.0f} degrees apart fit the sweeps alike",
    "tip-few-poses": "{poses} poses do not show how well the tip is known",
    "tip-unturned": "the poses turn too little to show the tip along ({along}) of the flange's axes",
    "give-tip-poses": "give {least} or more, in all of which the tip touches one fixed point",
    "turn-about-tip": "turn the flange by 30 degrees or more about two axes between the poses, the tip always at the"
    " point",
    "part-views": "{views} views of the part",
    "no-overlap": "no two views overlap",
    "surfaces-leave-rotation": "the overlapping surfaces and the robot's motions do not fix X's rotation",
    "surfaces-leave-translation": "the overlapping surfaces and the robot's motions do not fix X's translation",
    "surfaces-slide": "each view's surface is that of a plane or a sphere and slides on itself, so that many X bring"
    " the views together",
    "surfaces-ambiguous": "two X, {off_mm:.0f} mm and {off_deg:.0f} degrees apart, bring the surfaces together alike",
    "surfaces-apart": "no X brings the surfaces of the views together",
    "surfaces-too-few": "fewer than three views show a surface",
    "surfaces-searched": "no rough X was given: X was searched over all rotations of the camera, and refined by"
    " {off_mm:.1f} mm and {off_deg:.2f} degrees; views then agree to {rms_mm:.3f} mm RMS",
    "surfaces-agree": "X moved by {off_mm:.1f} mm and {off_deg:.2f} degrees from the rough one; views then agree to"
    " {rms_mm:.3f} mm RMS",
    "not-settled": "X had not settled after {iterations} iterations",
    "robot-noise-beyond": "the robot errs by {translation_mm:.2g} mm and {rotation_deg:.2g} degrees, more than the"
    " {expected_mm:.2g} mm and {expected_deg:.2g} degrees expected; the uncertainty counts it",
}

SESSION_CAUSES = {
    # calibration/diagnosis: conventions, orientations, pairings
    "quaternion-w-last": "the quaternions are written x, y, z, w; here the scalar comes first",
    "undo-quaternion-w-last": "write every quaternion as w, x, y, z",
    "quaternion-w-first": "the quaternions were w, x, y, z already and were reordered as if the scalar came last",
    "undo-quaternion-w-first": "write every quaternion as it came: w, x, y, z",
    "poses-inverted": "the poses are inverted: they map base coordinates to the flange (flange_T_base)",
    "undo-poses-inverted": "give base_T_flange: the flange's position and orientation in the base",
    "poses-in-metres": "the robot's translations are in metres",
    "undo-poses-in-metres": "multiply every translation by 1000: translation_mm is in millimetres",
    "poses-in-micrometres": "the robot's translations are 1000 times too large",
    "undo-poses-in-micrometres": "divide every translation by 1000: translation_mm is in millimetres",
    "poses-in-inches": "the robot's translations are in inches",
    "undo-poses-in-inches": "multiply every translation by 25.4: translation_mm is in millimetres",
    "radians-read-as-degrees": "the rotation vectors were in radians and were read as degrees: all orientations are"
    " 57 times too alike",
    "undo-radians-read-as-degrees": "convert the rotation vectors without the factor pi/180",
    "degrees-read-as-radians": "the rotation vectors were in degrees and were read as radians",
    "undo-degrees-read-as-radians": "convert the rotation vectors to radians first (times pi/180)",
    "euler-degrees-read-as-radians": "the Euler angles (intrinsic {read}) were in degrees and were read as radians",
    "undo-angles-read-as-radians": "convert the angles to radians first (times pi/180)",
    "pictures-mirrored": "the pictures are mirrored",
    "undo-pictures-mirrored": "switch off the mirroring (flip, reverse X or Y) in the camera or in what reads it, and"
    " take the views again",
    "pictures-turned": "from view {view} on the pictures are turned by {angle_deg} degrees",
    "undo-pictures-turned": "switch off the rotation of pictures in the camera or in what reads it, and take the views"
    " again",
    "setup-swapped": "the {carried} is on the flange and the {standing} stands in the cell, which is {right}, not"
    " {given}",
    "set-setup": 'set "setup" to "{right}"',
    "either": "{first}; or {second}",
    "poses-off-by-one": "the poses are off by one: image k was taken at pose k {shift:step}",
    "pair-images-first-row": "pair every image with the pose it was taken at; a missing or doubled first row is the"
    " usual cause",
    "wrong-pitch": "the target is {factor:.4f} times as large as described",
    "multiply-pitch": "measure the printed target with a ruler; multiply its pitch (and tag or square size) by"
    " {factor:.4f}",
    "poses-off-by": "the poses are off by {rows}: image k was taken at pose k {shift:step}",
    "pair-images-first-rows": "pair every image with the pose it was taken at; missing or doubled first rows are"
    " the usual cause",
    "image-lost-from": "from view {view} on the poses are off by one, an image was lost or a pose doubled there:"
    " image k was taken at pose k + 1",
    "pose-lost-from": "from view {view} on the poses are off by one, a pose was lost or an image doubled there:"
    " image k was taken at pose k - 1",
    "pair-images-from": "look at the rows about view {view}; from there on pair every image with the pose it was"
    " taken at",
    "poses-reversed": "the poses are in reversed order: the first image was taken at the last pose",
    "reverse-order": "reverse the order of the images or of the poses",
    "images-in-lexical-order": "the images are in the order of their names as text (1, 10, 11 ... 2, counted from"
    " {first}), the others in that of their numbers",
    "poses-in-lexical-order": "the poses are in the order of their names as text (1, 10, 11 ... 2, counted from"
    " {first}), the others in that of their numbers",
    "sort-by-number": "sort both by number, or write the numbers with leading zeros",
    "poses-blocks-swapped": "two blocks of poses are swapped: the last {poses} poses belong to the first images",
    "order-as-taken": "put the rows in the order in which the images were taken",
    "euler-radians-read-as-degrees": "the Euler angles (intrinsic {read}) were in radians and were read as degrees",
    "undo-euler-radians-read-as-degrees": "convert the angles without the factor pi/180",
    "rotation-transposed": "the rotations are transposed (the quaternions conjugated), the translations are not",
    "undo-rotation-transposed": "transpose the rotation matrices, or negate x, y, z of every quaternion",
    "euler-order": "the orientations are Euler angles in another order: read as {read}, they are written as {true}",
    "convert-intrinsic": "convert the three angles as {true}: each about the turned axis",
    "convert-extrinsic": "convert the three angles as {true}: each about the fixed axis",
    "vector-read-as-euler": "the orientations are rotation vectors and were read as Euler angles ({read})",
    "convert-as-vector": "convert the three numbers as a rotation vector: its length is the angle, its direction"
    " the axis",
    "euler-read-as-vector": "the orientations are Euler angles ({true}) and were read as rotation vectors",
    "convert-as-euler": "convert the three numbers as Euler angles, {true}",
}

VIEW_CAUSES = {
    # calibration/diagnosis/view_hypotheses.py, pose_entry_hypotheses.py
    "poses-swapped": "the poses of views {first} and {second} are swapped",
    "board-turned-in-view": "the board stands turned by 180 degrees in view {view}",
    "board-moved": "the board moved before view {view}: the views before and after it agree among themselves",
    "camera-moved": "the camera moved before view {view}: the views before and after it agree among themselves",
    "camera-or-tool-changed": "from view {view} on the camera sits elsewhere on the flange, or another tool was active:"
    " the views before and after it agree among themselves",
    "board-or-tool-changed": "from view {view} on the board sits elsewhere on the flange, or another tool was active:"
    " the views before and after it agree among themselves",
    "change-or-posture": "{change}; or the arm stood in another posture from there on, which poses without joints do"
    " not show",
    "fix-or-joints": "{fix}; if nothing moved, record the joints with every view (joints_deg)",
    "view-or": "{view} (or {others:, })",
    "pose-mistyped": "the pose of view {view} disagrees with all others by {off_mm:.2f} mm and {off_deg:.2f} deg",
    "pose-mistyped-or-posture": "the pose of view {view} disagrees with all others by {off_mm:.2f} mm and {off_deg:.2f}"
    " deg: it is mistyped, or the arm stood in another posture, which poses without joints do not show",
    "pose-mistyped-or-geometry": "the pose of view {view} disagrees with all others by {off_mm:.2f} mm and"
    " {off_deg:.2f} deg: it is mistyped, or this is an error of the arm's geometry, for no other view has its posture",
    "pose-mistyped-by-sign": "{pose}; most of that is one sign: {name} is {given:.5f} and should be about {right:.5f}",
    "pose-length-mistyped": "the pose of view {view} has a wrong number: {name} is {given:.2f} and should be about"
    " {right:.2f}",
    "pose-element-mistyped": "the pose of view {view} has a wrong number: {name} is {given:.5f} and should be about"
    " {right:.5f}",
    "exchange-poses": "exchange the two poses",
    "leave-view-out": "leave that view out; do not touch the board during a run",
    "fasten-board": "fasten the board and take the views again, or keep only the views on one side",
    "fasten-camera": "fasten the camera and take the views again, or keep only the views on one side",
    "fasten-board-tool0": "fasten the board, make tool0 active in every view, and take the views again, or keep only"
    " the views on one side",
    "fasten-camera-tool0": "fasten the camera, make tool0 active in every view, and take the views again, or keep only"
    " the views on one side",
    "read-pose-again": "read that pose on the controller again; if it is right, the arm had not settled, or stood"
    " in another posture than in the other views, or the image is bad",
}

ADVICE = {
    "add-turned-views-or-plan": "add views turned by 30 degrees or more about different axes, or let the poses be"
    " planned",
    "add-turned-views": "add views turned by 30 degrees or more about different axes",
    "add-larger-turns": "add views with larger turns about different axes",
    "turn-about-different-axes": "choose poses that turn the flange about different axes: 60 degrees apart or more is"
    " good",
    "check-robot": "check tool and work object of the reported pose, the settling time, the camera mount and the arm's"
    " zero",
    "check-robot-scans": "check tool and work object, settling, and the mount",
    "check-poses-and-images": "check the convention, the units and the order of the poses, the setup, and which image"
    " belongs to which pose",
    "check-image": "check focus, motion blur, the target's flatness, and the camera's intrinsics when they were given",
    "check-poses-and-target": "check the reported poses and the target, and run the calibration again",
    "check-poses-and-artefact": "check the poses and that the artefact stood still",
    "take-four-views": "take four or more views to have the solution checked",
    "take-a-view-turned-otherwise": "take a fourth view or more, not all of them turned about axes in one plane, or"
    " record joints_deg with every view; for poses that a driver read, say poses_from_controller in the session",
    "look-for-movement": "look for views with a large base error, or a target or camera that moved during the session",
    "check-lighting": "check lighting, focus and that the whole target is in view, or leave these views out",
    "compare-target": "compare the target's description with the target, and look at these images",
    "take-new-images": "take a new image at every pose: the camera, or what reads it, gave an old one",
    "compare-target-kind": "compare the target's description with the target: kind, columns, rows, dictionary and"
    " layout",
    "set-columns-and-rows": 'set "columns" to {columns} and "rows" to {rows}; or compare the target\'s description with'
    " the target",
    "count-from-zero": "count the corners from 0: subtract 1 from every id",
    "nothing-unless-many": "nothing, unless they are many: then look at the images for glare and blur",
    "use-oriented-target": "use a target with an unambiguous orientation: a ChArUco board or a grid with a large dot",
    "print-flat": "print the target on a flat, stiff plate for the best accuracy",
    "measure-pitch": "measure the target's pitch over its whole length with a ruler and correct the description",
    "compare-pitch-and-arm": "measure the pitch again; if it is right, the arm's lengths are off: check its mastering"
    " and its absolute accuracy",
    "calibrate-camera": "calibrate the camera anew; half a pixel in both says that its program counts from the first"
    " pixel's corner, where (0, 0) is the middle of it here",
    "calibrate-camera-in-focus": "calibrate the camera as it is focused now, or leave the intrinsics out to have them"
    " estimated",
    "check-shared-errors": "check intrinsics, light, focus and the target's flatness; views spread evenly over the"
    " image help",
    "scale-intrinsics": "multiply fx, fy, cx and cy by {factor:.4g}, or leave the intrinsics out to have them"
    " estimated",
    "stay-near-work": "take the views near where the robot works, or have its geometry calibrated (absolute accuracy)",
    "check-these-poses": "check these poses for a typing error, an arm still moving, or a target that was moved",
    "use-each-pose-once": "use each pose once; if the arm had moved, the pose is stale: read it anew for every image",
    "look-for-odd-view": "look at the views' errors for one that does not belong, or add views",
    "take-eight-views": "take eight or more views to have it measured",
    "use-auto": "use the method auto, which is more accurate from the same views",
    "use-auto-or-other-poses": "use the method auto, or other poses",
    "add-poses": "add poses that differ by 30 degrees or more about different axes",
    "take-tilted-views": "take more views of the target, tilted in different directions",
    "tilt-target": "tilt the target by 20° to 40° in several directions, or give the camera's intrinsics",
    "check-pose-convention": "check the poses' units, their convention and their order",
    "check-tool": "if the expectation is right, the poses may be a tool's instead of the flange's: make tool0 and wobj0"
    " active and read the poses again",
    "let-poses-be-planned": "let the poses be planned (handeyed plan, or a run without taught poses); or turn the"
    " flange further",
    "touch-sphere": "touch the sphere with a tool of known length to compare",
    "none-needed": "none needed",
    "correct-views": "correct these views, or leave them out",
    "look-for-reflections": "nothing, unless they are many: then look for reflections and edges in the clouds",
    "measure-pitch-and-lengths": "measure the target's pitch with a ruler, and check the camera's lengths with a known"
    " distance",
    "check-lengths": "check the camera with a known distance, and have it calibrated",
    "check-camera-poses": "check the convention and the order of the camera's poses, and which belongs to which of the"
    " robot",
    "take-more-than": "take more than {views} views to have it measured",
    "multiply-lengths": "multiply them by {factor:g}: {field} is in millimetres",
    "check-target-and-unit": "compare the target's description with the target, and the unit of {field}",
    "give-camera-T-target": "give camera_T_target: the target's position and orientation in the camera; or {other}",
    "write-w-first": "write every quaternion as w, x, y, z",
    "see-target-or-guess": "drive the arm to where the camera sees the whole target, or state both guesses",
    "turn-or-guess": "turn the flange about two axes with the target in view, or state {setting}",
    "move-camera-further": "move the camera further between views, or use a target of known size",
    "leave-pose-out": "leave it out",
    "scan-from": "scan it from {least} views or more",
    "turn-and-spread-sphere": "turn the flange about two axes by 30 degrees or more, and let the sphere stand at"
    " different places of the picture",
    "vary-sweeps": "sweep over the sphere or over three planes from directions that differ by 30 degrees or more about"
    " two axes, forwards and backwards, at different places of the profile",
    "add-overlap": "add overlapping views of a part with relief, the flange turned by 30 degrees or more about"
    " different axes",
    "give-rough-x": "give a rough X, or add overlapping views of a part with relief, turned about different axes",
    "start-better": "start from a better rough X, or add overlap",
    "correct-arm-session": "correct what is named and solve again; the calibration holds for the arm as drawn",
    "record-joints": "record the joints with each view: a pose is reached in several postures",
    "check-mount-and-part": "check the mount, and that the part stood still",
}

VIEWS = {
    "view-pose-disagrees": "the robot's pose and the image contradict all other views",
    "view-board-turned": "the board was read the wrong way round; the corners were renumbered",
    "view-beyond-the-first-three": "the method uses three views",
    "view-no-overlap": "it overlaps no other view",
    "target-not-found": "the target was not found in the image",
    "pose-not-finite": "the robot's pose holds a number that is not finite",
    "pose-not-rigid": "the robot's pose is no rotation and a place that an arm can reach",
    "corners-damaged": "{ids} ids for {corners} corners",
    "image-repeated": "the image is that of view {view} again",
    "target-not-measured": "the target was not measured",
    "camera-pose-not-rigid": "the camera's pose is no rotation and a place",
    "points-damaged": "{ids} ids for {points} points, or one is not finite",
    "point-id-unknown": "a point id is outside 0 to {last}",
    "point-id-repeated": "the same point id stands twice",
    "too-few-points": "{points} points; a view needs {least} or more",
    "points-on-a-line": "all points lie on one line of the target",
    "image-disagrees": "its corners do not lie as the corners of this target do",
}

PARTS = {
    "as-written": "{sentence}",
    "grouped-by-image": "grouped by the target's place in the image",
    "grouped-by-pose": "grouped by their poses",
    "grouped-by-view": "one after the other",
    "size-mm": "{value:.3g} mm",
    "size-deg": "{value:.2g} deg",
    "foreign-points": "points that it does not have (it has 0 to {last}) in {views}",
    "misplaced-points": "points that do not lie as its points do in {views}",
    "compared-apart": "they are {translation_mm:.3g} mm and {rotation_deg:.2g} degrees apart",
    "compared-at-points": "{apart}; at {point} {difference_mm:.3g} mm",
    "compared-at-known-points": "{apart}; at {point} {difference_mm:.3g} mm, where both know it to U ="
    " {expanded_mm:.2g} mm (k = 2)",
    "compared-agree": "they agree: {apart}. Mahalanobis distance {mahalanobis:.2g}: {percent:.2g} % of two calibrations"
    " of one camera are further apart",
    "compared-contradict": "they contradict each other: {apart}. Mahalanobis distance {mahalanobis:.2g}: {percent:.2g}"
    " % of two calibrations of one camera are further apart; either the camera moved between them, or one of them is"
    " wrong by more than it claims",
    "compared-unknown": "{apart}. Whether they agree is not known: one of them does not state the covariance of X",
    "columns-and-rows-exchanged": "columns and rows are exchanged",
    "columns-and-rows": "they lie as those of {columns} columns and {rows} rows",
    "ids-from-one": "their ids are counted from 1",
    "rule": "accepted when no finding is an error; a U (k = {coverage_factor:g}) above {tolerance_mm:g} mm at the worst"
    " of the points is an error",
    "rule-not-stated": "accepted when no finding is an error; a U (k = {coverage_factor:g}) above {tolerance_mm:g} mm"
    " at the worst of the points is an error. This tolerance was not stated by you",
    "accuracy-unexpected": "U is {found_mm:.2g} mm, and {expected_mm:.2g} mm was expected: {reason}",
    "accuracy-robot-mm": "the robot's positions scatter by {found:.2g} mm, not by {expected:.2g} mm",
    "accuracy-robot-deg": "the robot's orientations scatter by {found:.2g} deg, not by {expected:.2g} deg",
    "accuracy-image-px": "the corners scatter by {found:.2g} px, not by {expected:.2g} px",
    "accuracy-left-out": "views that are left out are missed by {times:.2g} times what the noise explains",
    "accuracy-not-noise": "possible errors of target and lens are counted, and a noise that few views determine badly",
    "accuracy-less-counted": "the data leave less open than was allowed for",
    "not-applied-worse": "it waits for a person: its U is {expanded_mm:.2g} mm, that of the calibration in force is"
    " {before_mm:.2g} mm",
    "not-applied-contradicts": "it waits for a person: it contradicts the calibration in force, by {difference_mm:.2g}"
    " mm at {point}; its U is {expanded_mm:.2g} mm, that of the one in force is {before_mm:.2g} mm",
}

ENGLISH: Mapping[str, str] = MappingProxyType(
    FINDINGS | SESSION_CAUSES | VIEW_CAUSES | ADVICE | VIEWS | PARTS | SEEN | CELL | MOTION | PLAUSIBILITY | ARM
)
