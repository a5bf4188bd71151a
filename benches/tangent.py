"""How far poses are off the true tangent of a bent net, on a path-traced sequence whose knots are known.

    python benches/tangent.py SEQUENCE RUN/poses.csv [..]

SEQUENCE has `seq.json` (knots of its first layer in the net frame, m) and `truth.csv` (net to camera, `r00` .. `r22`, `tx`, `ty`, `tz`). The tangent is that of a cubic surface
fitted to the knots within 0.3 m of where the optical axis meets the net. Prints medians and 95th percentiles of the frames with a pose, and the root mean square of the errors in
units of their standard deviations (the normal's over both of its directions). Needs NumPy.
"""

import csv
import json
import pathlib
import sys

import numpy as np

RADIUS_M = 0.3


def tangent(knots):
    """Depth, m, and unit normal on the optical axis of knots in the camera frame; None where too few are near."""
    near = knots[(knots[:, 2] > 0.2) & (np.hypot(knots[:, 0], knots[:, 1]) < RADIUS_M)]
    if len(near) < 20:
        return None
    x, y, z = near.T
    terms = np.stack([x**i * y**j for i in range(4) for j in range(4 - i)], axis=1)
    of = {(i, j): k for k, (i, j) in enumerate((i, j) for i in range(4) for j in range(4 - i))}
    c = np.linalg.lstsq(terms, z, rcond=None)[0]
    normal = np.array([-c[of[1, 0]], -c[of[0, 1]], 1.0])
    return c[0], normal / np.linalg.norm(normal)


def main():
    sequence = pathlib.Path(sys.argv[1])
    knots = np.array(json.loads((sequence / "seq.json").read_text())["layers"][0]["nodes"], float)[:, 2:5]
    truth = {int(t["frame"]): t for t in csv.DictReader((sequence / "truth.csv").open())}
    for run in sys.argv[2:]:
        rows = []
        for row in csv.DictReader(open(run)):
            t = truth.get(int(row["frame"]))
            if row["status"] != "ok" or t is None:
                continue
            rotation = np.array([[float(t[f"r{a}{b}"]) for b in range(3)] for a in range(3)])
            true = tangent(knots @ rotation.T + [float(t[k]) for k in ("tx", "ty", "tz")])
            if true is None:
                continue
            normal = np.array([float(row[f"normal_{k}"]) for k in "xyz"])
            off_deg = np.degrees(np.arccos(np.clip(normal @ true[1], -1.0, 1.0)))
            off_m = float(row["range_m"]) - true[0]
            rows.append((off_deg, 100.0 * abs(off_m) / true[0], off_deg / float(row["sigma_tilt_deg"]), off_m / float(row["sigma_range_m"])))
        if not rows:
            sys.exit(f"{run}: no frame with a pose whose truth is known")
        e = np.array(rows)
        (n50, r50), (n95, r95) = np.median(e[:, :2], axis=0), np.percentile(e[:, :2], 95, axis=0)
        z = np.sqrt(np.mean(e[:, 2:] ** 2, axis=0) / [2.0, 1.0])
        print(f"{run}: {len(e)} frames, normal {n50:.2f} / {n95:.2f} deg, range {r50:.3f} / {r95:.3f} %, in standard deviations {z[0]:.2f} and {z[1]:.2f}")


if __name__ == "__main__":
    main()
