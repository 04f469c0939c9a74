"""The gate to the kernels, in processes of their own: panics, forks, Ctrl-C, the GIL, memory."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import flurries as fl
from flurries import _core


def launch(code: str, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", code], text=True, env={**os.environ, **environment},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def python(code: str, **environment: str) -> list[str]:
    process = launch(code, **environment)
    try:
        out, err = process.communicate(timeout=600)
    finally:
        process.kill()
    assert (process.returncode, err) == (0, "")
    return out.split()


def test_a_defect_of_ours_is_an_error_of_ours():
    # What a kernel finds amiss in the arguments of the Python layer; a panic ends the same way
    # (`base::pool`).
    assert issubclass(fl._core.InternalError, RuntimeError)
    with pytest.raises(fl._core.InternalError, match="levels must be square"):
        _core.cone_needed(np.zeros((2, 3), np.uint8), np.zeros((1, 1, 2), np.float32), [])


@pytest.mark.parametrize("shared", [False, True])
def test_many_threads_on_one_scene(shared: bool, threads: Callable[[int], None]):
    threads(2)
    snow = fl.effects.TentSnow("heavy", flakes=300)
    effects = [snow, fl.effects.TentSnow(flakes=100, jitter=True)]
    scene = fl.Scene("#304050", size=(80, 60), effects=effects)
    want = [scene.render(t) for t in range(4)]
    ready, kept = threading.Barrier(16), np.zeros_like(want[0])

    def right(t: int) -> bool:
        kept[...] = made = scene.render(t)
        # The control is a painter that keeps its picture: another thread comes in between.
        time.sleep(0.001)
        return np.array_equal(kept if shared else made, want[t])

    def work(number: int) -> bool:
        ready.wait()
        return all(right(t % 4) for t in range(number, number + 8))

    with ThreadPoolExecutor(16) as pool:
        assert all(pool.map(work, range(16))) is not shared


def test_a_held_frame_stays_what_it_is():
    scene = fl.Scene("#304050", size=(640, 480), effects=[fl.Snow("heavy")])
    held = vars(scene.layers(1))
    kept = {name: value.copy() for name, value in held.items() if isinstance(value, np.ndarray)}
    for t in (2, 3):
        scene.layers(t)
    assert len(kept) >= 5
    for name, value in kept.items():
        np.testing.assert_array_equal(held[name], value, err_msg=name)


def test_import_starts_nothing_and_loads_little():
    code = """
import os, sys, numpy
def running():
    return len(os.listdir("/proc/self/task"))
before = running()
import flurries as fl
heavy = {"OpenImageIO", "av", "scipy", "skimage", "tqdm", "tomli_w", "matplotlib", "PIL",
         "anywidget", "ipywidgets", "traitlets", "http"}
print(running() - before, heavy & set(sys.modules) or "none")
fl.Scene(size=(1200, 900), effects=[fl.effects.TentSnow(flakes=50)]).render(0)
print(running() - before, len(heavy & set(sys.modules)))
from flurries.io import fit
fit(numpy.zeros((4, 4), "u1"), (2, 2))
print(len(heavy & set(sys.modules)))
"""
    # None of its own at import; two beside the caller at the first frame; the watch sees a load.
    assert python(code, FLURRIES_NUM_THREADS="3") == ["0", "none", "2", "0", "1"]


THREADS = """
import flurries as fl
try:
    print(fl.settings().threads)
    fl.Scene(size=(32, 32), effects=[fl.effects.TentSnow(flakes=5)]).render(0)
except ValueError as error:
    print(str(error).replace(" ", "_"))
"""


@pytest.mark.parametrize(("name", "value"), [
    *(("FLURRIES_NUM_THREADS", value) for value in (" 2 ", "", "abc", "0", "1.5", "257")),
    ("FLURRIES_SIMD", "bogus"),
])  # fmt: skip
def test_16_12_a_variable_is_taken_or_refused_by_name(name: str, value: str):
    told = python(THREADS, **{name: value})[-1]
    if value in (" 2 ", ""):
        assert told == (value.strip() or str(len(os.sched_getaffinity(0))))
    else:
        assert told.startswith(f"{name}:_must_be") and value in told


def test_the_gil_is_free_during_a_frame():
    # Another thread counts while this one is in a kernel; the control holds the GIL all along.
    code = """
import sys, threading, time
import flurries as fl
fl.set_threads(1)
count, stop = 0, False
def work():
    global count
    while not stop:
        count += 1
        time.sleep(0)
def rate(call):
    first, start = count, time.perf_counter()
    call()
    return (count - first) / (time.perf_counter() - start)
frame = lambda: [fl.spectral.alpha((600, 600), drift=(1.0, 9.0), seed=1) for _ in range(99)]
frame()
thread = threading.Thread(target=work); thread.start()
print(rate(lambda: time.sleep(0.3)), rate(frame), rate(lambda: sum(range(12_000_000))))
stop = True
thread.join()
"""
    solo, during, held = map(float, python(code))
    assert held < 0.1 * solo, "the control holds it"
    assert during > 5 * held and during > 0.2 * solo


# From 3.12 on Python warns of any fork beside threads; the test is that it works all the same.
FORKS = """
import os, signal, sys, threading, time, warnings
import flurries as fl
warnings.filterwarnings("ignore", message=".*multi-threaded.*", category=DeprecationWarning)
fl.set_threads(3)
{scene}
want = [scene.render(t).tobytes() for t in range(3)]
stop = False
def work():
    while not stop:
        scene.render(1)
def child(limit, job):
    # A child that hangs is ended by its alarm, and counted.
    pid = os.fork()
    if pid == 0:
        signal.alarm(limit)
        os._exit(0 if job() else 1)
    return os.waitpid(pid, 0)[1]
same = lambda: [scene.render(t).tobytes() for t in range(3)] == want
results = [child(30, same) for _ in range(10)]
thread = threading.Thread(target=work); thread.start()
for i in range(10):
    results.append(child(30, same))
    time.sleep(0.003)
nested = child(30, lambda: same() and child(30, same) == 0)
stop = True
thread.join()
lock = threading.Lock(); lock.acquire()
print(set(results), nested, same(), child(1, lock.acquire) == signal.SIGALRM)
"""


def test_forks_after_use():
    scene = "scene = fl.Scene(size=(200, 150), effects=[fl.effects.TentSnow(flakes=200)])"
    # Twenty children, some while another thread renders; the control is a lock that is never freed.
    assert python(FORKS.format(scene=scene)) == ["{0}", "0", "True", "True"]


INTERRUPT = """
import os, signal, threading, time
import numpy as np
import flurries as fl
fl.set_threads(1)
def interrupted(begun, call):
    # Ctrl-C comes when the first results are there, however fast the machine is.
    def watch():
        while not begun():
            time.sleep(0.001)
        os.kill(os.getpid(), signal.SIGINT)
    threading.Thread(target=watch, daemon=True).start()
    try:
        call()
        threading.Event().wait(5)
    except KeyboardInterrupt:
        return True
"""
KERNEL = """
{call}
# Pixels that were never written show that the work was given up, not only reported late.
print(interrupted(lambda: not np.isnan(out[::64, ::64]).all(), call), np.isnan(out).any())
print(np.isfinite(fl.Scene(size=(64, 64), effects=[fl.Snow()]).render(0)).all())
"""
# Overlaps make them long: at 8k a plain field is done in a tenth of a second.
FIELD = """
out = np.full(({size}, {size}), np.nan, np.float32)
how = dict(texture=fl.spectral.Texture(overlap={overlap}), drift=(1, 9), seed=1, out=out)
call = lambda: fl.spectral.{name}(out.shape, **how)
"""
CALLS = {
    "alpha": FIELD.format(name="alpha", size=8192, overlap=48),
    "small but long": FIELD.format(name="field", size=1024, overlap=63),
    "splat": """
out = np.full((2048, 2048), np.nan, np.float32)
points = np.random.default_rng(0).random((3_000_000, 3)) + [-0.5, -0.5, 1.0]
radius = np.full(len(points), 0.02)
call = lambda: fl.particles.splat(
    out.shape, points, radius, fl.camera.Camera(4000.0), opacity=0.1, out=out)
""",
}


@pytest.mark.parametrize("name", CALLS)
def test_ctrl_c_is_heard_in_a_kernel(name: str):
    assert python(INTERRUPT + KERNEL.format(call=CALLS[name])) == ["True", "True", "True"]


MEMORY = """
import gc
import flurries as fl
scene = fl.Scene("#304050", size=(160, 120), effects=[fl.effects.TentSnow("heavy", flakes=300)])
def resident():
    gc.collect()
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmRSS"))
kept = []
def run(frames):
    for t in frames:
        scene.render(t)
        kept.append(bytes(LEAK))
run(range(300))
before = resident()
run(range(300, 600))
print(resident() - before)
"""


@pytest.mark.parametrize("leak", [0, 8192])
def test_memory_stays_flat(leak: int):
    growth = int(*python(MEMORY.replace("LEAK", str(leak)), FLURRIES_NUM_THREADS="2"))
    assert (growth <= 1024) is (leak == 0), f"{growth} KiB in 300 frames"


HUGE = {
    "frame": "fl.Scene(size=(100_000, 100_000))",
    "flakes": "fl.Scene(size=(9, 9), effects=[fl.Snow(density=200, method='simulated')]).render(0)",
    "tile of the scene":
        "fl.Scene(size=(64, 64), effects=[fl.effects.TentSnow(tile=2**15, flakes=0)]).render(0)",
    "nothing huge": "fl.Scene(size=(9, 9), effects=[fl.Snow()]).render(0); raise MemoryError",
}  # fmt: skip


@pytest.mark.parametrize("name", HUGE)
def test_memory_that_is_not_there_is_an_error(name: str):
    code = f"""
import resource
resource.setrlimit(resource.RLIMIT_AS, (1 << 29, 1 << 29))
import flurries as fl
try:
    {HUGE[name]}
except (MemoryError, ValueError):
    print("refused")
print(fl.Scene(size=(64, 64), effects=[fl.effects.TentSnow(flakes=50)]).render(0).shape)
"""
    got = python(code, FLURRIES_NUM_THREADS="2", OPENBLAS_NUM_THREADS="1")
    assert "".join(got) == "refused(64,64,3)"


def test_an_exit_that_is_not_clean_would_be_seen():
    for code in ("import os; os.abort()", "import sys; sys.stderr.write('x')", "1 / 0"):
        process = launch(code)
        assert (process.communicate(timeout=100), process.returncode) != (("", ""), 0)


@pytest.mark.parametrize("size, count", [(64, 5), (1500, 2)])
def test_clean_exits_while_a_daemon_thread_renders(size: int, count: int):
    code = f"""
import threading, time
import flurries as fl
scene = fl.Scene(size=({size}, {size}), effects=[fl.effects.TentSnow(flakes=200)])
started = threading.Event()
def work():
    while True:
        scene.render(1)
        started.set()
        fl.spectral.alpha(({size}, {size}), drift=(1.0, 9.0), seed=1)
for _ in range(2):
    threading.Thread(target=work, daemon=True).start()
started.wait()
"""
    running = [launch(code, FLURRIES_NUM_THREADS="2") for _ in range(count)]
    ends = [process.communicate(timeout=100) for process in running]
    assert [process.returncode for process in running] == [0] * count, ends
    assert ends == [("", "")] * count
