"""While an image is worked on, other Python threads go on."""

import sys
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

import netpose_rs as npr


@pytest.fixture
def patient() -> Iterator[None]:
    """No thread is made to hand over: another runs only when one gives way of itself."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1000.0)
    yield
    sys.setswitchinterval(before)


def calls() -> dict[str, Callable[[npr.sim.SimFrame], object]]:
    return {
        "estimate": lambda f: npr.estimate(f.image, f.camera, f.mesh),
        "Tracker.update": lambda f: npr.Tracker(f.camera, f.mesh).update(f.image, 0),
        "spectrum": lambda f: npr.fft.spectrum(f.image),
        "peaks": lambda f: npr.fft.peaks(f.image),
        "scores": lambda f: npr.fft.scores(f.image),
        "detect": lambda f: npr.junction.detect(f.image),
        "match_points": lambda f: npr.flow.match_points(f.image, f.image, f.nodes),
        "FlowTracker.update": lambda f: npr.flow.FlowTracker(848, 480).update(f.image),
        "render": lambda f: npr.sim.render("plain"),
    }


@pytest.mark.parametrize("name", calls())
def test_another_thread_gets_on_during_a_call(name: str, plain: npr.sim.SimFrame, patient: None) -> None:
    call = calls()[name]
    steps = 0
    stop = False

    def count() -> None:
        nonlocal steps
        while not stop:
            steps += 1
            # Gives way; without this the switch interval would keep the main thread out.
            time.sleep(0)

    other = threading.Thread(target=count)
    other.start()
    try:
        # A call that kept the lock could be made for ever, and the count would never move during it. One that gives it
        # up lets the other thread run, unless the machine is too busy to start it in that time: then try again.
        for _ in range(500):
            before = steps
            call(plain)
            during = steps - before
            if during > 0:
                break
    finally:
        stop = True
        other.join()
    assert during > 0


def test_trackers_in_threads_do_not_mix(plain: npr.sim.SimFrame) -> None:
    expected = npr.estimate(plain.image, plain.camera, plain.mesh)
    empty = np.full_like(plain.image, 90)
    found: dict[int, npr.Estimate] = {}

    def work(k: int) -> None:
        tracker = npr.Tracker(plain.camera, plain.mesh)
        found[k] = tracker.update(plain.image if k % 2 == 0 else empty, 0)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for k, result in found.items():
        assert result.status == (expected.status if k % 2 == 0 else "no_net")
        if k % 2 == 0:
            assert result.probability == expected.probability
            assert np.array_equal(result.junctions, expected.junctions)
