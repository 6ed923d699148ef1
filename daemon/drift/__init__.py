"""The daemon watches the calibration in force: a control chart of its verifications, an alarm, a schedule."""
