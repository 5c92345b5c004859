# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""A session: it couples a scene to the pointers that hands hold."""
from __future__ import annotations

import contextlib
from typing import Any, Callable, Iterator, Optional

import numpy as np
import numpy.typing as npt

from . import _life, _structs
from ._constants import Fault, Status
from ._library import (ClosedError, check, documented, dtype_of, ffi, lib, make, read_struct,
                       set_member, split, text_of)
from .device import Device
from .pointer import Pointer

EVENTS_AT_ONCE = 256
_ROW = ffi.typeof("hap_trace_row")
_ROW_BYTES = ffi.sizeof("hap_trace_row")


def trace_dtype(pointers: int, bodies: int = 0) -> np.dtype[Any]:
    """Type of a trace row with so many pointers and bodies: the begin of hap_trace_row."""
    fields = dict(_ROW.fields)
    whole = dtype_of(_ROW)
    names = [n for n in fields if n not in ("pointers", "body_position")] + ["pointers"]
    formats: list[Any] = [whole.fields[n][0] for n in names[:-1]]  # type: ignore[index]
    formats.append((dtype_of(fields["pointers"].type.item), (pointers,)))
    offsets = [fields[n].offset for n in names]
    size = offsets[-1] + pointers * ffi.sizeof("hap_trace_pointer")
    if bodies > 0:
        names.append("body_position")
        formats.append(("f8", (bodies, 3)))
        offsets.append(fields["body_position"].offset)
        size = _ROW_BYTES
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})


class Session:
    """Made by Scene.session. Close it, or use it in a with statement."""

    def __init__(self, core: _life.Core, settings: dict[str, Any]) -> None:
        keep: list[Any] = []
        basic, expert = split(settings, "hap_session_def", "hap_expert_def")
        definition = make("hap_session_def", basic, keep)
        if expert:
            extra = make("hap_expert_def", expert, keep)
            definition.expert = extra
        out, detail = ffi.new("hap_session **"), ffi.new("hap_detail *")
        self._core = core
        with core.controlling("session"):
            check(lib.hap_scene_session(core.scene, definition, out, detail), text_of(detail.text))
            core.owned.session = out[0]
            core.lockstep = definition.drive == lib.HAP_DRIVE_LOCKSTEP
            core.started = False
        core.generation += 1
        self._generation = core.generation
        self._pointers: list[Pointer] = []

    @property
    def _c(self) -> Any:
        """The C session; an error where this one was closed and the scene has another."""
        if self._core.generation != self._generation:
            raise ClosedError("session")
        return self._core.session

    def close(self) -> None:
        """Zero force on all devices, then the session ends. A second call does nothing."""
        if self._core.generation == self._generation:
            self._core.close_session()

    def __enter__(self) -> Session:
        self._c
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ---- running ----

    @documented("hap_session_start")
    def start(self) -> Status:
        """Starts it. Status.NO_REALTIME: it runs without real-time rights."""
        with self._core.controlling("start"):
            status = self._core.checked(lib.hap_session_start(self._c))
            self._core.started = True
        return status

    @documented("hap_session_stop")
    def stop(self) -> Status:
        """Zero force first, then the threads end."""
        with self._core.controlling("stop"):
            status = self._core.checked(lib.hap_session_stop(self._c))
            self._core.started = False
        return status

    @documented("hap_session_advance")
    def advance(self, ticks: int) -> Status:
        """Drive LOCKSTEP: runs that many haptic ticks."""
        with self._core.controlling("advance"):
            return self._core.checked(lib.hap_session_advance(self._c, ticks))

    @documented("hap_session_update")
    def update(self, frame_s: float) -> Status:
        """Drive FRAME: physics for a frame of this length, s."""
        with self._core.controlling("update"):
            return self._core.checked(lib.hap_session_update(self._c, frame_s))

    def _call(self, function: Any, *arguments: Any) -> Status:
        with self._core.using():
            return self._core.checked(function(self._c, *arguments))

    @property
    def now_ns(self) -> int:
        """Time of the session, ns."""
        with self._core.using():
            return int(lib.hap_session_now(self._c))

    @documented("hap_session_reset_fault")
    def reset_fault(self) -> None:
        """Clears a latched fault; the force comes back over 20 ms."""
        self._call(lib.hap_session_reset_fault)

    @property
    def fault(self) -> Fault:
        """The latched fault, or Fault.NONE."""
        return Fault(self.stats.faults.fault)

    @property
    def detail(self) -> str:
        """Text of the last error or fault."""
        out = ffi.new("hap_detail *")
        with self._core.using():
            lib.hap_session_detail(self._c, out)
        return text_of(out.text)

    @documented("hap_session_set_time_scale")
    def set_time_scale(self, scale: float) -> None:
        """Slow motion: 0..1."""
        self._call(lib.hap_session_set_time_scale, scale)

    @documented("hap_session_set_physics_hz")
    def set_physics_hz(self, hz: float) -> None:
        """Steps of the world a second."""
        self._call(lib.hap_session_set_physics_hz, hz)

    @documented("hap_session_set_accuracy")
    def set_accuracy(self, accuracy: float) -> None:
        """Turns the dial, 0..1."""
        self._call(lib.hap_session_set_accuracy, accuracy)

    @documented("hap_session_set_model")
    def set_model(self, model: str) -> None:
        """Changes the model: "single", "impulse", "accelerance", "contact"."""
        holder = ffi.new("hap_session_def *")
        set_member(holder, "model", model, [])
        self._call(lib.hap_session_set_model, ffi.cast("hap_model", int(holder.model)))

    # ---- pointers ----

    @documented("hap_pointer_add")
    def add_pointer(self, device: "str | Device | None" = None, **settings: Any) -> Pointer:
        """Adds a pointer. device: a spec such as "virtual:sine=0.1/0/0,hz=1", a Device, or None: it
        is moved by Pointer.set_target. Settings are members of hap_pointer_def and
        hap_pointer_expert_def, such as stiffness=800."""
        return self._add(None, device, settings)

    @documented("hap_scene_hand")
    def add_hand(self, hand: int = 0, device: "str | Device | None" = None,
                 **settings: Any) -> Pointer:
        """Adds a pointer as the built-in scene was made for, with the scene's simulated hand, or on
        another device. Settings as of add_pointer."""
        return self._add(hand, device, settings)

    def _add(self, hand: Optional[int], device: "str | Device | None",
             settings: dict[str, Any]) -> Pointer:
        keep: list[Any] = []
        basic, expert = split(settings, "hap_pointer_def", "hap_pointer_expert_def")
        points = basic.get("hull_xyz")
        if points is not None:
            basic.setdefault("hull_points", np.asarray(points).size // 3)
        owned = self._core.owned
        with self._core.controlling("add_pointer"):
            definition = make("hap_pointer_def", {}, keep)
            if hand is not None:
                spec = ffi.new("const char **")
                self._core.checked(lib.hap_scene_hand(self._core.scene, hand, definition, spec))
                device = text_of(spec[0]) if device is None else device
            for name, value in basic.items():
                set_member(definition, name, value, keep)
            if expert:
                extra = make("hap_pointer_expert_def", expert, keep)
                definition.expert = extra
            if device is not None:
                used = Device(device) if isinstance(device, str) else device
                definition.device = used.borrow(owned)
            out = ffi.new("hap_pointer_id *")
            status = lib.hap_pointer_add(self._c, definition, out)
            if status < 0 and device is not None:
                used.release(owned)
            self._core.checked(status)
            if device is not None:
                owned.devices.append(used)
        pointer = Pointer(self._core, self, int(out.v))
        self._pointers.append(pointer)
        return pointer

    @property
    def pointers(self) -> tuple[Pointer, ...]:
        """Pointers that were added and not removed."""
        return tuple(p for p in self._pointers if not p.removed)

    # ---- what it tells ----

    @documented("hap_session_stats")
    def _stats(self) -> _structs.Stats:
        out = ffi.new("hap_stats *")
        self._call(lib.hap_session_stats, out, ffi.sizeof("hap_stats"))
        stats: _structs.Stats = read_struct(out)
        return stats

    @property
    def stats(self) -> _structs.Stats:
        """What the session measures about itself: a copy of hap_stats."""
        return self._stats()

    @property
    def trace_hash(self) -> str:
        """Drive LOCKSTEP: of states and forces of all ticks, as hapode-run --lockstep prints it."""
        return f"{self.stats.loop.trace_hash:016x}"

    @documented("hap_session_trace_read")
    def trace(self, rows: Optional[int] = None,
              out: Optional[npt.NDArray[Any]] = None) -> npt.NDArray[Any]:
        """Takes the rows that wait, oldest first, as a structured array: C writes into it. Give
        session(trace_rows=...) as many rows as may wait. rows: at most so many, default all. out:
        an array of trace_dtype to write into; the part that was written is given back. Row fields
        are those of hap_trace_row: rows["t"], rows["pointers"]["force"][:, 0]."""
        if out is None:
            kind = trace_dtype(max(1, len(self._pointers)))
            parts = [np.zeros(0, kind)] if rows == 0 else []
            while rows is None or rows > 0:
                part = self._trace_into(np.zeros(min(rows or 65536, 65536), kind))
                parts.append(part)
                rows = None if rows is None else rows - len(part)
                if len(part) < 65536:
                    break
            return np.concatenate(parts) if len(parts) != 1 else parts[0]
        return self._trace_into(out[:rows])

    def _trace_into(self, out: npt.NDArray[Any]) -> npt.NDArray[Any]:
        if not (out.flags.c_contiguous and out.flags.writeable and out.dtype.names) or \
                out.dtype != trace_dtype(*self._room_in(out.dtype)):
            raise ValueError("out is a contiguous array of trace_dtype")
        count = ffi.new("size_t *")
        self._call(lib.hap_session_trace_read, ffi.cast("hap_trace_row *", out.ctypes.data),
                   len(out), out.dtype.itemsize, count)
        return out[:count[0]]

    @staticmethod
    def _room_in(dtype: np.dtype[Any]) -> tuple[int, int]:
        """Pointers and bodies for which a row has room."""
        room = []
        for name in ("pointers", "body_position"):
            shape = dtype.fields[name][0].shape if dtype.fields and name in dtype.fields else ()
            room.append(int(shape[0]) if shape else 0)
        return room[0], room[1]

    @documented("hap_session_events")
    def events(self) -> list[_structs.Event]:
        """What happened since the last call, oldest first. The first call begins it."""
        array = ffi.new("hap_event[]", EVENTS_AT_ONCE)
        count, found = ffi.new("size_t *"), []
        while self._call(lib.hap_session_events, array, EVENTS_AT_ONCE, ffi.sizeof("hap_event"),
                         count) != Status.END and count[0] > 0:
            found += [read_struct(array[i]) for i in range(count[0])]
        return found

    # ---- the world, between threads ----

    @contextlib.contextmanager
    def lock(self) -> Iterator[None]:
        """The world stands still for the body of the with statement, and may be edited."""
        self._call(lib.hap_session_lock)
        try:
            yield
        finally:
            self._call(lib.hap_session_unlock)

    @documented("hap_session_post")
    def post(self, edit: Callable[[], Any]) -> None:
        """Runs edit() in the physics thread before its next step."""
        callbacks = self._core.callbacks
        number = _life.edit_number(callbacks, edit)
        try:
            self._call(lib.hap_session_post, _life.edit_call, ffi.cast("void *", number))
        except BaseException:
            callbacks.edits.pop(number, None)
            raise

    @documented("hap_session_add_texture")
    def add_texture(self, heights: "npt.ArrayLike | Callable[[float, float, float], float]",
                    **settings: Any) -> int:
        """A texture of samples, rows x columns in m, or of a function of a point of the geom's
        frame that gives a height in m. The number is for Surface.texture. A function is slow for
        the haptic thread: use it in drive LOCKSTEP."""
        keep: list[Any] = []
        if callable(heights):
            callbacks = _life.Callbacks()
            callbacks.height, callbacks.sink = heights, self._core.callbacks
            definition = make("hap_texture_def", settings, keep)
            definition.height, definition.arg = _life.height_call, callbacks.user
        else:
            callbacks = None
            values = np.ascontiguousarray(heights, float)
            definition = make("hap_texture_def", {
                "heights": values, "rows": values.shape[0], "columns": values.shape[1],
                **settings}, keep)
        number = ffi.new("uint32_t *")
        if callbacks is not None:
            self._core.owned.callbacks.append(callbacks)
        self._call(lib.hap_session_add_texture, definition, number)
        return int(number[0])


def emergency_zero() -> None:
    """Zero force on every device of every running session, at once."""
    lib.hap_emergency_zero()


def version() -> str:
    """Version of the library that runs."""
    return text_of(lib.hap_version())
