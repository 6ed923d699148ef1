"""English: why a cell is not ready for a run, warnings about it, and what a check of its devices found."""

CELL = {
    # daemon/cell
    "of-device": "{device}: {detail}",
    "emergency-stop-pressed": "emergency stop is pressed",
    "motors-off": "motors are off",
    "not-automatic": "not in automatic mode",
    "program-not-running": "the cell program is not running",
    "arm-moving": "the arm is moving",
    "external-axis-missing": "robot: the controller reports no external axis {number}, which [robot.external_axis]"
    " names",
    "status-unanswered": "it does not answer a status request",
    "interlock-not-allowing": "interlock {name}: {why}",
    "stop-unconfirmed-standing": "the arm is not confirmed to be stopped: {why}",
    "stop-unconfirmed-disarmed": "the arm is not confirmed to be disarmed: {why}",
    "stop-unconfirmed-both": "the arm is not confirmed to be stopped and disarmed: {why}",
    # daemon/runs, daemon/errors.py
    "run-going-on": "{kind} run {run} is in progress",
    "plc-holds-abort": "{holder} holds abort",
    "a-plc-set-abort": "a PLC has set abort",
    # daemon/store, daemon/api/readiness.py
    "update-holds": "nothing begins now: {update} is being installed",
    "settings-need-restart": "settings were changed that need a restart: {names}",
    "service-restarted": "the service was started again {count} times by itself, last after {cause} at {at}:"
    " journalctl -u handeyed -p warning says more",
    "key-ends": "the key {name} ends on {at}, in {days} days: make its successor with handeyed keys rotate",
    "address-not-here": "this PC does not have the address {host} of [{table}] host yet: nobody reaches it there;"
    " see the PC's network, or correct the settings",
    "disk-nearly-full": "only {free_mb:.0f} MB are left on the disk of {folder}: free some space",
    "disk-few-runs": "the disk of {folder} has room for about {runs} more runs: free some, or lower keep_runs",
    # daemon/webhooks, daemon/drift
    "webhook-refused": "webhook {receiver} has not taken anything at the last {attempts} attempts: look at its server"
    " and the log",
    "schedule-waits": "the drift schedule verifies nothing until somebody starts a run: {why}",
    "schedule-daemon-started": "the daemon has been started",
    "schedule-run-ended": "run {run} {state}",
    "schedule-moved-by-hand": "in run {run} the arm was moved by hand",
    "drift-moved": "drift: the fixed target seems to have moved by {drift_mm:.3f} mm, by chance at most"
    " {limit_mm:.3f} mm: {fix}",
    "drift-moved-with-temperature": "drift: the fixed target seems to have moved by {drift_mm:.3f} mm, by chance at"
    " most {limit_mm:.3f} mm; the camera has {now_c:.1f} °C, in the first verifications it had {before_c:.1f} °C:"
    " {fix}",
    "verify-at-usual-temperature": "wait until the camera has the temperature at which it works and verify again;"
    " calibrate when the drift stays",
    "drift-scatter": "drift: the target scatters by {scatter_mm:.3f} mm over the positions, the calibration explains"
    " at most {limit_mm:.3f} mm: {fix}",
    "drift-out-of-tolerance": "drift: the last verification is out of tolerance, and the chart does not learn from it:"
    " U is {expanded_mm:.2g} mm, the tolerance {tolerance_mm:g} mm: {fix}",
    "calibrate-or-look": "calibrate before parts go wrong, see docs/plc.md; or look whether the target was moved",
    # calibration/diagnosis/warming.py
    "still-warming": "the camera was between {low_c:.1f} and {high_c:.1f} °C, and with its temperature the picture"
    " shifted by {shift_px:.2g} px, {shift_mm:.2g} mm at the target",
    "still-warming-looks": "{views:views} were taken from one pose, and the picture shifted by {shift_px:.2g} px"
    " between them, {shift_mm:.2g} mm at the target ({sigma_px:.2g} px by chance, one standard deviation): the camera"
    " was warming up, or something moved",
    "let-camera-warm-up": "wait {minutes} minutes with the camera switched on and taking pictures, and calibrate again",
    # daemon/api/device_checks.py
    "check-robot-not-ready": "answers, but {reasons:; }",
    "check-robot-moves": "answers and could move; the flange stands at ({x_mm:.1f}, {y_mm:.1f}, {z_mm:.1f}) mm",
    "check-robot-reads": "answers and is read only: views are taken by hand; the flange stands at ({x_mm:.1f},"
    " {y_mm:.1f}, {z_mm:.1f}) mm",
    "check-robot-fix": "put this right at the controller",
    "check-storage": "{folder}, {free_gb:.1f} GB free",
    "check-camera-points": "a picture of {width} x {height}; it shows {found} of the target's {of} points",
    "check-camera-no-target": "a picture of {width} x {height}; the target is not in view now",
    "check-camera-size": "a picture of {width} x {height}, but the intrinsics are for {wanted_width} x {wanted_height}",
    "check-camera-size-fix": "correct one of them",
    "check-interlocks": "all allow motion",
}
"""By id. A reason of a driver or an interlock stands in its sentence as written."""
