# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""Devices: opening them by name, and what they say of themselves."""
from __future__ import annotations

import threading
from typing import Any

from . import _structs
from ._constants import Status
from ._library import (NULL, ClosedError, HapodeError, check, documented, ffi, lib, read_struct,
                       text_of)


class Device:
    """A device that was opened. Pointers of one session borrow it; it closes after them."""

    @documented("hap_device_open")
    def __init__(self, spec: str) -> None:
        """Opens a device: "virtual:sine=0.1/0/0,hz=1", "replay:hand.csv"."""
        self._c: Any = NULL
        self._users: list[Any] = []
        self._wants_close = False
        self._lock = threading.RLock()
        out, detail = ffi.new("hap_device **"), ffi.new("hap_detail *")
        check(lib.hap_device_open(spec.encode(), out, detail), text_of(detail.text))
        self._c = out[0]

    @staticmethod
    def names() -> dict[str, str]:
        """Names that can be opened, and a line about each."""
        out, line = {}, ffi.new("const char **")
        index = 0
        while (name := lib.hap_device_name_at(index, line)) != NULL:
            out[text_of(name)] = text_of(line[0])
            index += 1
        return out

    def borrow(self, user: Any) -> Any:
        """For the session's use: the C device, until release."""
        with self._lock:
            if self._c == NULL or self._wants_close:
                raise ClosedError("device")
            self._users.append(user)
            return self._c

    def release(self, user: Any) -> None:
        """The session does not use it any more."""
        with self._lock:
            self._users.remove(user)
            if self._wants_close and not self._users:
                self._free()

    def _free(self) -> None:
        device, self._c = self._c, NULL
        lib.hap_device_close(device)

    def close(self) -> None:
        """Zero force, then lets go. An error while a pointer has it. A second call does nothing."""
        with self._lock:
            if self._users:
                raise HapodeError(Status.ERROR_STATE,
                                  "the device serves a pointer: close the session first")
            if self._c != NULL:
                self._free()

    def __enter__(self) -> Device:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        if getattr(self, "_c", NULL) != NULL and not self._users:
            self._free()

    @property
    def info(self) -> _structs.DeviceInfo:
        """What the first end effector is and can hold."""
        with self._lock:
            if self._c == NULL:
                raise ClosedError("device")
            out = ffi.new("hap_device_info *")
            check(lib.hap_device_get_info(self._c, out, ffi.sizeof("hap_device_info")))
        info: _structs.DeviceInfo = read_struct(out)
        return info
