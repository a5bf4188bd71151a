"""The thesis's frame in Python on OpenCV, SciPy and scikit-learn: the peer that the Rust stages are timed against.

Strandenes 2023, chapter 4: spectrum, peaks (Alg 2), peak values (Alg 3), one-cell PnP, four sections, plane, variable area
(Alg 5), junctions (Alg 4); errata mended, Hann window. Written for a fair race: vectorised where NumPy allows it.
"""

from __future__ import annotations

import cv2
import numpy as np
import scipy.fft
from scipy import ndimage
from sklearn.cluster import DBSCAN

NEIGHBOURHOOD, PEAK_THRESHOLD, PEAK_EPS, MARGIN, ELLIPSE = 16, 20, 10.0, 40.0, 0.25
WEIGHTS, DECREASE, REPEAT_RADIUS, REPEATS, STRONGEST = (1.5, 2.0, 1.0), 0.9, 4.0, 10, 20
BLUR, BLOCK, OFFSET, AREA_WINDOW, SQUARENESS, CORNER_EPS = 3, 15, -4, (0.4, 1.6), 0.6, 6.0


def spectrum(gray: np.ndarray) -> np.ndarray:
    """Centred log magnitude, 0..255 uint8, of the Hann-windowed image."""
    h, w = gray.shape
    image = (gray - gray.mean()) * np.outer(np.hanning(h), np.hanning(w))
    half = np.log1p(np.abs(scipy.fft.rfft2(image.astype(np.float32), workers=1)))
    full = np.empty((h, w), np.float32)
    full[:, : half.shape[1]] = half
    rest = w - half.shape[1]
    full[:, half.shape[1] :] = np.roll(half[::-1], 1, axis=0)[:, rest:0:-1]
    image8 = cv2.normalize(np.fft.fftshift(full), None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    return cv2.GaussianBlur(image8, (BLUR, BLUR), 0)


def edge_fraction(x, y, rh, rv):
    """How far (x, y) lies on the way from the centre to the ellipse's edge (4.11, mended)."""
    return np.sqrt((rv * x) ** 2 + (rh * y) ** 2) / (rh * rv)


def peaks(image: np.ndarray):
    """Offsets from the centre (N, 2) and values (N,) in the left half plane, inside the ellipse, above the falling threshold."""
    h, w = image.shape
    cx, cy, rh, rv = w // 2, h // 2, ELLIPSE * w, ELLIPSE * h
    x0, x1 = max(0, int(cx - rh - NEIGHBOURHOOD)), cx + NEIGHBOURHOOD + 1
    y0, y1 = max(0, int(cy - rv - NEIGHBOURHOOD)), min(h, int(cy + rv + NEIGHBOURHOOD + 1))
    crop = image[y0:y1, x0:x1].astype(np.int16)
    highest = ndimage.maximum_filter(crop, NEIGHBOURHOOD)
    maxima = (crop == highest) & (highest - ndimage.minimum_filter(crop, NEIGHBOURHOOD) > PEAK_THRESHOLD)
    labels, n = ndimage.label(maxima)
    mean = float(image[int(cy - rv) : int(cy + rv) + 1, int(cx - rh) : cx + 1].mean())
    geometry = (cx, cy, rh, rv, mean)
    if n == 0:
        return np.zeros((0, 2)), np.zeros(0), geometry
    at = np.array(ndimage.center_of_mass(maxima, labels, np.arange(1, n + 1)))
    value = crop[tuple(np.round(at).astype(int).T)].astype(float)
    cluster = DBSCAN(eps=PEAK_EPS, min_samples=1).fit_predict(at)
    strongest = [np.flatnonzero(cluster == c)[np.argmax(value[cluster == c])] for c in np.unique(cluster)]
    x, y, value = at[strongest, 1] + x0 - cx, at[strongest, 0] + y0 - cy, value[strongest]
    keep = (x <= 1.5) & (edge_fraction(x, y, rh, rv) < 1) & (np.hypot(x, y) > 4) & ~((np.abs(x) <= 1.5) & (y > 0))
    top = float(image[cy - 1 : cy + 2, cx - 1 : cx + 2].max()) - MARGIN
    keep &= value >= top - (top - float(image.mean())) * edge_fraction(x, y, rh, rv)
    return np.stack([x[keep], y[keep]], 1), value[keep], geometry


def beam(image, cx, cy, dx, dy, rh, rv):
    """Mean of a beam three pixels wide from the centre to the ellipse's edge."""
    d = np.hypot(dx, dy)
    s = np.arange(2, d / edge_fraction(dx, dy, rh, rv))[:, None]
    o = np.arange(-1, 2)
    u = np.clip(np.round(cx + s * dx / d - o * dy / d).astype(int), 0, image.shape[1] - 1)
    v = np.clip(np.round(cy + s * dy / d + o * dx / d).astype(int), 0, image.shape[0] - 1)
    return float(image[v, u].mean())


def wave_vectors(image: np.ndarray):
    """Two wave vectors, cycles per pixel (2, 2), and a confidence; None when there are fewer than two peaks."""
    at, value, (cx, cy, rh, rv, mean) = peaks(image)
    if len(at) < 2:
        return None
    total, vectors = [], []
    for k in np.argsort(-value)[:STRONGEST]:
        v, weight, score, scale = at[k].copy(), 1.0, 0.0, 1.0
        for n in range(2, REPEATS):
            d = np.hypot(*(at - n * v).T)
            near = np.flatnonzero(d <= REPEAT_RADIUS)
            if near.size == 0:
                break
            j = near[np.argmax(value[near])]
            score += (value[j] - mean) * scale
            scale *= DECREASE
            v = (v * weight + at[j] / n * n * n) / (weight + n * n)
            weight += n * n
        total.append(
            WEIGHTS[0] * (value[k] - mean) + WEIGHTS[1] * (beam(image, cx, cy, *at[k], rh, rv) - mean) + WEIGHTS[2] * score
        )
        vectors.append(v)
    total, f = np.array(total), np.array(vectors) / [image.shape[1], image.shape[0]]
    order = np.argsort(-total)
    unit = f / np.linalg.norm(f, axis=1)[:, None]
    across = [j for j in order[1:] if abs(unit[order[0]] @ unit[j]) < np.cos(np.radians(55))]
    if not across:
        return None
    rest = [j for j in order[1:] if j != across[0]]
    return f[[order[0], across[0]]], float(total[order[0]] / total[rest[0]]) if rest else 1.0


def cell_pose(f, centre, K, cell):
    """Lattice vectors by inverse transpose, right-handed, and the pose of one cell by IPPE."""
    b = np.linalg.inv(f).T
    if abs(b[0, 0]) / np.linalg.norm(b[0]) < abs(b[1, 0]) / np.linalg.norm(b[1]):
        b = b[::-1]
    b = b * [[np.sign(b[0, 0]) or 1], [1]]
    if np.linalg.det(b) < 0:
        b = b * [[1], [-1]]
    h = cell / 2
    corners = np.array([[-h, -h, 0], [-h, h, 0], [h, h, 0], [h, -h, 0]])
    pixels = np.array([-b[0] - b[1], -b[0] + b[1], b[0] + b[1], b[0] - b[1]]) / 2 + centre
    ok, _, t = cv2.solvePnP(corners, pixels, K, None, flags=cv2.SOLVEPNP_IPPE)
    return b, t.ravel() if ok else None


def sections(gray, K, cell):
    """Four sections: (normal, depth on the axis, R with the axes as columns, mean cell area px2), None without three poses."""
    h, w = gray.shape[0] // 2, gray.shape[1] // 2
    found = []
    for iy in (0, 1):
        for ix in (0, 1):
            wave = wave_vectors(spectrum(gray[iy * h : (iy + 1) * h, ix * w : (ix + 1) * w]))
            if wave is None:
                continue
            b, t = cell_pose(wave[0], (ix * w + w / 2, iy * h + h / 2), K, cell)
            if t is not None:
                found.append((wave[1], b, t))
    if len(found) < 3:
        return None
    best = sorted(found, key=lambda s: -s[0])[:3]
    p = [s[2] for s in best]
    n = np.cross(p[2] - p[0], p[1] - p[0])
    n = n / np.linalg.norm(n) * (np.sign(n[2]) or 1)
    if abs(n[2]) < 1e-6:
        return None
    along = np.array([s[1][0] for s in best])
    along = (along * np.sign(along @ along[0])[:, None]).mean(0)
    x = np.append(along, 0) / np.linalg.norm(along)
    x = x - np.array([0, 0, n @ x / n[2]])
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(n, x), n], 1)
    area = float(np.median([abs(np.linalg.det(s[1])) for s in best]))
    return n, float(n @ p[2] / n[2]), R, area


def junctions(gray, K, n, depth, area):
    """Junctions (N, 2) px from contours, with the cell area varying over the image as the plane says (1/Z linear, cubed)."""
    h, w = gray.shape
    u, v = np.meshgrid(np.arange(w, dtype=np.float32), np.arange(h, dtype=np.float32))
    ray = (n[0] * (u - K[0, 2]) / K[0, 0] + n[1] * (v - K[1, 2]) / K[1, 1] + n[2]) / n[2]
    expected = area * np.maximum(ray, 1e-3) ** 3
    smooth = cv2.GaussianBlur(gray, (BLUR, BLUR), 0)
    binary = cv2.adaptiveThreshold(smooth, 255, cv2.ADAPTIVE_THRESH_GAUSSIAN_C, cv2.THRESH_BINARY, BLOCK, OFFSET)
    contours, _ = cv2.findContours(binary, cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)
    corners = []
    for contour in contours:
        size = cv2.contourArea(contour)
        if size < 4:
            continue
        at = contour.reshape(-1, 2).mean(0).astype(int)
        if not AREA_WINDOW[0] < size / expected[min(h - 1, at[1]), min(w - 1, at[0])] < AREA_WINDOW[1]:
            continue
        box = cv2.minAreaRect(contour)
        if min(box[1]) >= max(1, SQUARENESS * max(box[1])):
            corners.append(cv2.boxPoints(box))
    if not corners:
        return np.zeros((0, 2))
    points = np.concatenate(corners)
    label = DBSCAN(eps=CORNER_EPS, min_samples=3).fit_predict(points)
    keep, count = label >= 0, label.max() + 1
    size = np.maximum(np.bincount(label[keep], minlength=count), 1)
    return np.stack([np.bincount(label[keep], points[keep, k], count) / size for k in (0, 1)], 1)


def frame(gray, K, cell):
    """The thesis's whole frame. None where it finds no plane."""
    found = sections(gray, K, cell)
    if found is None:
        return None
    n, depth, R, area = found
    return n, depth, R, junctions(gray, K, n, depth, area)
