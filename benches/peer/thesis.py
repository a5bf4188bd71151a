"""The thesis's spectra on OpenCV and SciPy beside net-fft: the same pictures, the same run, one thread each.

    python benches/peer/thesis.py          needs cargo; numpy, scipy, scikit-learn and opencv-python-headless

Draws scenes with the simulator (`cargo run --release --no-default-features --example thesis_peer`), runs `thesis_opencv.py` on them, the two in turns
so that a load on the machine meets both, and prints for every stage the median over pictures of the time on a core, with the ratio, and how right the poses are: within 5 % and 5 degrees.
"""

from __future__ import annotations

import collections
import csv
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[threads] = "1"
try:
    import cv2
    import numpy as np
    import scipy.fft

    import thesis_opencv as peer
except ImportError as missing:
    print(f"skipped: {missing}; pip install numpy scipy scikit-learn opencv-python-headless")
    sys.exit(0)

ROOT = Path(__file__).resolve().parents[2]
#: Runs go on for so long, so many times.
ENOUGH_SECONDS = 0.1
ROUNDS = 3
CELL_M = 0.05
SIZES = (848, 480), (1280, 720)
#: Focal length, parts of the picture's width.
FOCAL = 600 / 848
#: The thesis has no probability; its confidence is above 1 for all that it says.
CLAIMED = 0.5
RIGHT_PERCENT, RIGHT_DEG = 5.0, 5.0


def mean_time(stage) -> float:
    """Mean of many runs, microseconds of time on a core; the least of some such means, for others on the core make it longer."""
    stage()
    means = []
    for _ in range(ROUNDS):
        start, runs = time.thread_time(), 0
        while (spent := time.thread_time() - start) < ENOUGH_SECONDS or runs == 0:
            stage()
            runs += 1
        means.append(spent / runs * 1e6)
    return min(means)


def times(gray: np.ndarray, K: np.ndarray) -> dict[str, float]:
    """Of the stages that the example times too, by its names."""
    h, w = gray.shape
    section = gray[: h // 2, : w // 2]
    numbers, image = gray.astype(np.float32), peer.spectrum(section)
    return {
        "real 2-D transform of the picture": mean_time(lambda: scipy.fft.rfft2(numbers, workers=1)),
        "spectrum of a section": mean_time(lambda: peer.spectrum(section)),
        "peaks of a section": mean_time(lambda: peer.peaks(image)),
        "section to scored wave vectors": mean_time(lambda: peer.wave_vectors(peer.spectrum(section))),
        "four sections to the plane": mean_time(lambda: peer.sections(gray, K, CELL_M)),
        "whole frame with junctions": mean_time(lambda: peer.frame(gray, K, CELL_M)),
    }


def compare(width: int, height: int) -> None:
    """Prints the tables of pictures of one size."""
    K = np.array([[FOCAL * width, 0, width / 2], [0, FOCAL * width, height / 2], [0, 0, 1]])
    ours, theirs = collections.defaultdict(list), collections.defaultdict(list)
    errors = collections.defaultdict(list)
    with tempfile.TemporaryDirectory() as folder:
        run = ["cargo", "run", "--quiet", "--release", "--no-default-features", "--example", "thesis_peer", "--"]
        command = [*run, folder, str(width), str(height)]
        example = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        truth = {}

        def score(method: str, name: str, pose) -> None:
            """Range error, %, and normal's, degrees; None where nothing is claimed."""
            if pose is None:
                errors[method].append(None)
                return
            range_m, normal = pose
            cosine = np.clip(normal @ truth[name][1:], -1, 1)
            errors[method].append((100 * abs(range_m / truth[name][0] - 1), np.degrees(np.arccos(cosine))))

        for kind, name, *rest in csv.reader(example.stdout):
            if kind == "truth":
                truth[name] = np.array(rest, float)
            elif kind == "time":
                ours[rest[0]].append(float(rest[1]))
            elif kind == "pose":
                claimed = bool(rest[1]) and (rest[0] == "thesis" or float(rest[5]) >= CLAIMED)
                pose = np.array(rest[1:5], float) if claimed else None
                score(f"net-fft, {rest[0]}", name, None if pose is None else (pose[0], pose[1:]))
            elif kind == "done":
                gray = cv2.imread(str(Path(folder) / f"{name}.pgm"), cv2.IMREAD_GRAYSCALE)
                for stage, value in times(gray, K).items():
                    theirs[stage].append(value)
                found = peer.sections(gray, K, CELL_M)
                score("OpenCV, thesis", name, None if found is None else (found[1], found[0]))
                print(file=example.stdin, flush=True)
        if example.wait() != 0:
            sys.exit(f"the example failed: status {example.returncode}")

    print(f"\n{len(truth)} pictures of {width} x {height}; the last column is the median of the pictures' own ratios\n")
    print("| stage | net-fft ms | OpenCV ms | OpenCV / net-fft |\n|---|---|---|---|")
    whole = "four sections to the plane"
    for stage, values in ours.items():
        peers = theirs.get(stage) or theirs[whole]
        ratio = np.median(np.divide(peers, values))
        print(f"| {stage} | {np.median(values) / 1e3:.3f} | {np.median(peers) / 1e3:.3f} | {ratio:.1f} |")
    print("\n| method | right | wrong | refused | range % median | normal ° median |\n|---|---|---|---|---|---|")
    for method, all_errors in errors.items():
        claimed = [e for e in all_errors if e is not None]
        right = [e for e in claimed if e[0] <= RIGHT_PERCENT and e[1] <= RIGHT_DEG]
        medians = np.median(right, axis=0) if right else (np.nan, np.nan)
        refused = len(all_errors) - len(claimed)
        print(f"| {method} | {len(right)} | {len(claimed) - len(right)} | {refused} | {medians[0]:.2f} | {medians[1]:.2f} |")


def main() -> None:
    cv2.setNumThreads(1)
    for width, height in SIZES:
        compare(width, height)


if __name__ == "__main__":
    main()
