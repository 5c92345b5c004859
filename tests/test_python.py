# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""The Python package: the same results as C, errors, lives, callbacks, threads.
Arguments: source root, folder of the generated modules, shared library, hapode-run, compiler.
Other Pythons have no cffi: meson starts this one with the Python that the package is made for."""
import gc
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import tracemalloc

root, generated, library, hapode_run = (pathlib.Path(a).resolve() for a in sys.argv[1:5])
compiler = sys.argv[5:]
folder = tempfile.TemporaryDirectory()
package = pathlib.Path(folder.name) / "hapode"
package.mkdir()
for source in [*(root / "python" / "hapode").iterdir(), *generated.glob("_*.py")]:
    if source.is_file():
        shutil.copy(source, package)
os.environ["HAPODE_LIBRARY"] = str(library)
os.environ["PYTHONPATH"] = folder.name
os.environ["MPLCONFIGDIR"] = folder.name
sys.path.insert(0, folder.name)

import numpy as np  # noqa: E402

import hapode  # noqa: E402
from hapode import _headers, _library  # noqa: E402

points = []


def test(function):
    try:
        function()
        problem = ""
    except Exception:
        problem = traceback.format_exc()
    points.append(not problem)
    if problem:
        print("# " + problem.replace("\n", "\n# "))
    name = function.__name__.replace("_", " ")
    print(f"{'ok' if not problem else 'not ok'} {len(points)} - {name}", flush=True)


def raised(kind, words, function, *arguments, **settings):
    """The exception that a call must raise, with these words in its text."""
    try:
        function(*arguments, **settings)
    except kind as error:
        assert words in str(error), f"{words!r} is not in {error}"
        return error
    raise AssertionError(f"no {kind.__name__}")


def run_python(text, *options):
    return subprocess.run([sys.executable, "-B", "-X", "faulthandler", *options, "-c", text],
                          capture_output=True, text=True, timeout=240, cwd=folder.name)


def cube_scene():
    """A cube of 0.1 kg on a floor, and a hand without device beside it."""
    scene = hapode.Scene()
    scene.add_geom(hapode.plane())
    scene.add_body(hapode.box((0.05, 0.05, 0.05), density=800), position=(0, 0, 0.025))
    return scene


def python_hash(spec, model, ticks):
    with hapode.Scene.load(spec) as scene, scene.session(drive="lockstep",
                                                         model=model) as session:
        for hand in range(scene.counts.hands):
            session.add_hand(hand)
        session.start()
        session.advance(ticks)
        return session.trace_hash


@test
def lockstep_has_the_hash_of_hapode_run():
    for spec, model in (("row10", "contact"), ("stack", "single"), ("fig7:4", "accelerance"),
                        ("fig6", "contact"), ("door", "contact"), ("lightstand", "contact"),
                        ("telescope", "contact"), ("tower:4", "contact"), ("pile:10", "contact")):
        out = subprocess.run([hapode_run, "--scene", spec, "--model", model, "--lockstep",
                              "--seconds", "0.8"], capture_output=True, text=True, check=True)
        wanted = re.search(r"^trace_hash: (\w+)$", out.stdout, re.M)[1]
        told = python_hash(spec, model, 800)
        assert told == wanted, f"{spec}: {told}, hapode-run {wanted}"


HASH_PROGRAM = r"""
#include <hapode/hapode.h>
#include <inttypes.h>
#include <stdio.h>

int main(int count, char **words)
{
  hap_scene *scene;
  hap_session *session;
  hap_session_def def;
  hap_pointer_def hand;
  hap_pointer_id id;
  hap_stats stats;
  const char *device;
  hap_session_def_init(&def, sizeof def);
  hap_pointer_def_init(&hand, sizeof hand);
  def.drive = HAP_DRIVE_LOCKSTEP;
  if (count < 2 || hap_scene_load(words[1], &scene, NULL) < HAP_OK ||
      hap_scene_session(scene, &def, &session, NULL) < HAP_OK ||
      hap_scene_hand(scene, 0, &hand, &device) < HAP_OK ||
      hap_device_open(device, &hand.device, NULL) < HAP_OK ||
      hap_pointer_add(session, &hand, &id) < HAP_OK || hap_session_start(session) < HAP_OK ||
      hap_session_advance(session, 1200) < HAP_OK ||
      hap_session_stats(session, &stats, sizeof stats) < HAP_OK) {
    return 1;
  }
  printf("%016" PRIx64 "\n", stats.loop.trace_hash);
  return 0;
}
"""


@test
def lockstep_has_the_hash_of_a_c_program():
    program = pathlib.Path(folder.name) / "hash"
    program.with_suffix(".c").write_text(HASH_PROGRAM)
    subprocess.run([*compiler, f"-I{root}/include", "-o", program, program.with_suffix(".c"),
                    library, f"-Wl,-rpath,{library.parent}"], check=True)
    for spec in ("fig6", "door", "lightstand"):
        done = subprocess.run([program, spec], capture_output=True, text=True, check=True)
        told = python_hash(spec, "contact", 1200)
        assert told == done.stdout.strip(), f"{spec}: {told}, C {done.stdout}"


@test
def structs_have_the_layout_of_the_compiler():
    ffi = _library.ffi
    names = [n for n in ffi.list_types()[0] if ffi.typeof(n).kind == "struct"
             and ffi.typeof(n).fields]
    assert len(names) > 40
    lines, wanted = [], []
    for name in names:
        lines.append(f'printf("{name} %zu\\n", sizeof({name}));')
        wanted.append(f"{name} {ffi.sizeof(name)}")
        for member, about in ffi.typeof(name).fields:
            lines.append(f'printf("{name}.{member} %zu\\n", offsetof({name}, {member}));')
            wanted.append(f"{name}.{member} {about.offset}")
    source = pathlib.Path(folder.name) / "layout.c"
    source.write_text("#include <stddef.h>\n#include <stdio.h>\n#include <hapode/hapode.h>\n"
                      "#include <hapode/device_impl.h>\nint main(void)\n{\n"
                      + "\n".join(lines) + "\nreturn 0;\n}\n")
    subprocess.run([*compiler, f"-I{root}/include", "-o", source.with_suffix(""), source],
                   check=True)
    told = subprocess.run([source.with_suffix("")], capture_output=True, text=True, check=True)
    assert told.stdout.split("\n")[:-1] == wanted


@test
def a_long_trace_makes_no_object_for_each_row():
    with hapode.Scene.load("row10") as scene, scene.session(drive="lockstep",
                                                            trace_rows=100000) as session:
        session.add_hand()
        session.start()
        session.set_model("impulse")
        session.advance(100000)
        session.stats  # what is made once is made
        gc.collect()
        before, blocks = len(gc.get_objects()), sys.getallocatedblocks()
        tracemalloc.start()
        rows = session.trace()
        made = sum(one.count for one in tracemalloc.take_snapshot().statistics("filename"))
        tracemalloc.stop()
        assert len(rows) == 100000, len(rows)
        assert made < 1000, f"{made} allocations"
        assert len(gc.get_objects()) - before < 1000
        assert sys.getallocatedblocks() - blocks < 2000
        assert np.array_equal(rows["tick"], rows["tick"][0] + np.arange(100000))
        assert np.allclose(np.diff(rows["t"]), 1e-3)
        assert abs(rows["pointers"]["force"][:, 0]).max() > 0.5
        assert len(session.trace()) == 0


@test
def the_first_program_is_short():
    page = (root / "docs" / "python.md").read_text(encoding="utf-8")
    lines = re.search(r"```python\n(.*?)```", page, re.S)[1].splitlines()
    assert len(lines) <= 12 and "import hapode" in lines and "plt.show()" in lines, len(lines)


@test
def the_cost_is_measured():
    said = subprocess.run([sys.executable, "-m", "hapode.cost"], capture_output=True, text=True,
                          timeout=120)
    told = re.findall(r"([0-9.]+) us a", said.stdout)
    assert len(told) == 2, said.stdout + said.stderr


@test
def a_trace_goes_into_the_array_that_is_given():
    with hapode.Scene.load("row10") as scene, scene.session(drive="lockstep",
                                                            trace_rows=500) as session:
        hand = session.add_hand()
        session.start()
        out = np.zeros(300, hapode.trace_dtype(1))
        whole = np.zeros(300, hapode.trace_dtype(16, 16))
        session.advance(200)
        part = session.trace(out=out)
        assert part.base is out and len(part) == 200 and out["t"][199] > out["t"][198] > 0
        session.advance(100)
        part = session.trace(out=whole)
        assert len(part) == 100 and part["body_position"].shape == (100, 16, 3)
        assert np.array_equal(part["pointers"]["force"][-1, 0], hand.state.wrench.force)
        assert len(session.trace(rows=0)) == 0
        raised(ValueError, "contiguous", session.trace, out=out[::2])
        raised(ValueError, "trace_dtype", session.trace, out=np.zeros(5))


@test
def errors_have_the_texts_of_the_library():
    error = raised(hapode.HapodeError, "row10", hapode.Scene.load, "nonsense")
    assert error.status is hapode.Status.ERROR_NOT_FOUND
    with cube_scene() as scene:
        raised(hapode.HapodeError, "radius", scene.add_geom, hapode.sphere(-1.0))
        raised(hapode.HapodeError, "radius", scene.add_geom, hapode.sphere(float("nan")))
        raised(hapode.HapodeError, "NOT_FOUND", scene.remove_body, 77)
        raised(TypeError, "known: ", scene.add_geom, hapode.sphere(0.1, radios=3))
        raised(ValueError, "shape (3,)", scene.add_geom, hapode.box((1, 2)))
        raised(ValueError, "known: ", scene.add_joint, "elbow", 0)
        raised(TypeError, "known: ", scene.session, drve="lockstep")
        raised(ValueError, "lockstep", scene.session, drive="clockwork")
        raised(hapode.HapodeError, "physics_hz", scene.session, physics_hz=-1)
        with scene.session(drive="lockstep") as session:
            raised(hapode.HapodeError, "ERROR_STATE", session.advance, 1)
            raised(hapode.HapodeError, "stiffness", session.add_pointer, stiffness=-1)
            raised(hapode.HapodeError, "virtual", session.add_pointer, "vrtual")
            raised(hapode.HapodeError, "max_force", session.add_pointer().add_force,
                   call=lambda tick: None)
            raised(OverflowError, "", session.advance, -1)


@test
def what_is_closed_raises():
    scene = cube_scene()
    session = scene.session(drive="lockstep")
    device = hapode.Device("virtual:path=0:0/0/1")
    pointer = session.add_pointer(device)
    other = session.add_pointer()
    force = other.add_force("viscous", damping=1)
    session.start()
    raised(hapode.HapodeError, "serves", device.close)
    force.remove()
    raised(hapode.ClosedError, "force", force.remove)
    other.remove()
    raised(hapode.ClosedError, "pointer", lambda: other.state)
    assert session.pointers == (pointer,)
    session.close()
    session.close()
    device.close()
    device.close()
    raised(hapode.ClosedError, "device", lambda: device.info)
    second = scene.session(drive="lockstep")
    for call in (lambda: session.advance(1), session.start, session.trace, lambda: session.stats,
                 lambda: pointer.state, session.add_pointer, session.events, session.__enter__,
                 lambda: pointer.set(stiffness=1), lambda: session.now_ns,
                 lambda: pointer.set_target((0, 0, 0)), lambda: session.post(print)):
        raised(hapode.ClosedError, "closed", call)
    second.start()
    scene.close()
    scene.close()
    for call in (lambda: scene.counts, scene.poses, scene.session, lambda: scene.body(0),
                 lambda: scene.add_geom(hapode.plane()), lambda: second.advance(1),
                 lambda: scene.push(0, (0, 0, 1)), scene.__enter__):
        raised(hapode.ClosedError, "closed", call)


@test
def step_functions_are_called_and_push():
    with cube_scene() as scene:
        steps = []
        free = scene.add_body(hapode.sphere(0.05), position=(0, 0, 5), mass=2.0)

        def lift(step_s):
            steps.append(step_s)
            scene.push(free, (1.0, 0.0, 2.0 * 9.81))
        scene.on_step(before=lift)
        with scene.session(drive="lockstep") as session:
            session.start()
            session.advance(1001)
            assert abs(sum(steps) - 1.0) < 1e-9, sum(steps)
            assert abs(scene.body(free).twist.linear[0] - 0.5) < 1e-6
            assert abs(scene.body(free).twist.linear[2]) < 1e-6
            raised(hapode.HapodeError, "before the session", scene.on_step)


@test
def an_own_force_is_felt_as_one_of_the_library():
    felt = []
    for by_call in (False, True):
        with hapode.Scene() as scene, scene.session(drive="lockstep") as session:
            hand = session.add_pointer("virtual:sine=0.05/0/0,hz=1")
            session.start()
            kept = []

            def pull(tick):
                kept.append(tick)
                x, y, z = tick.hand.position
                return -20 * x, -20 * y, -20 * z
            if by_call:
                force = hand.add_force(call=pull, max_force=5)
            else:
                hand.add_force("spring", stiffness=20)
            session.advance(333)
            felt.append(hand.state.wrench.force)
            if by_call:
                assert force.state.calls == 333
                raised(RuntimeError, "during the call", lambda: kept[0].hand)
                force.remove()
                session.advance(50)
                assert abs(hand.state.wrench.force).max() == 0 and len(kept) == 333
    assert abs(felt[0][0]) > 0.5 and np.allclose(felt[0], felt[1], atol=0.02), felt


@test
def a_surface_function_is_obeyed():
    forces, asked = [], []
    for stiffness in (None, 400.0, 0.0):
        with cube_scene() as scene:
            def feel(geom, pointer, surface):
                asked.append((geom, pointer))
                if stiffness == 0.0:
                    surface.touchable = 0
                else:
                    surface.stiffness = stiffness
            if stiffness is not None:
                scene.on_surface(feel)
            with scene.session(drive="lockstep") as session:
                hand = session.add_pointer(stiffness=1000, radius=0.01)
                session.start()
                for height in np.linspace(0.02, 0.005, 400):
                    hand.set_target((0.3, 0, height))
                    session.advance(1)
                session.advance(200)
                forces.append(hand.state.wrench.force[2])
                known = hand.id
    assert abs(forces[0] - 5.0) < 0.01 and abs(forces[1] - 2.0) < 0.01 and forces[2] == 0, forces
    assert (0, known) in asked


@test
def a_texture_of_a_function_is_felt():
    heights = []

    def waves(x, y, z):
        heights.append((x, y, z))
        return 0.001 if x > 0.3 else 0.0
    with cube_scene() as scene:
        number = []
        scene.on_surface(lambda geom, pointer, surface: setattr(surface, "texture", number[0]))
        with scene.session(drive="lockstep") as session:
            number.append(session.add_texture(waves))
            hand = session.add_pointer(stiffness=1000)
            session.start()
            felt = []
            for x in (0.2, 0.4):
                for height in np.linspace(0.02, 0.009, 200):
                    hand.set_target((x, 0.2, height))
                    session.advance(1)
                session.advance(300)
                felt.append(hand.state.wrench.force[2])
            assert abs(felt[0] - 1.0) < 0.05 and abs(felt[1] - 2.0) < 0.1, felt
    assert heights


@test
def an_exception_of_a_callback_comes_out_of_the_next_call():
    with cube_scene() as scene:
        calls = []

        def fails(step_s):
            calls.append(step_s)
            raise KeyError("mine")
        scene.on_step(after=fails)
        with scene.session(drive="lockstep") as session:
            hand = session.add_pointer("virtual:path=0:0/0/1")
            session.start()
            raised(KeyError, "mine", session.advance, 100)
            assert len(calls) > 1
            raised(KeyError, "mine", session.advance, 100)
            scene._core.callbacks.after = None
            hand.add_force(call=lambda tick: (1, 2), max_force=5)
            raised(ValueError, "3 numbers", session.advance, 10)


@test
def a_callback_may_not_close_or_run():
    with cube_scene() as scene:
        errors = []

        def tries(step_s):
            for call in (session.close, scene.close, session.stop, hapode.Scene,
                         lambda: session.advance(1), session.add_pointer):
                errors.append(raised(hapode.HapodeError, "callback", call).status)
        scene.on_step(before=tries)
        with scene.session(drive="lockstep") as session:
            session.start()
            session.advance(50)
        assert errors and set(errors) == {hapode.Status.ERROR_THREAD}


@test
def threads_call_back_and_end():
    scene = cube_scene()
    names, edits = set(), []

    def step(step_s):
        names.add(threading.get_ident())
        scene.push(0, (0.0, 0.0, 0.1))
        scene.body(0)
    scene.on_step(before=step, after=lambda step_s: time.sleep(0.002))
    session = scene.session(rt_priority=0)
    pointer = session.add_pointer("virtual:sine=0.02/0/0,hz=2")
    force = pointer.add_force(call=lambda tick: (0.1, 0, 0), max_force=1)
    session.start()
    session.post(lambda: edits.append(scene.set_twist(0, (0, 0, 1))))
    failures = []

    def reads():
        try:
            while True:
                pointer.state, scene.poses(), session.stats, session.trace()
                with session.lock():
                    scene.body(0)
        except hapode.ClosedError:
            pass
        except Exception as error:
            failures.append(error)
    readers = [threading.Thread(target=reads) for _ in range(3)]
    for reader in readers:
        reader.start()
    deadline = time.monotonic() + 20.0
    while not (names and edits and force.state.calls) and time.monotonic() < deadline:
        time.sleep(0.01)
    scene.close()
    for reader in readers:
        reader.join(20.0)
        assert not reader.is_alive()
    assert names and threading.get_ident() not in names and edits == [None], (names, edits)
    assert not failures, failures


GARBAGE = """
import gc, random, sys, threading, hapode
random.seed(int(sys.argv[1]))
live = []
def make():
    scene = hapode.Scene()
    scene.add_geom(hapode.plane())
    body = scene.add_body(hapode.sphere(0.05), position=(0, 0, 0.05))
    made = [scene]
    if random.random() < 0.9:
        if random.random() < 0.7:
            scene.on_step(before=lambda s: (made, scene.push(body, (0, 0, 1))))
        threads = random.random() < 0.3
        session = scene.session(drive="threads" if threads else "lockstep", rt_priority=0,
                                max_bodies=16, max_contacts=64)
        device = hapode.Device("virtual:sine=0.1/0/0.05,hz=3") if random.random() < 0.5 else None
        pointer = session.add_pointer(device or "virtual:path=0:0/0/0.1")
        made += [session, pointer, device]
        if random.random() < 0.7:
            made.append(pointer.add_force(call=lambda t: (len(made), 0, gc.collect(0)),
                                          max_force=9))
        if random.random() < 0.8:
            session.start()
            if not threads:
                session.advance(random.randrange(60))
            if random.random() < 0.3:
                session.post(lambda: made.append(gc.collect()))
    random.shuffle(made)
    return made
def worker():
    for _ in range(4):
        make().pop()
for turn in range(40):
    live += [make(), make()]
    what = random.randrange(6)
    if what == 0:
        live.pop(random.randrange(len(live)))
    elif what == 1:
        made = live[random.randrange(len(live))]
        del made[random.randrange(1 + len(made)):]
    elif what == 2:
        gc.collect()
    elif what == 3:
        one = threading.Thread(target=worker)
        one.start()
        one.join()
    elif what == 4:
        for part in live.pop():
            if isinstance(part, (hapode.Session, hapode.Scene)):
                part.close()
    else:
        live = live[-3:]
print("end", len(live))
"""


@test
def garbage_in_any_order_does_no_harm():
    for seed in range(8):
        done = subprocess.run([sys.executable, "-B", "-X", "dev", "-c", GARBAGE, str(seed)],
                              capture_output=True, text=True, timeout=240)
        assert done.returncode == 0 and "end" in done.stdout, (seed, done.returncode, done.stderr)


@test
def what_is_dropped_is_freed():
    done = run_python("""
import gc, hapode
from hapode import _library
freed = []
destroy, lib = _library.lib.hap_scene_destroy, _library.lib
class Watched:
    def __getattr__(self, name):
        return getattr(lib, name)
    def hap_scene_destroy(self, scene):
        freed.append(destroy(scene))
        return freed[-1]
hapode._life.lib = Watched()
for turn in range(20):
    scene = hapode.Scene()
    scene.add_body(hapode.sphere(0.1))
    scene.on_step(before=lambda s: scene)
    session = scene.session(drive="lockstep")
    pointer = session.add_pointer("virtual:path=0:0/0/1")
    pointer.add_force(call=lambda t: session and None, max_force=1)
    session.start(); session.advance(40)
    del scene, session, pointer
    gc.collect()
assert freed == [0] * 20, freed
""")
    assert done.returncode == 0, done.stderr


@test
def the_end_of_the_process_ends_a_running_session():
    done = run_python("""
import hapode, time
scene = hapode.Scene.load("row10")
scene.on_step(before=lambda s: None)
session = scene.session(rt_priority=0)
session.add_hand()
session.start()
time.sleep(0.1)
print("end")
""", "-X", "dev")
    assert done.returncode == 0 and done.stdout == "end\n" and "Fatal" not in done.stderr, done


@test
def docstrings_come_from_the_headers():
    assert _headers.TEXTS["hap_pointer_add"] in hapode.Session.add_pointer.__doc__
    assert "N/m" in hapode.text_of_field("hap_pointer_def", "stiffness")
    for kind in (hapode.Scene, hapode.Session, hapode.Pointer, hapode.Force, hapode.Device):
        for name, value in vars(kind).items():
            if not name.startswith("_"):
                value = getattr(value, "__func__", value)
                assert value.__doc__, f"{kind.__name__}.{name} says nothing"


@test
def the_demo_plots_a_push():
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        print("# left out: no matplotlib")
        return
    picture = pathlib.Path(folder.name) / "push.png"
    done = subprocess.run([sys.executable, "-B", "-m", "hapode.demo", picture], timeout=120,
                          capture_output=True, text=True)
    assert done.returncode == 0 and "2000 ticks" in done.stdout, done
    assert picture.read_bytes()[:4] == b"\x89PNG" and picture.stat().st_size > 10000


@test
def the_page_runs_as_it_is_written():
    page = (root / "docs" / "python.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```$", page, re.M | re.S)
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        print("# left out: what plots, for there is no matplotlib")
        blocks = [block for block in blocks if "plt" not in block]
    assert blocks
    os.environ["MPLBACKEND"] = "Agg"
    for block in blocks:
        done = run_python(block)
        assert done.returncode == 0, f"{block}\n{done.stdout}{done.stderr}"
        wanted = re.findall(r"print\(.*?\) +# (.*)", block)
        assert done.stdout.split("\n")[:-1] == wanted, f"{block}\n{done.stdout}"


@test
def type_hints_are_sound():
    checker = shutil.which("mypy")
    if checker is None:
        print("# left out: no mypy")
        return
    settings = pathlib.Path(folder.name) / "mypy.ini"
    settings.write_text("[mypy]\n" + "".join(
        f"[mypy-{name}.*]\nignore_missing_imports = True\n" for name in ("matplotlib",
                                                                        "_cffi_backend")))
    done = subprocess.run([checker, "--strict", "--config-file", settings, "--cache-dir",
                           os.devnull, package], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


print(f"1..{len(points)}")
sys.exit(0 if all(points) else 1)
