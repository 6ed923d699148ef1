"""The table of touch tests."""

from daemon.store.documents import DocumentKind

TOUCH_TESTS = DocumentKind("touch_tests", "touch", "calibration_id")
