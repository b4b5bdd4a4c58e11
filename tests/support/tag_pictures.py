"""Pictures of a tag, in a file that is replaced. Needs OpenCV."""

import cv2
import numpy as np

from robot.homing.detector import tag_modules


def picture_of(tag):
    """Return a PNG of a tag on white paper."""
    paper = np.pad(np.where(tag_modules(tag), 20, 230), 3, constant_values=230)
    return cv2.imencode(".png", np.kron(paper, np.ones((12, 12))).astype(np.uint8))[1].tobytes()


def show(file, data):
    """Put a picture in the place of the last."""
    new = file.with_name("new")
    new.write_bytes(data)
    new.replace(file)
