"""See where a model fails, learn which effect is missing, add it, watch the error fall."""

from sysid.diagnosis.findings import Attempt, OutsideFinding, Size, Stair, SuspectFinding, Verdict
from sysid.diagnosis.procedure import Diagnosis, diagnose

__all__ = ["Attempt", "Diagnosis", "OutsideFinding", "Size", "Stair", "SuspectFinding", "Verdict", "diagnose"]
