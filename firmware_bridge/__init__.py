"""The vehicle's side door: the embedded controller, the link to it, and a virtual vehicle that runs both."""

from firmware_bridge import controller, keys
from firmware_bridge.impairment import Impairment
from firmware_bridge.link import CancelledError, Link, OnLinkLoss, UploadReport, VehicleState, connect
from firmware_bridge.virtual_vehicle import Sensors, VirtualVehicle

__all__ = [
    "CancelledError",
    "Impairment",
    "Link",
    "OnLinkLoss",
    "Sensors",
    "UploadReport",
    "VehicleState",
    "VirtualVehicle",
    "connect",
    "controller",
    "keys",
]
