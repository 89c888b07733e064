"""The embedded controller, the MAVLink link to it, and a SITL vehicle that runs both."""

from firmware_bridge import controller, keys
from firmware_bridge.impairment import Impairment
from firmware_bridge.link import CancelledError, Link, OnLinkLoss, UploadReport, VehicleState, connect
from firmware_bridge.sitl_vehicle import Sensors, SitlVehicle

__all__ = [
    "CancelledError",
    "Impairment",
    "Link",
    "OnLinkLoss",
    "Sensors",
    "SitlVehicle",
    "UploadReport",
    "VehicleState",
    "connect",
    "controller",
    "keys",
]
