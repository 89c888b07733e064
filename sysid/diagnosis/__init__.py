"""See where a model fails, learn which effect is missing, add it, watch the error reduction."""

from sysid.diagnosis.findings import Attempt, CandidateFinding, OutsideFinding, Size, Stair, Verdict
from sysid.diagnosis.procedure import Diagnosis, diagnose

__all__ = ["Attempt", "CandidateFinding", "Diagnosis", "OutsideFinding", "Size", "Stair", "Verdict", "diagnose"]
