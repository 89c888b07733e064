"""What measurements say about the vehicle: read and check logs, identify, compare."""

from sysid import report
from sysid.estimator.identification import identify
from sysid.estimator.options import HoverCommand, Options, RotorThrust
from sysid.estimator.result import Estimate, Identification
from sysid.estimator.stages import identify_in_stages, regress
from sysid.estimator.validation.comparison import Comparison, compare
from sysid.estimator.validation.protocol import Judged, judge
from sysid.estimator.validation.wrench_error import WrenchErrors, wrench_errors
from sysid.logs.check import LogReport, check_log
from sysid.logs.reading import read_log
from sysid.report import plots

__all__ = [
    "Comparison",
    "Estimate",
    "HoverCommand",
    "Identification",
    "Judged",
    "LogReport",
    "Options",
    "RotorThrust",
    "WrenchErrors",
    "check_log",
    "compare",
    "identify",
    "identify_in_stages",
    "judge",
    "plots",
    "read_log",
    "regress",
    "report",
    "wrench_errors",
]
