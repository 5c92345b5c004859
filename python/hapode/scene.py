# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""Worlds: bodies, geoms and joints, or a built-in scene."""
from __future__ import annotations

import dataclasses
from typing import Any, Callable, Iterable, Optional, Sequence

import numpy as np
import numpy.typing as npt

from . import _life, _structs
from ._constants import SCENE_WORLD
from ._library import (NULL, check, documented, ffi, lib, make, pose, read_struct, set_struct,
                       text_of)
from .session import Session

FloatArray = npt.NDArray[np.float64]
SurfaceCall = Callable[[int, int, "Surface"], Any]


@dataclasses.dataclass(frozen=True)
class Geom:
    """A shape with its settings: members of hap_geom_def."""
    settings: dict[str, Any]

    def at(self, position: Iterable[float], quat_wxyz: Optional[Iterable[float]] = None) -> Geom:
        """The same elsewhere: m, in the body's frame or in the world."""
        return Geom({**self.settings, "pose": pose(position, quat_wxyz)})


def sphere(radius: float, **settings: Any) -> Geom:
    """A sphere; radius in m."""
    return Geom({"shape": "sphere", "radius": radius, **settings})


def box(edges: Sequence[float], **settings: Any) -> Geom:
    """A box with three edges in m."""
    return Geom({"shape": "box", "edges": edges, **settings})


def capsule(radius: float, length: float, **settings: Any) -> Geom:
    """A capsule along z; its length, in m, is without the caps."""
    return Geom({"shape": "capsule", "radius": radius, "length": length, **settings})


def cylinder(radius: float, length: float, **settings: Any) -> Geom:
    """A cylinder along z; m."""
    return Geom({"shape": "cylinder", "radius": radius, "length": length, **settings})


def plane(**settings: Any) -> Geom:
    """All below z = 0 of its pose; never moves."""
    return Geom({"shape": "plane", **settings})


def mesh(vertices: npt.ArrayLike, triangles: npt.ArrayLike, **settings: Any) -> Geom:
    """Vertices, n x 3 in m, and triangles, m x 3, counter-clockwise as seen from outside."""
    points = np.ascontiguousarray(vertices, float).reshape(-1, 3)
    faces = np.ascontiguousarray(triangles, np.uint32).reshape(-1, 3)
    return Geom({"shape": "mesh", "vertices_xyz": points, "vertex_count": len(points),
                 "triangles": faces, "triangle_count": len(faces), **settings})


def field(heights: npt.ArrayLike, edges: Sequence[float], **settings: Any) -> Geom:
    """Heights in m, rows x columns, over edges (x, y) in m; never moves."""
    values = np.ascontiguousarray(heights, float)
    if values.ndim != 2:
        raise ValueError("heights has rows and columns")
    return Geom({"shape": "field", "heights": values, "rows": values.shape[0],
                 "columns": values.shape[1], "edges": [*edges, 1.0][:3], **settings})


class Surface:
    """How a pointer feels a geom: members of hap_surface, to be read and set during the call."""

    __slots__ = ("_c",)
    _c: Any

    def __init__(self, c: Any) -> None:
        object.__setattr__(self, "_c", c)

    def __getattr__(self, name: str) -> Any:
        if self._c is None:
            raise RuntimeError("a surface is only there during the call")
        return getattr(self._c, name)

    def __setattr__(self, name: str, value: float) -> None:
        if self._c is None:
            raise RuntimeError("a surface is only there during the call")
        setattr(self._c, name, value)


class Scene:
    """A world. Close it, or use it in a with statement; its session ends first."""

    def __init__(self, **settings: Any) -> None:
        """An empty scene; settings are members of hap_scene_def, such as gravity."""
        keep: list[Any] = []
        definition = make("hap_scene_def", settings, keep)
        self._take(lambda out, detail: lib.hap_scene_create(definition, out, detail))

    def _take(self, create: Callable[[Any, Any], Any]) -> None:
        out, detail = ffi.new("hap_scene **"), ffi.new("hap_detail *")
        with _life.making():
            check(create(out, detail), text_of(detail.text))
            self._core = _life.Core()
            self._core.owned.scene = out[0]

    @classmethod
    @documented("hap_scene_load")
    def load(cls, spec: str) -> Scene:
        """A built-in scene: "row10", "pile:20"."""
        scene = cls.__new__(cls)
        scene._take(lambda out, detail: lib.hap_scene_load(spec.encode(), out, detail))
        return scene

    @staticmethod
    def names() -> dict[str, str]:
        """Names of the built-in scenes, and what happens there."""
        out, line = {}, ffi.new("const char **")
        index = 0
        while (name := lib.hap_scene_name_at(index, line)) != NULL:
            out[text_of(name)] = text_of(line[0])
            index += 1
        return out

    def close(self) -> None:
        """Ends the session, zero force first, and frees the world."""
        self._core.close()

    def __enter__(self) -> Scene:
        self._core.scene
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ---- building ----

    @documented("hap_scene_add_body")
    def add_body(self, *geoms: Geom, position: Optional[Iterable[float]] = None,
                 **settings: Any) -> int:
        """Adds a body of these geoms and gives its number."""
        keep: list[Any] = []
        if position is not None:
            settings["pose"] = pose(position)
        definition = make("hap_body_def", settings, keep)
        array = ffi.new("hap_geom_def[]", max(1, len(geoms)))
        for i, geom in enumerate(geoms):
            array[i] = make("hap_geom_def", geom.settings, keep)[0]
        definition.geoms, definition.geom_count = array, len(geoms)
        number, detail = ffi.new("uint32_t *"), ffi.new("hap_detail *")
        with self._core.editing():
            check(lib.hap_scene_add_body(self._core.scene, definition, number, NULL, detail),
                  text_of(detail.text))
        return int(number[0])

    @documented("hap_scene_add_geom")
    def add_geom(self, geom: Geom) -> int:
        """Adds a geom that never moves and gives its number."""
        keep: list[Any] = []
        definition = make("hap_geom_def", geom.settings, keep)
        number, detail = ffi.new("uint32_t *"), ffi.new("hap_detail *")
        with self._core.editing():
            check(lib.hap_scene_add_geom(self._core.scene, definition, number, detail),
                  text_of(detail.text))
        return int(number[0])

    @documented("hap_scene_add_joint")
    def add_joint(self, kind: str, body_a: int, body_b: int = SCENE_WORLD,
                  **settings: Any) -> int:
        """Adds a joint, such as "hinge", and gives its number."""
        keep: list[Any] = []
        definition = make("hap_joint_def", {"kind": kind, "body_a": body_a, "body_b": body_b,
                                            **settings}, keep)
        number, detail = ffi.new("uint32_t *"), ffi.new("hap_detail *")
        with self._core.editing():
            check(lib.hap_scene_add_joint(self._core.scene, definition, number, detail),
                  text_of(detail.text))
        return int(number[0])

    def _call(self, function: Any, *arguments: Any) -> None:
        with self._core.editing():
            self._core.checked(function(self._core.scene, *arguments))

    @documented("hap_scene_remove_body")
    def remove_body(self, body: int) -> None:
        """Takes a body away."""
        self._call(lib.hap_scene_remove_body, body)

    @documented("hap_scene_remove_geom")
    def remove_geom(self, geom: int) -> None:
        """Takes a geom away that never moves."""
        self._call(lib.hap_scene_remove_geom, geom)

    @documented("hap_scene_remove_joint")
    def remove_joint(self, joint: int) -> None:
        """Takes a joint away."""
        self._call(lib.hap_scene_remove_joint, joint)

    # ---- reading ----

    def _read(self, function: Any, struct: str, *arguments: Any) -> Any:
        out = ffi.new(f"{struct} *")
        with self._core.editing():
            self._core.checked(function(self._core.scene, *arguments, out, ffi.sizeof(struct)))
        return read_struct(out)

    @property
    def counts(self) -> _structs.SceneCounts:
        """How many numbers of bodies, geoms and joints were given out; hands of the scene."""
        return self._read(lib.hap_scene_count, "hap_scene_counts")  # type: ignore[no-any-return]

    def body(self, body: int) -> _structs.SceneBody:
        """A body, as the world has it."""
        found: _structs.SceneBody = self._read(lib.hap_scene_get_body, "hap_scene_body", body)
        return found

    def geom(self, geom: int) -> _structs.SceneGeom:
        """A geom."""
        found: _structs.SceneGeom = self._read(lib.hap_scene_get_geom, "hap_scene_geom", geom)
        return found

    def joint(self, joint: int) -> _structs.SceneJoint:
        """A joint, as the world has it."""
        found: _structs.SceneJoint = self._read(lib.hap_scene_get_joint, "hap_scene_joint", joint)
        return found

    @documented("hap_scene_mesh")
    def mesh(self, geom: int) -> tuple[FloatArray, npt.NDArray[np.uint32]]:
        """Vertices, n x 3 in m, and triangles, m x 3, of a mesh or field."""
        about = self.geom(geom)
        vertices = np.empty((about.vertex_count, 3))
        triangles = np.empty((about.triangle_count, 3), np.uint32)
        self._call(lib.hap_scene_mesh, geom, ffi.cast("double *", vertices.ctypes.data),
                   len(vertices), ffi.cast("uint32_t *", triangles.ctypes.data), len(triangles))
        return vertices, triangles

    @documented("hap_scene_poses")
    def poses(self, time_ns: Optional[int] = None, first: int = 0,
              count: Optional[int] = None) -> FloatArray:
        """Poses of bodies for drawing, n x 7: x y z in m, then the quaternion w x y z. Rows of
        removed bodies are NaN. time_ns: default now."""
        with self._core.using():
            scene, session = self._core.scene, self._core.session
            if count is None:
                counts = ffi.new("hap_scene_counts *")
                lib.hap_scene_count(scene, counts, ffi.sizeof("hap_scene_counts"))
                count = int(counts.bodies) - first
            out = np.full((max(count, 0), 7), np.nan)
            when = lib.hap_session_now(session) if time_ns is None else time_ns
            self._core.checked(lib.hap_scene_poses(scene, when, first, len(out),
                                                   ffi.cast("hap_pose *", out.ctypes.data)))
        return out

    # ---- moving ----

    @documented("hap_scene_set_pose")
    def set_pose(self, body: int, position: Iterable[float],
                 quat_wxyz: Optional[Iterable[float]] = None) -> None:
        """Puts a body elsewhere, at once."""
        to = ffi.new("hap_pose *")
        set_struct(to[0], pose(position, quat_wxyz), [])
        self._call(lib.hap_scene_set_pose, body, to)

    @documented("hap_scene_set_twist")
    def set_twist(self, body: int, linear: Iterable[float],
                  angular: Iterable[float] = (0.0, 0.0, 0.0)) -> None:
        """Velocity, m/s and rad/s."""
        to = ffi.new("hap_twist *", {"linear": list(linear), "angular": list(angular)})
        self._call(lib.hap_scene_set_twist, body, to)

    @documented("hap_scene_push")
    def push(self, body: int, force: Iterable[float],
             torque: Iterable[float] = (0.0, 0.0, 0.0)) -> None:
        """Adds a force, N, and a torque, N m, for the next step."""
        by = ffi.new("hap_wrench *", {"force": list(force), "torque": list(torque)})
        self._call(lib.hap_scene_push, body, by)

    @documented("hap_scene_set_motor")
    def set_motor(self, joint: int, speed: float, force: float, axis: int = 0) -> None:
        """Motor of an axis: rad/s or m/s, N m or N."""
        self._call(lib.hap_scene_set_motor, joint, axis, speed, force)

    # ---- what the scene calls ----

    @documented("hap_scene_set_steps")
    def on_step(self, before: Optional[Callable[[float], Any]] = None,
                after: Optional[Callable[[float], Any]] = None) -> None:
        """Functions that are called before and after each step of the world with its length, s.
        An exception in them is raised by the session's next call."""
        callbacks = self._core.callbacks
        callbacks.before, callbacks.after = before, after
        self._call(lib.hap_scene_set_steps, _life.before_step if before else NULL,
                   _life.after_step if after else NULL, callbacks.user)

    @documented("hap_scene_set_surface")
    def on_surface(self, surface: Optional[SurfaceCall], magnet_reach: float = 0.0) -> None:
        """A function of geom, pointer id and Surface, which says how the geom feels."""
        def call(geom: int, pointer: int, io: Any) -> None:
            view = Surface(io)
            try:
                assert surface is not None
                surface(geom, pointer, view)
            finally:
                object.__setattr__(view, "_c", None)
        callbacks = self._core.callbacks
        callbacks.surface = call if surface else None
        self._call(lib.hap_scene_set_surface, _life.surface_call if surface else NULL,
                   magnet_reach, callbacks.user)

    # ---- the session ----

    @documented("hap_scene_session")
    def session(self, **settings: Any) -> Session:
        """A session over the scene. Settings are members of hap_session_def and hap_expert_def:
        drive="lockstep", model="contact", trace_rows=2000."""
        return Session(self._core, settings)
