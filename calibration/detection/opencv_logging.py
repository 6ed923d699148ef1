"""Silencing of OpenCV's log; failures are reported as DetectionError instead."""

from collections.abc import Iterator
from contextlib import contextmanager

import cv2


@contextmanager
def silence_opencv() -> Iterator[None]:
    """Context manager: OpenCV writes nothing to standard error inside it."""
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)
