#!/usr/bin/env python3
"""Writes the three examples of the page, each with one hidden cause, into a directory: python3 make_gallery.py gateway/http/gallery

Laws of their own, from textbooks, and not from the catalogue of effects, so that the product is not shown with itself.
"""
import gzip
import math
import random
import sys

OUT = sys.argv[1]


def put(name, head, rows):
    with open(f"{OUT}/{name}.csv.gz", "wb") as raw, gzip.GzipFile(fileobj=raw, mode="wb", mtime=0, compresslevel=9) as file:
        file.write((",".join(head) + "\n" + "".join(",".join(str(x) for x in row) + "\n" for row in rows)).encode())


def noise(rng, state, slow, white):
    state[0] = 0.97 * state[0] + rng.gauss(0, slow * math.sqrt(1 - 0.97**2))
    return state[0] + rng.gauss(0, white)


def lathe():
    """Turning, 12 parts, three edges of four parts: the flank wears, and each edge begins sharp."""
    rng, state, rows, cutting = random.Random(11), [0.0], [], {}
    for part in range(12):
        edge = f"T{part // 4 + 1}"
        rate = [1.0, 1.35, 0.8][part // 4]
        for k in range(150):
            n = [900, 1300, 1700, 1300, 2100][k // 30]
            engaged = 1 if k % 30 >= 8 else 0
            ap, f, d = [1.0, 2.0, 1.5, 2.0, 1.0][k // 30], [0.15, 0.25, 0.2, 0.15, 0.25][k // 30], 62
            vc = math.pi * d * n / 1000
            cutting[edge] = cutting.get(edge, 0) + engaged / 60
            wear = 0.05 * rate * (1 - math.exp(-cutting[edge] / 0.7)) + 0.022 * rate * cutting[edge]
            power = 140 + 0.19 * n + 3e-5 * n * n + engaged * (1900 * ap * f**0.75 * vc / 60 + 1.1e3 * wear * ap * vc / 60 * 1.6)
            power += noise(rng, state, 10, 14)
            rows.append([part * 150 + k, f"part {part + 1}", edge, n, round(n * f), ap, d, engaged, round(power, 1)])
    put("turning", ["time_s", "run", "tool", "spindle_speed_rpm", "feed_mm_min", "depth_of_cut_mm", "diameter_mm", "engaged", "spindle_power_w"], rows)


def mill():
    """Milling, 10 runs: a force along the edge that does not depend on the chip (rubbing), which Kienzle's law alone lacks."""
    rng, state, rows = random.Random(23), [0.0], []
    for run in range(10):
        for k in range(160):
            n = [2400, 3600, 4800, 3000][k // 40]
            fz = [0.03, 0.06, 0.1, 0.15, 0.08][(k // 20 + run) % 5]
            ap, ae, d, z = [1.5, 3.0, 2.0, 4.0][(k // 40 + run) % 4], 8.0, 20, 4
            engaged = 1 if k % 20 >= 5 else 0
            vf = n * fz * z
            q = ap * ae * vf / 1000
            hm = fz * math.sqrt(ae / d)
            edge = 28 * ap * z * (math.acos(1 - 2 * ae / d) / (2 * math.pi)) * math.pi * d * n / 60e3
            power = 210 + 0.05 * n + 6e-6 * n * n + engaged * (1700 * hm**-0.25 * q / 60 + edge)
            power += noise(rng, state, 8, 12)
            rows.append([run * 160 + k, f"run {run + 1}", n, round(vf), ap, ae, d, z, engaged, round(power, 1)])
    put("milling", ["time_s", "run", "spindle_speed_rpm", "feed_mm_min", "depth_of_cut_mm", "width_of_cut_mm", "diameter_mm", "teeth", "engaged", "spindle_power_w"], rows)


def axis():
    """A feed axis, 10 runs back and forth over 700 mm at four speeds: dry friction against the motion."""
    rng, state, rows, t = random.Random(37), [0.0], [], 0.0
    for run in range(10):
        x, speed = 20.0, [3000, 6000, 9000, 4500][run % 4]
        way = 1
        for k in range(170):
            x += way * speed / 60 * 0.5
            if x > 700 or x < 20:
                way, x = -way, min(max(x, 20.0), 700.0)
            v = way * speed
            current = 1.35 * math.tanh(v / 20) + 6e-5 * v + 0.1 + noise(rng, state, 0.02, 0.05)
            rows.append([round(t, 2), f"run {run + 1}", round(v), round(x, 2), round(current, 4)])
            t += 0.5
    put("axis", ["time_s", "run", "axis_velocity_mm_min", "axis_position_mm", "axis_current_a"], rows)


lathe()
mill()
axis()
