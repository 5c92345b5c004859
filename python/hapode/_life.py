# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""Who owns what of C, how it ends, and how C calls back.

A scene, its session, pointers and devices share one _Owned, which holds everything that C may
still use. Objects of the package refer to a Core; when nobody has the Core, or when it is closed,
the parts end in C's order: session, devices, scene.

C gets the number of a Callbacks object, never an address of Python's: a call that comes too late
finds nothing, and does nothing."""
import _thread
import atexit
import collections
import contextlib
import itertools
import threading
import traceback
import sys
import weakref
from typing import Any, Callable, Iterator, Optional

from ._constants import Status
from ._library import NULL, ClosedError, HapodeError, check, ffi, lib, text_of

_making = threading.RLock()  # scenes are made and freed one after the other
_here = threading.local()    # .inside: callbacks and calls that may call back, of this thread
_numbers = itertools.count(1)
_callbacks: "weakref.WeakValueDictionary[int, Callbacks]" = weakref.WeakValueDictionary()
_cores: "weakref.WeakSet[Core]" = weakref.WeakSet()
_graves: "collections.deque[_Owned]" = collections.deque()
_ending = False


def inside() -> int:
    """How many callbacks this thread is in."""
    return getattr(_here, "inside", 0)


class Callbacks:
    """Functions of the application that one session calls, and the first exception of them."""

    def __init__(self) -> None:
        self.number = next(_numbers)
        self.before: Optional[Callable[[float], Any]] = None
        self.after: Optional[Callable[[float], Any]] = None
        self.surface: Optional[Callable[..., Any]] = None
        self.force: Optional[Callable[..., Any]] = None
        self.height: Optional[Callable[..., Any]] = None
        self.sink = self  # where its exceptions go: to that of the session
        self.error: Optional[BaseException] = None
        self.edits: dict[int, Callable[[], Any]] = {}
        _callbacks[self.number] = self

    @property
    def user(self) -> Any:
        """What C hands back in each call."""
        return ffi.cast("void *", self.number)

    def failed(self, error: BaseException) -> None:
        """Keeps the first exception: the next call of the session raises it."""
        if self.sink.error is None:
            self.sink.error = error


def _of(user: Any) -> Optional[Callbacks]:
    return _callbacks.get(int(ffi.cast("uintptr_t", user)))


@contextlib.contextmanager
def called(callbacks: Callbacks) -> Iterator[None]:
    """A call of the application: marks the thread, and keeps an exception."""
    _here.inside = inside() + 1
    try:
        yield
    except BaseException as error:  # noqa: B902: none may go through C
        callbacks.failed(error)
    finally:
        _here.inside -= 1


class _Owned:
    """What C has. It refers to no object of the application but callbacks and devices."""

    def __init__(self) -> None:
        self.scene: Any = NULL
        self.session: Any = NULL
        self.devices: list[Any] = []
        self.callbacks: list[Callbacks] = []

    def end(self, with_scene: bool = True) -> None:
        """Frees all of it, in this order, or all but the scene. Not in a callback."""
        _here.inside = inside() + 1
        try:
            if self.session != NULL:
                lib.hap_session_destroy(self.session)  # may call back once more
            self.session = NULL
            while self.devices:
                self.devices.pop().release(self)
            if with_scene:
                scene, self.scene = self.scene, NULL
                lib.hap_scene_destroy(scene)
        finally:
            _here.inside -= 1
        del self.callbacks[0 if with_scene else 1:]  # the first one is the scene's


def _bury() -> None:
    """Ends what was dropped. Whoever holds the lock goes on until nothing is left."""
    while _graves and not inside() and _making.acquire(blocking=False):
        try:
            while _graves:
                _graves.popleft().end()
        finally:
            _making.release()


def _bury_here() -> None:
    with _making:
        pass
    _bury()


def bury_later(owned: _Owned) -> None:
    """From a finalizer, which may run anywhere, in a callback too: nothing here waits."""
    _graves.append(owned)
    if not inside() and threading.get_ident() == threading.main_thread().ident:
        _bury()
    if _graves and not _ending:
        with contextlib.suppress(RuntimeError):
            _thread.start_new_thread(_bury_here, ())


class Core:
    """A scene with its session, from making to closing. Its methods guard the calls into C."""

    def __init__(self) -> None:
        self.owned = _Owned()
        self.callbacks = Callbacks()
        self.owned.callbacks.append(self.callbacks)
        self.control = threading.RLock()
        self.calls = 0
        self.counting = threading.Condition(threading.Lock())
        self.closing = False
        self.generation = 0  # of sessions: one that was closed is not the next one
        self.lockstep = True
        self.started = False
        _cores.add(self)

    # ---- what is open ----

    @property
    def scene(self) -> Any:
        if self.owned.scene == NULL or self.closing and not inside():
            raise ClosedError("scene")
        return self.owned.scene

    @property
    def session(self) -> Any:
        if self.owned.session == NULL or self.closing and not inside():
            raise ClosedError("session")
        return self.owned.session

    # ---- calls ----

    @contextlib.contextmanager
    def using(self) -> Iterator[None]:
        """A call that any thread may make. Closing waits for it."""
        if inside():
            yield  # C ends a callback before it ends the session
            return
        with self.counting:
            if self.closing:
                raise ClosedError("scene")
            self.calls += 1
        try:
            yield
        finally:
            with self.counting:
                self.calls -= 1
                self.counting.notify_all()

    @contextlib.contextmanager
    def controlling(self, what: str) -> Iterator[None]:
        """A call of one thread at a time that may call back, and that a callback must not make."""
        if inside():
            raise HapodeError(Status.ERROR_THREAD, f"{what}: not in a callback")
        if not self.control.acquire(blocking=False):
            raise HapodeError(Status.ERROR_STATE,
                              f"{what}: another thread is in a call of this scene or session")
        try:
            with self.using():
                _here.inside = inside() + 1
                try:
                    yield
                finally:
                    _here.inside -= 1
        finally:
            self.control.release()
        self.raise_pending()

    @contextlib.contextmanager
    def editing(self) -> Iterator[None]:
        """A call that reads or edits the world."""
        if inside() or self.started and not self.lockstep:
            with self.using():
                yield  # C refuses it where it may not be
        else:
            with self.controlling("editing"):
                yield

    def raise_pending(self) -> None:
        """The first exception of a callback since the last call."""
        error, self.callbacks.error = self.callbacks.error, None
        if error is not None:
            raise error

    def checked(self, status: int) -> Status:
        """Status of a call of the session; the session has the text."""
        if status >= 0:
            return Status(status)
        detail = ffi.new("hap_detail *")
        if self.owned.session != NULL:
            lib.hap_session_detail(self.owned.session, detail)
        return check(status, text_of(detail.text))

    # ---- the end ----

    def close_session(self) -> None:
        """Ends the session and lets its devices go. A second call does nothing."""
        self._end(with_scene=False)

    def close(self) -> None:
        """Ends all of it. A second call does nothing."""
        self._end(with_scene=True)

    def _end(self, with_scene: bool) -> None:
        if inside():
            raise HapodeError(Status.ERROR_THREAD, "close: not in a callback")
        if not self.control.acquire(timeout=10.0):
            raise HapodeError(Status.ERROR_TIMEOUT,
                              "close: another thread has been in a call for 10 s")
        try:
            # Callbacks end while the session is still there for them.
            if self.owned.session != NULL and self.started:
                _here.inside = inside() + 1
                try:
                    self.checked(lib.hap_session_stop(self.owned.session))
                finally:
                    _here.inside -= 1
                self.started = False
            with self.counting:
                self.closing = True
                if not self.counting.wait_for(lambda: self.calls == 0, timeout=10.0):
                    self.closing = False
                    raise HapodeError(Status.ERROR_TIMEOUT,
                                      "close: another thread has been in a call for 10 s")
            with _making:
                self.owned.end(with_scene)
            self.closing = with_scene
        finally:
            self.control.release()
        self.raise_pending()

    def __del__(self) -> None:
        owned = getattr(self, "owned", None)
        if owned is not None and (owned.scene != NULL or owned.session != NULL):
            bury_later(owned)


@contextlib.contextmanager
def making() -> Iterator[None]:
    """Scenes are made one after the other; what was dropped before ends first."""
    if inside():
        raise HapodeError(Status.ERROR_THREAD, "a scene is not made in a callback")
    with _making:
        _bury()
        yield


def _end_all() -> None:
    """Zero force, and no call into Python, before the interpreter goes."""
    global _ending
    _ending = True
    for core in list(_cores):
        try:
            core.close()
        except Exception:  # the others shall end as well
            traceback.print_exc(file=sys.stderr)
    _bury()


atexit.register(_end_all)


# ---- what C calls ----

def _from_c(signature: str) -> Callable[[Callable[..., Any]], Any]:
    """A function as C calls it. It lasts as long as the process."""
    made: Callable[[Callable[..., Any]], Any] = ffi.callback(signature)
    return made


@_from_c("void(void *, double)")
def before_step(user: Any, step_s: float) -> None:
    callbacks = _of(user)
    if callbacks is not None and callbacks.before is not None:
        with called(callbacks):
            callbacks.before(step_s)


@_from_c("void(void *, double)")
def after_step(user: Any, step_s: float) -> None:
    callbacks = _of(user)
    if callbacks is not None and callbacks.after is not None:
        with called(callbacks):
            callbacks.after(step_s)


@_from_c("void(void *, const hap_force_tick *, hap_wrench *)")
def force_call(user: Any, tick: Any, out: Any) -> None:
    callbacks = _of(user)
    if callbacks is not None and callbacks.force is not None:
        with called(callbacks):
            callbacks.force(tick, out)


@_from_c("double(void *, const double *)")
def height_call(user: Any, point: Any) -> float:
    callbacks = _of(user)
    height = 0.0
    if callbacks is not None and callbacks.height is not None:
        with called(callbacks):
            height = float(callbacks.height(point[0], point[1], point[2]))
    return height


@_from_c("void(void *, uint32_t, hap_pointer_id, hap_surface *)")
def surface_call(user: Any, geom: int, pointer: Any, io: Any) -> None:
    callbacks = _of(user)
    if callbacks is not None and callbacks.surface is not None:
        with called(callbacks):
            callbacks.surface(geom, pointer.v, io)


def edit_number(callbacks: Callbacks, edit: Callable[[], Any]) -> int:
    """A number for a posted edit, which runs once."""
    number = next(_numbers)
    callbacks.edits[number] = edit
    _edit_owner[number] = callbacks
    return number


_edit_owner: "weakref.WeakValueDictionary[int, Callbacks]" = weakref.WeakValueDictionary()


@_from_c("void(void *)")
def edit_call(arg: Any) -> None:
    number = int(ffi.cast("uintptr_t", arg))
    callbacks = _edit_owner.pop(number, None)
    edit = callbacks.edits.pop(number, None) if callbacks is not None else None
    if callbacks is not None and edit is not None:
        with called(callbacks):
            edit()
