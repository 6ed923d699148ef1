"""A small picture in colour and grey, encoded."""

import cv2
import numpy as np

COLOUR = np.random.default_rng(3).integers(0, 255, (30, 40, 3)).astype(np.uint8)
GREY = COLOUR[..., 0]


def encoded(suffix, image):
    return cv2.imencode(suffix, image)[1].tobytes()


PNG, JPEG = encoded(".png", COLOUR), encoded(".jpg", COLOUR)
