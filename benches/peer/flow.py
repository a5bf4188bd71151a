"""Tracking beside OpenCV: pyramidal Lucas-Kanade, Farneback, DIS and net-flow on the same frames, one thread each.

    python benches/peer/flow.py [SCENARIO ...]        default: tracking tracking-loop
    python benches/peer/flow.py --folder DIR ...      folders of binary PGM pictures with truth.csv

Draws scenarios with the simulator (`cargo run --example sequence`), follows the same points with every method, and prints a table of
errors after the last frame and of CPU time per frame. A point counts as slipped when it ends more than half a cell from its truth.
"""

from __future__ import annotations

import argparse
import csv
import io
import re
import subprocess
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
POINTS = 300


def read(folder: Path):
    """Frames (uint8), and true points (frame, point, 2)."""
    frames = [cv2.imread(str(p), cv2.IMREAD_GRAYSCALE) for p in sorted(folder.glob("*.pgm"))]
    rows = np.array(list(csv.reader((folder / "truth.csv").open()))[1:], float)
    truth = np.zeros((len(frames), int(rows[:, 1].max()) + 1, 2))
    truth[rows[:, 0].astype(int), rows[:, 1].astype(int)] = rows[:, 2:]
    return frames, truth


def robust(points, moved, good):
    """RANSAC similarity of the good points; the others, and outliers, take its motion."""
    if good.sum() < 6:
        good = np.ones(len(points), bool)
    motion, _ = cv2.estimateAffinePartial2D(
        points[good].astype(np.float32), moved[good].astype(np.float32), ransacReprojThreshold=1.5
    )
    if motion is None:
        return moved
    carried = points @ motion[:, :2].T + motion[:, 2]
    return np.where((np.hypot(*(moved - carried).T) > 1.5)[:, None] | ~good[:, None], carried, moved)


def lucas_kanade(a, b, points, levels=3):
    """There and back, then RANSAC."""
    window = dict(winSize=(31, 31), maxLevel=levels)
    moved, found, _ = cv2.calcOpticalFlowPyrLK(a, b, points.astype(np.float32)[:, None], None, **window)
    back, _, _ = cv2.calcOpticalFlowPyrLK(b, a, moved, None, **window)
    near = np.hypot(*(back[:, 0] - points).T) < 0.7
    return robust(points, moved[:, 0].astype(float), near & (found.ravel() > 0))


def sample(flow, points):
    at = points.astype(np.float32)
    take = [cv2.remap(flow[..., k], at[None, :, 0], at[None, :, 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for k in (0, 1)]
    return points + np.stack([t[0] for t in take], 1)


def farneback(a, b, points, levels=4):
    return sample(cv2.calcOpticalFlowFarneback(a, b, None, 0.5, levels, 25, 3, 7, 1.5, 0), points)


DIS = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)


def dis(a, b, points):
    return sample(DIS.calc(a, b, None), points)


def errors(end, truth, cell):
    distance = np.hypot(*(end - truth).T)
    return np.median(distance), np.percentile(distance, 90), distance.max(), float((distance > cell / 2).mean())


def follow(folder: Path, *options: str):
    """net-flow's positions in the last frame, its CPU milliseconds a frame, and what it says of itself."""
    command = ["cargo", "run", "--quiet", "--release", "-p", "net-flow", "--example", "follow", "--", str(folder), *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    last = max(int(r["frame"]) for r in rows)
    end = {int(r["point"]): (float(r["u"]), float(r["v"])) for r in rows if int(r["frame"]) == last}
    summary = done.stderr.strip().splitlines()[-1]
    cpu = float(re.search(r"([\d.]+) ms CPU", summary)[1])
    return end, cpu, re.search(r"steps (.*?);", summary)[1]


def compare(name: str, folder: Path, with_dense: bool):
    frames, truth = read(folder)
    spacing = np.sort(np.hypot(*(truth[0][:, None] - truth[0][None]).transpose(2, 0, 1)), axis=1)[:, 1:3]
    cell = float(np.median(spacing))
    keep = np.linspace(0, truth.shape[1] - 1, min(POINTS, truth.shape[1])).astype(int)
    step = np.hypot(*np.diff(truth, axis=0).reshape(-1, 2).T).max()
    print(f"\n### {name}: {len(frames)} frames, {truth.shape[1]} knots, cells of {cell:.0f} px, steps of at most {step:.1f} px\n")
    print("| method | median px | p90 px | worst px | slipped | CPU ms a frame | time / ours |\n|---|---|---|---|---|---|---|")
    ours = {}
    for label, options in (("net-flow, from the key frame", ()), ("net-flow, summed", ("--summed",))):
        end, cpu, says = follow(folder, *options)
        ids = sorted(end)
        ours[label] = (errors(np.array([end[i] for i in ids]), truth[-1][ids], cell), cpu, says) if ids else ((np.nan,) * 4, cpu, says)
    base = ours["net-flow, from the key frame"][1]
    for label, (e, cpu, says) in ours.items():
        print(f"| {label} ({says}) | {e[0]:.2f} | {e[1]:.2f} | {e[2]:.1f} | {e[3]:.0%} | {cpu:.1f} | {cpu / base:.2f} |")
    peers = {"PyrLK, there and back, RANSAC": lucas_kanade}
    if with_dense:
        peers |= {"Farneback": farneback, "DIS medium": dis}
    for label, method in peers.items():
        points, start = truth[0][keep].copy(), time.process_time()
        for a, b in zip(frames, frames[1:]):
            points = method(a, b, points)
        cpu = (time.process_time() - start) / (len(frames) - 1) * 1e3
        e = errors(points, truth[-1][keep], cell)
        print(f"| {label}, summed | {e[0]:.2f} | {e[1]:.2f} | {e[2]:.1f} | {e[3]:.0%} | {cpu:.1f} | {cpu / base:.2f} |", flush=True)
        direct = method(frames[0], frames[-1], truth[0][keep])
        e = errors(direct, truth[-1][keep], cell)
        print(f"| {label}, first to last | {e[0]:.2f} | {e[1]:.2f} | {e[2]:.1f} | {e[3]:.0%} | | |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", nargs="*", default=["tracking", "tracking-loop"])
    parser.add_argument("--folder", type=Path, nargs="+", default=[])
    parser.add_argument("--sparse", action="store_true", help="leave out the dense methods")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    print("Thesis (GMA network): 6.7 px after 99 summed flows, 1.4 px first to last, 13.5 px after a loop of 125 frames, about 3 s a flow.")
    for folder in args.folder:
        compare(folder.name, folder, not args.sparse)
    if args.folder:
        return
    with tempfile.TemporaryDirectory() as scratch:
        for name in args.scenario:
            folder = Path(scratch) / name
            draw = ["cargo", "run", "--quiet", "--release", "-p", "net-flow", "--example", "sequence", "--", name, str(folder)]
            subprocess.run(draw, cwd=ROOT, check=True)
            compare(name, folder, not args.sparse)


if __name__ == "__main__":
    main()
