"""What is stated of a session's target, camera and arm, and what is believed of the robot's noise."""

from typing import Literal

import numpy as np
from pydantic import PositiveFloat, model_validator

from calibration.documents.validation import Document
from calibration.kinematics.robot_accuracy import STATED_FACTOR, NoiseBelief, RobotNoise
from calibration.knowledge import ArmSource, CameraSource, Instrument, Knowledge, TargetKnowledge, TargetSource


class TargetKnowledgeDocument(Document):
    """How the target's size is known: as printed; measured over a length with an instrument; or certified.

    length_mm : over which it was measured, or which the certificate states.
    instrument : with which it was measured: its largest error by class, and of reading.
    uncertainty_mm : one standard deviation of that length, in place of the instrument's.
    """

    source: TargetSource = "printed"
    length_mm: PositiveFloat | None = None
    instrument: Instrument | None = None
    uncertainty_mm: PositiveFloat | None = None

    @model_validator(mode="after")
    def _check(self) -> "TargetKnowledgeDocument":
        stated = self.length_mm is not None and (self.instrument is not None or self.uncertainty_mm is not None)
        if self.source == "measured" and not stated:
            raise ValueError("a measured target needs length_mm, and instrument or uncertainty_mm")
        if self.source == "certified" and (self.length_mm is None) != (self.uncertainty_mm is None):
            raise ValueError("a certificate states length_mm and uncertainty_mm together")
        if self.source == "printed" and (self.length_mm or self.instrument or self.uncertainty_mm):
            raise ValueError('length_mm, instrument and uncertainty_mm belong to source = "measured" or "certified"')
        return self

    def knowledge(self) -> TargetKnowledge:
        if self.length_mm is not None and self.uncertainty_mm is not None:
            return TargetKnowledge(self.source, self.uncertainty_mm / self.length_mm)
        if self.length_mm is not None and self.instrument is not None:
            return TargetKnowledge.measured(self.length_mm, self.instrument)
        return TargetKnowledge(self.source, 0.0 if self.source == "certified" else None)


class KnowledgeDocument(Document):
    """What is known beforehand. None of it is taken as exact: each statement is a prior with tails.

    camera : calibrated in this session (same focus, warm); by its maker; from a file; or nominal, of a data sheet.
    arm : as delivered; with Absolute Accuracy; or with its own errors from arm.json.
    """

    target: TargetKnowledgeDocument = TargetKnowledgeDocument()
    camera: CameraSource = "file"
    arm: ArmSource = "as-delivered"

    def knowledge(self) -> Knowledge:
        return Knowledge(self.target.knowledge(), self.camera, self.arm)

    def replaced_by(self, stated: "KnowledgeDocument") -> "KnowledgeDocument":
        """This, with what `stated` says of target, camera or arm in its place; the rest stays."""
        return self.model_copy(update={name: getattr(stated, name) for name in stated.model_fields_set})


class NoiseBeliefDocument(Document):
    """What is believed of the robot's noise: log-normal about these levels, one deviation being a factor.

    origin : of arms as usual, stated in the settings, or learnt from earlier runs of the cell.
    arm : the arm with its load of which it was learnt.
    """

    robot_rotation_deg: PositiveFloat
    robot_translation_mm: PositiveFloat
    rotation_factor: PositiveFloat = STATED_FACTOR
    translation_factor: PositiveFloat = STATED_FACTOR
    origin: Literal["usual", "stated", "learnt"] = "stated"
    arm: str = ""

    @classmethod
    def of(cls, belief: NoiseBelief) -> "NoiseBeliefDocument":
        rotation, translation = belief.factors
        return cls(
            robot_rotation_deg=float(np.degrees(belief.median.rotation_rad)),
            robot_translation_mm=belief.median.translation_mm,
            rotation_factor=rotation,
            translation_factor=translation,
            origin=belief.origin,
            arm=belief.arm,
        )

    def belief(self) -> NoiseBelief:
        median = RobotNoise(self.robot_translation_mm, float(np.radians(self.robot_rotation_deg)))
        return NoiseBelief(median, (self.rotation_factor, self.translation_factor), self.origin, self.arm)
