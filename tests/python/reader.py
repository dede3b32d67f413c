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

# Two runs that somebody looking on recorded are two, and what a run that was stopped did not play is not known.
lines = (folder / "run.csv").read_text().splitlines(keepends=True)
head = next(number for number, line in enumerate(lines) if not line.startswith("#"))
(folder / "both.csv").write_text("\ufeff" + "".join(lines + lines[head + 1:]), encoding="utf-8")
both = tr.read_recording(folder / "both.csv")
assert both.notes == run.notes and [len(one) for one in both.movements()] == 2 * [run.is_running.sum()]
try:
    tr.align([both], "position")
except ValueError as error:
    assert "2 movements" in str(error), error
else:
    raise AssertionError("two movements were aligned as one")
stopped = both.movements()[1]
(folder / "stopped.csv").write_text("".join(lines[:head + 1 + np.argmax(run.progress() > 0.5)]))
_, (whole, part) = tr.align([stopped, tr.read_recording(folder / "stopped.csv")], "position", alpha=movement["alpha"])
assert np.isfinite(whole).all() and np.isnan(part[60:]).all()
assert np.allclose(part[:45], whole[:45]), np.abs(part[:45] - whole[:45]).max()

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
