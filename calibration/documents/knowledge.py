"""What is stated of a session's target, camera and arm, and what is believed of the robot's noise."""

from typing import Literal

import numpy as np
from pydantic import PositiveFloat, model_validator

from calibration.documents.validation import Document
from calibration.kinematics.robot_accuracy import STATED_FACTOR, NoiseBelief, RobotNoise
from calibration.knowledge import ArmSource, CameraSource, Instrument, Knowledge, TargetKnowledge, TargetSource


class TargetKnowledgeDocument(Document):
    """How the target's size is known: as printed; measured over a length with an instrument; or certified."""

    source: TargetSource = "printed"
    """printed, measured or certified."""
    length_mm: PositiveFloat | None = None
    """Length that was measured or certified, mm."""
    instrument: Instrument | None = None
    """With what it was measured; its largest error counts."""
    uncertainty_mm: PositiveFloat | None = None
    """One standard deviation of that length, mm, in place of the instrument's."""

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
    """What is known beforehand. None of it is taken as exact: each statement is a prior with tails."""

    target: TargetKnowledgeDocument = TargetKnowledgeDocument()
    """How the target's size is known."""
    camera: CameraSource = "file"
    """this-session, maker, file or nominal: how the intrinsics are known."""
    arm: ArmSource = "as-delivered"
    """as-delivered, absolute-accuracy or arm-json: how the arm's lengths are known."""

    def knowledge(self) -> Knowledge:
        return Knowledge(self.target.knowledge(), self.camera, self.arm)

    def replaced_by(self, stated: "KnowledgeDocument") -> "KnowledgeDocument":
        """This, with what `stated` says of target, camera or arm in its place; the rest stays."""
        return self.model_copy(update={name: getattr(stated, name) for name in stated.model_fields_set})


class NoiseBeliefDocument(Document):
    """What is believed of the robot's noise: log-normal about these levels, one deviation being a factor."""

    robot_rotation_deg: PositiveFloat
    """Noise of the robot's rotation, degrees, one standard deviation per axis."""
    robot_translation_mm: PositiveFloat
    """Noise of the robot's translation, mm, one standard deviation per axis."""
    rotation_factor: PositiveFloat = STATED_FACTOR
    """One standard deviation of the rotation's level, as a factor."""
    translation_factor: PositiveFloat = STATED_FACTOR
    """One standard deviation of the translation's level, as a factor."""
    origin: Literal["usual", "stated", "learnt"] = "stated"
    """usual, stated or learnt."""
    arm: str = ""
    """Arm and load of which it was learnt."""

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
