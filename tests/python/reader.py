"""Reads what `tactus` wrote: `reader.py FOLDER`, with demo.csv, reach.toml, run.csv and fast.csv in the folder."""

import pathlib
import runpy
import sys

import numpy as np

import tactus_reader as tr

folder, package = pathlib.Path(sys.argv[1]), pathlib.Path(tr.__file__).parent.parent

demo = tr.read_recording(folder / "demo.csv")
assert demo.q.shape == (len(demo), 7) and set(demo["state"]) == {"gravity"}, demo.columns.keys()
assert np.allclose(np.diff(demo.time), 1 / 300, atol=1e-6)
assert np.allclose(np.linalg.norm(demo.orientation, axis=1), 1, atol=1e-6)

primitive = tr.read_primitive(folder / "reach.toml")
movement = primitive["movement"]
assert primitive["name"] == "reach" and abs(movement["duration_s"] - 3.6) < 0.3, movement
assert primitive["weights"]["position"].shape == (3, movement["kernels"])
assert np.allclose(primitive["goal"]["position_m"], demo.position[-1], atol=0.005)

run, fast = tr.read_recording(folder / "run.csv"), tr.read_recording(folder / "fast.csv")
assert run.notes["primitive"].startswith("reach 0x") and run.notes["primitive"] == fast.notes["primitive"]
assert (run.notes["speed"], fast.notes["speed"]) == ("1", "1.5"), run.notes
ratio = np.ptp(run.time[run.progress() <= 1]) / np.ptp(fast.time[fast.progress() <= 1])
assert abs(ratio - 1.5) < 0.05, ratio
progress, (a, b) = tr.align([run, fast], "position_d", alpha=movement["alpha"])
assert a.shape == (101, 3)
# By phase the two speeds are the same plan; by time they are not. Where the arm is, is another matter: it lags.
assert np.abs(a - b).max() < 0.005, np.abs(a - b).max()
count = min(len(run), len(fast))
assert np.abs(run.position[:count] - fast.position[:count]).max() > 0.05

torn = folder / "torn.csv.part"
torn.write_text((folder / "run.csv").read_text()[:-20])
assert len(tr.read_recording(torn)) == len(run) - 1
for text, words in [("a,b\n1,2\n", "no column t_s"), ("t_s,phase\n1\n", "line 2: 1 fields"), ("t_s\nx\n", "column t_s"), ("", "no header"), ("t_s\n0.1\n0.12", "line 3: the line has no end")]:
    (folder / "bad.csv").write_text(text)
    try:
        tr.read_recording(folder / "bad.csv")
    except ValueError as error:
        assert words in str(error), error
    else:
        raise AssertionError(f"{text!r} was read")

sys.argv = ["compare.py", *(str(folder / name) for name in ["run.csv", "fast.csv", "reach.toml"])]
runpy.run_path(str(package / "examples" / "compare.py"))
