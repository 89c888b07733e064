"""What measurements say about the vehicle: read and check logs, identify, compare."""

from sysid import report
from sysid.estimator.comparison import Comparison, compare
from sysid.estimator.identification import identify
from sysid.estimator.options import Options
from sysid.estimator.result import Estimate, Identification
from sysid.estimator.stages import identify_in_stages, regress
from sysid.logs.check import LogReport, check_log
from sysid.logs.reading import read_log
from sysid.report import plots

__all__ = [
    "Comparison",
    "Estimate",
    "Identification",
    "LogReport",
    "Options",
    "check_log",
    "compare",
    "identify",
    "identify_in_stages",
    "plots",
    "read_log",
    "regress",
    "report",
]
