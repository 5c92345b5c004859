# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""A pointer: what a hand holds in the world, and forces on it."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Callable, Iterable, Optional

import numpy as np

from . import _life, _structs
from ._constants import TOUCHES_MAX, PointerSetBit, Status
from ._library import (ClosedError, documented, ffi, lib, make, pose, read_struct,
                       set_struct)

if TYPE_CHECKING:
    from .session import Session

# Which members each bit names, where it is not the member of the same name.
_BITS = {"pose_world_device": PointerSetBit.BASE, "twist_world_device": PointerSetBit.BASE,
         "base_time_ns": PointerSetBit.BASE, "finger_radius": PointerSetBit.FRICTION,
         "max_force": PointerSetBit.LIMITS, "max_torque": PointerSetBit.LIMITS,
         "radius": PointerSetBit.SHAPE, "hull_xyz": PointerSetBit.SHAPE,
         "hull_points": PointerSetBit.SHAPE, "coupling_stiffness": PointerSetBit.COUPLING,
         "coupling_damping": PointerSetBit.COUPLING}


class ForceHand:
    """A hand, as an own force sees it: members of hap_force_hand. Valid during the call."""

    __slots__ = ("_tick", "_c")

    def __init__(self, tick: ForceTick, c: Any) -> None:
        self._tick, self._c = tick, c

    def _now(self) -> Any:
        self._tick._now()
        return self._c

    @property
    def position(self) -> tuple[float, float, float]:
        """Where the device is, m, world."""
        p = self._now().pose.position
        return p[0], p[1], p[2]

    @property
    def quat_wxyz(self) -> tuple[float, float, float, float]:
        """How the device is turned."""
        q = self._now().pose.quat_wxyz
        return q[0], q[1], q[2], q[3]

    @property
    def velocity(self) -> tuple[float, float, float]:
        """m/s, world."""
        v = self._now().twist.linear
        return v[0], v[1], v[2]

    @property
    def buttons(self) -> int:
        """Bit 0 is the first one."""
        return int(self._now().buttons)


class ForceTick:
    """What an own force is told of a tick. Valid during the call."""

    __slots__ = ("_c",)

    def __init__(self, c: Any) -> None:
        self._c = c

    def _now(self) -> Any:
        if self._c is None:
            raise RuntimeError("a tick is only there during the call")
        return self._c

    @property
    def hands(self) -> list[ForceHand]:
        """All hands."""
        c = self._now()
        return [ForceHand(self, c.hands[i]) for i in range(c.hand_count)]

    @property
    def hand(self) -> ForceHand:
        """The hand on which the force acts."""
        c = self._now()
        return ForceHand(self, c.hands[c.self])

    @property
    def time_s(self) -> float:
        """Of the tick, s, on the session's clock."""
        return float(self._now().time_ns) * 1e-9

    @property
    def seconds(self) -> float:
        """Since the tick before."""
        return float(self._now().seconds)


ForceFunction = Callable[[ForceTick], Optional[Iterable[float]]]


def _caller(function: ForceFunction) -> Callable[[Any, Any], None]:
    def call(tick: Any, out: Any) -> None:
        view = ForceTick(tick)
        try:
            wrench = function(view)
        finally:
            view._c = None
        if wrench is not None:
            values = [float(value) for value in wrench]
            if len(values) not in (3, 6):
                raise ValueError("an own force gives 3 numbers, N, or 6 with the torque, N m")
            out.force = values[:3]
            out.torque = values[3:] or [0.0, 0.0, 0.0]
    return call


class Force:
    """An own force of a pointer."""

    def __init__(self, pointer: Pointer, force_id: int, callbacks: Any, status: Status) -> None:
        self._pointer, self._id, self._callbacks = pointer, force_id, callbacks
        self.status = status  # SATURATED: a figure was cut to what the device can hold

    def _id_c(self) -> Any:
        if self._id == 0:
            raise ClosedError("force")
        return ffi.new("hap_force_id *", {"v": self._id})[0]

    @documented("hap_pointer_force_set")
    def set(self, call: Optional[ForceFunction] = None, **settings: Any) -> Status:
        """Gives it other values, or another function, from the next tick on."""
        definition, callbacks, keep = self._pointer._force_def(call, settings)
        if callbacks is not None:
            self._pointer._core.owned.callbacks.append(callbacks)
        self.status = self._pointer._call(lib.hap_pointer_force_set, self._id_c(), definition)
        self._forget()
        self._callbacks = callbacks
        return self.status

    @documented("hap_pointer_force_remove")
    def remove(self) -> None:
        """It goes away in 20 ms. Its function is not called any more."""
        self._pointer._call(lib.hap_pointer_force_remove, self._id_c())
        self._id = 0
        self._forget()

    def _forget(self) -> None:
        owned = self._pointer._core.owned
        if self._callbacks in owned.callbacks:
            owned.callbacks.remove(self._callbacks)
        self._callbacks = None

    @property
    def state(self) -> _structs.ForceState:
        """How its function does: calls, times, and whether it was taken out."""
        out = ffi.new("hap_force_state *")
        self._pointer._call(lib.hap_pointer_force_get, self._id_c(), out,
                            ffi.sizeof("hap_force_state"))
        state: _structs.ForceState = read_struct(out)
        return state


class Pointer:
    """Made by Session.add_pointer or Session.add_hand."""

    def __init__(self, core: _life.Core, session: Session, pointer_id: int) -> None:
        self._core, self._session, self.id = core, session, pointer_id
        self.removed = False

    def _id_c(self) -> Any:
        if self.removed:
            raise ClosedError("pointer")
        return ffi.new("hap_pointer_id *", {"v": self.id})[0]

    def _call(self, function: Any, *arguments: Any) -> Status:
        with self._core.using():
            return self._core.checked(function(self._session._c, self._id_c(), *arguments))

    @property
    def state(self) -> _structs.PointerState:
        """State after the newest tick: poses, wrench, buttons, guard."""
        out = ffi.new("hap_pointer_state *")
        self._call(lib.hap_pointer_get, out, ffi.sizeof("hap_pointer_state"))
        state: _structs.PointerState = read_struct(out)
        return state

    @documented("hap_pointer_set_target")
    def set_target(self, position: Iterable[float], quat_wxyz: Optional[Iterable[float]] = None,
                   linear: Iterable[float] = (0.0, 0.0, 0.0),
                   angular: Iterable[float] = (0.0, 0.0, 0.0)) -> None:
        """Moves a pointer without device: m, then m/s and rad/s."""
        to = ffi.new("hap_pose *")
        set_struct(to[0], pose(position, quat_wxyz), [])
        twist = ffi.new("hap_twist *", {"linear": list(linear), "angular": list(angular)})
        self._call(lib.hap_pointer_set_target, to, twist)

    @documented("hap_pointer_set")
    def set(self, **settings: Any) -> None:
        """Sets members of hap_pointer_settings while it runs, such as stiffness=500."""
        keep: list[Any] = []
        points = settings.get("hull_xyz")
        if points is not None:
            settings.setdefault("hull_points", np.asarray(points).size // 3)
        mask = settings.pop("mask", 0)
        for name in settings:
            named = PointerSetBit.__members__.get(name.upper())
            mask |= int(_BITS.get(name, named or 0))
        definition = make("hap_pointer_settings", {**settings, "mask": mask}, keep)
        now = make("hap_pointer_settings", {}, keep)
        # A bit names several members: those that are not given stay as they are.
        self._call(lib.hap_pointer_settings_get, now)
        for name, bit in _BITS.items():
            if mask & bit and name not in settings and not name.startswith("hull"):
                setattr(definition, name, getattr(now, name))
        self._call(lib.hap_pointer_set, definition)

    @documented("hap_pointer_clutch")
    def clutch(self, holds: bool) -> None:
        """Holds the clutch or lets it go."""
        self._call(lib.hap_pointer_clutch, holds)

    @documented("hap_pointer_restart")
    def restart(self) -> Status:
        """Stops the device and starts it again."""
        with self._core.controlling("restart"):
            return self._core.checked(lib.hap_pointer_restart(self._session._c, self._id_c()))

    @documented("hap_pointer_remove")
    def remove(self) -> None:
        """Zero force; the pointer is gone."""
        with self._core.controlling("remove"):
            self._core.checked(lib.hap_pointer_remove(self._session._c, self._id_c()))
        self.removed = True

    @documented("hap_pointer_touches")
    def touches(self) -> list[_structs.Touch]:
        """What the pointer touches, the hardest touch first. The first call begins it."""
        array, count = ffi.new("hap_touch[]", TOUCHES_MAX), ffi.new("size_t *")
        self._call(lib.hap_pointer_touches, array, TOUCHES_MAX, ffi.sizeof("hap_touch"), count)
        return [read_struct(array[i]) for i in range(count[0])]

    # ---- own forces ----

    def _force_def(self, call: Optional[ForceFunction],
                   settings: dict[str, Any]) -> tuple[Any, Any, list[Any]]:
        keep: list[Any] = []
        definition = make("hap_force_def", settings, keep)
        callbacks = None
        if call is not None:
            callbacks = _life.Callbacks()
            callbacks.force, callbacks.sink = _caller(call), self._core.callbacks
            definition.kind = lib.HAP_FORCE_CALL
            definition.call, definition.user = _life.force_call, callbacks.user
        return definition, callbacks, keep

    @documented("hap_pointer_force_add")
    def add_force(self, kind: Optional[str] = None, call: Optional[ForceFunction] = None,
                  **settings: Any) -> Force:
        """Adds a force to what the hand feels: a kind such as "spring", or a function of a
        ForceTick that gives 3 numbers, N, or 6 with the torque, N m, and needs max_force. Settings
        are members of hap_force_def. A function in Python is for drive LOCKSTEP: in real time it
        waits for the interpreter, and the guard takes out what is late."""
        if kind is not None:
            settings["kind"] = kind
        definition, callbacks, keep = self._force_def(call, settings)
        out = ffi.new("hap_force_id *")
        if callbacks is not None:
            self._core.owned.callbacks.append(callbacks)
        try:
            status = self._call(lib.hap_pointer_force_add, definition, out)
        except BaseException:
            if callbacks is not None:
                self._core.owned.callbacks.remove(callbacks)
            raise
        return Force(self, int(out.v), callbacks, status)

    # ---- a tool in the hand ----

    @documented("hap_pointer_attach")
    def attach(self, body: int, **settings: Any) -> Status:
        """Holds a body of the scene. Settings are members of hap_grab_def."""
        definition = make("hap_grab_def", settings, [])
        found = ffi.new("hap_scene_body *")
        with self._core.using():
            self._core.checked(lib.hap_scene_get_body(self._core.scene, body, found,
                                                      ffi.sizeof("hap_scene_body")))
        return self._call(lib.hap_pointer_attach, found.id, definition)

    @documented("hap_pointer_release")
    def release(self) -> None:
        """Lets go."""
        self._call(lib.hap_pointer_release)
