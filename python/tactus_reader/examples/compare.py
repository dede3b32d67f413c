"""Prints how two runs of a movement differ at equal phase: `compare.py A.csv B.csv [PRIMITIVE.toml]`."""

import sys

import numpy as np

import tactus_reader as tr


def main():
    runs = [tr.read_recording(path) for path in sys.argv[1:3]]
    alpha = tr.read_primitive(sys.argv[3])["movement"]["alpha"] if len(sys.argv) > 3 else tr.ALPHA
    names = [run.notes.get("primitive") for run in runs]
    if names[0] != names[1]:
        raise SystemExit(f"not the same movement: {names[0]} and {names[1]}")
    progress, (a, b) = tr.align(runs, "position", points=11, alpha=alpha)
    _, (force_a, force_b) = tr.align(runs, "wrench", points=11, alpha=alpha)
    distance = np.linalg.norm(a - b, axis=1)
    force = np.linalg.norm((force_a - force_b)[:, :3], axis=1)
    print("progress  distance, mm  force, N")
    for row in zip(progress, 1000 * distance, force):
        print("{:8.1f}  {:12.2f}  {:8.2f}".format(*row))


main()
