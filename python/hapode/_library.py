# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""The C library: loading it, its errors, and its structs as Python values."""
import os
import pathlib
from typing import Any, Callable, Iterable, Mapping, Optional, TypeVar

import numpy as np

from . import _ffi, _headers, _structs
from ._constants import Status

ffi: Any = _ffi.ffi
NULL: Any = ffi.NULL
BOOKKEEPING = ("size", "cookie", "reserved")
Function = TypeVar("Function", bound=Callable[..., Any])


def _load() -> Any:
    """HAPODE_LIBRARY, the library that this package was built with, or the system's."""
    tried = []
    for name in (os.environ.get("HAPODE_LIBRARY"), _headers.LIBRARY,
                 pathlib.Path(_headers.LIBRARY).name):
        if name:
            try:
                return ffi.dlopen(name)
            except OSError as error:
                tried.append(str(error))
    raise ImportError("libhapode is not found; install it, or set HAPODE_LIBRARY to its path. "
                      + "; ".join(tried))


lib: Any = _load()


class HapodeError(Exception):
    """A call of the library failed. The text says what was wrong and what to do."""

    def __init__(self, status: int, detail: str) -> None:
        self.status = Status(status)
        self.detail = detail
        super().__init__(f"{self.status.name}: {detail}")


class ClosedError(HapodeError):
    """The object was closed, or removed."""

    def __init__(self, what: str) -> None:
        super().__init__(Status.ERROR_STATE, f"the {what} is closed")


def text_of(chars: Any) -> str:
    """A C text as a str."""
    return "" if chars == NULL else str(ffi.string(chars), "utf-8", "replace")


def check(status: int, detail: str = "") -> Status:
    """The status, or an exception where it is an error."""
    if status < 0:
        raise HapodeError(status, detail or text_of(lib.hap_status_text(status)))
    return Status(status)


def documented(name: str) -> Callable[[Function], Function]:
    """Puts the header's text of a C name behind the docstring."""
    def add(function: Function) -> Function:
        words = "\n\n".join(filter(None, (function.__doc__, f"C: {name}",
                                           _headers.TEXTS.get(name))))
        function.__doc__ = words
        return function
    return add


def text_of_field(struct: str, field: str) -> str:
    """What the headers say of a member of a struct, such as ("hap_pointer_def", "stiffness")."""
    return _headers.TEXTS[f"{struct}.{field}"]


# ---- from C ----

def to_python(value: Any, ctype: Any) -> Any:
    """A copy of a C value: numbers, str, numpy arrays, classes of _structs."""
    if ctype.kind == "struct":
        return read_struct(value)
    if ctype.kind == "array":
        if ctype.item.cname == "char":
            return text_of(value)
        if ctype.item.kind == "struct":
            return tuple(read_struct(one) for one in value)
        return np.frombuffer(ffi.buffer(value), dtype_of(ctype.item.item if ctype.item.kind ==
                             "array" else ctype.item)).reshape(shape_of(ctype)).copy()
    if ctype.kind in ("pointer", "function"):
        return int(ffi.cast("uintptr_t", value))
    if ctype.kind == "enum":
        return int(ffi.cast("int", value))
    return value


def read_struct(value: Any) -> Any:
    """A struct as an object of its class in _structs."""
    ctype = ffi.typeof(value)
    if ctype.kind == "pointer":
        ctype, value = ctype.item, value[0]
    members = {name: to_python(getattr(value, name), about.type) for name, about in ctype.fields
               if name not in BOOKKEEPING}
    return _structs.BY_NAME[ctype.cname.removeprefix("struct ")](**members)


def shape_of(ctype: Any) -> tuple[int, ...]:
    """Lengths of a C array, outermost first."""
    return (ctype.length, *shape_of(ctype.item)) if ctype.kind == "array" else ()


_NUMBERS = {"double": "f8", "float": "f4", "uint64_t": "u8", "int64_t": "i8", "uint32_t": "u4",
            "int32_t": "i4"}


def dtype_of(ctype: Any) -> np.dtype[Any]:
    """The numpy type with the layout of a C type. Pointers and enums are integers."""
    if ctype.kind == "struct":
        names = [name for name, _ in ctype.fields]
        return np.dtype({"names": names, "offsets": [about.offset for _, about in ctype.fields],
                         "formats": [dtype_of(about.type) for _, about in ctype.fields],
                         "itemsize": ffi.sizeof(ctype)})
    if ctype.kind == "array":
        return np.dtype((dtype_of(ctype.item), (ctype.length,)))
    if ctype.cname in _NUMBERS:
        return np.dtype(_NUMBERS[ctype.cname])
    return np.dtype({8: "u8", 4: "i4"}[ffi.sizeof(ctype)])


# ---- to C ----

# Members whose enumeration is not their C type.
_WORDS = {("hap_force_def", "kind"): "hap_force_kind",
          ("hap_force_def", "frame"): "hap_force_frame",
          ("hap_force_def", "target"): "hap_force_target",
          ("hap_grab_def", "place"): "hap_grab_place", ("hap_grab_def", "turns"): "hap_grab_turn"}


def _number_of(word: str, enum: Any) -> int:
    """The value of an enumeration's member by the end of its name: "lockstep"."""
    wanted = word.upper().replace("-", "_")
    for name, value in enum.relements.items():
        if name == wanted or name.endswith("_" + wanted) and name.startswith("HAP_"):
            return int(value)
    known = ", ".join(sorted(name.split("_", 2)[-1].lower() for name in enum.relements))
    raise ValueError(f"there is no {word!r}; known: {known}")


def set_member(target: Any, name: str, value: Any, keep: list[Any]) -> None:
    """Sets a member of a struct from a Python value. What C must find later goes into keep."""
    struct = ffi.typeof(target)
    struct = struct.item if struct.kind == "pointer" else struct
    about = dict(struct.fields).get(name)
    if about is None or name in BOOKKEEPING:
        known = ", ".join(field for field, _ in struct.fields if field not in BOOKKEEPING)
        raise TypeError(f"{struct.cname.removeprefix('struct ')} has no {name!r}; known: {known}")
    ctype = about.type
    words = _WORDS.get((struct.cname.removeprefix("struct "), name))
    if isinstance(value, str) and (ctype.kind == "enum" or words):
        value = _number_of(value, ffi.typeof(words) if words else ctype)
    if ctype.kind == "struct":
        set_struct(getattr(target, name), value, keep)
    elif ctype.kind == "array":
        array = np.ascontiguousarray(value, dtype_of(ctype).base)
        if array.shape != shape_of(ctype):
            raise ValueError(f"{name} has the shape {shape_of(ctype)}, not {array.shape}")
        ffi.memmove(getattr(target, name), array.tobytes(), array.nbytes)
    elif ctype.kind == "pointer" and value is not None and not isinstance(value, ffi.CData):
        array = np.ascontiguousarray(value, dtype_of(ctype.item))
        keep.append(array)
        setattr(target, name, ffi.cast(ctype, array.ctypes.data))
    elif ctype.kind == "pointer" and value is None:
        setattr(target, name, NULL)
    elif ctype.kind == "enum":
        setattr(target, name, int(value))
    elif ctype.kind == "primitive" and ctype.cname not in ("double", "float"):
        setattr(target, name, int(value))
    else:
        setattr(target, name, value)


def set_struct(target: Any, value: Any, keep: list[Any]) -> None:
    """A nested struct: an object with its members, a mapping, or for a pose its position."""
    members = [name for name, _ in ffi.typeof(target).fields]
    if isinstance(value, Mapping):
        given = dict(value)
    elif hasattr(value, members[0]):
        given = {name: getattr(value, name) for name in members}
    else:
        given = {members[0]: value}
    for name, one in given.items():
        set_member(target, name, one, keep)


def make(struct: str, settings: Mapping[str, Any], keep: list[Any]) -> Any:
    """A def struct: the library's defaults, then the settings."""
    out = ffi.new(f"{struct} *")
    getattr(lib, f"{struct}_init")(out, ffi.sizeof(struct))
    for name, value in settings.items():
        set_member(out, name, value, keep)
    return out


def split(settings: Mapping[str, Any], *structs: str) -> list[dict[str, Any]]:
    """The settings of several structs, each to the first one that has it."""
    fields = [{name for name, _ in ffi.typeof(struct).fields} for struct in structs]
    out: list[dict[str, Any]] = [{} for _ in structs]
    for name, value in settings.items():
        place = next((i for i, known in enumerate(fields) if name in known), None)
        if place is None or name in BOOKKEEPING:
            known_names = sorted(set().union(*fields) - set(BOOKKEEPING))
            raise TypeError(f"there is no setting {name!r}; known: {', '.join(known_names)}")
        out[place][name] = value
    return out


def pose(position: Iterable[float] = (0.0, 0.0, 0.0),
         quat_wxyz: Optional[Iterable[float]] = None) -> _structs.Pose:
    """A pose: m, and a unit quaternion with w first."""
    quat = (1.0, 0.0, 0.0, 0.0) if quat_wxyz is None else quat_wxyz
    return _structs.Pose(np.array(position, float), np.array(quat, float))
