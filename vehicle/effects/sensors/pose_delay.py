"""The pose is older than its time stamp."""

from vehicle.effects.base import Effect, Reading, Spec, Stage, Values


def apply(reading: Reading, p: Values) -> None:
    reading.pose_age_s = reading.pose_age_s + p.delay_s


EFFECT = Effect(
    name="pose_delay",
    number=24,
    stage=Stage.SENSOR,
    apply=apply,
    parameters=(Spec("delay_s", "s", prior=0.02, bounds=(-1.0, 1.0), planted=0.012),),
    law="p(t - d), q(t - d)",
    source="kinematics",
    channel="pose",
    regressor="v and w",
    excited_by=("rotation", "fast_level"),
)
