# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""Haptic rendering of a rigid-body world."""
from ._constants import (SCENE_WORLD, Drive, Fault, ForceFrame, ForceKind, ForceTarget, GuardFlag,
                         JointKind, Model, Shape, Status)
from ._library import ClosedError, HapodeError, pose, text_of_field
from ._structs import Pose, Twist, Wrench
from .device import Device
from .pointer import Force, ForceHand, ForceTick, Pointer
from .scene import (Geom, Scene, Surface, box, capsule, cylinder, field, mesh, plane, sphere)
from .session import Session, emergency_zero, trace_dtype, version

__all__ = [
    "SCENE_WORLD", "ClosedError", "Device", "Drive", "Fault", "Force", "ForceFrame", "ForceHand",
    "ForceKind", "ForceTarget", "ForceTick", "Geom", "GuardFlag", "HapodeError", "JointKind",
    "Model", "Pointer", "Pose", "Scene", "Session", "Shape", "Status", "Surface", "Twist", "Wrench",
    "box", "capsule", "cylinder", "emergency_zero", "field", "mesh", "plane", "pose", "sphere",
    "text_of_field", "trace_dtype", "version"]
