"""Reads an export with the mcap package: `read_mcap.py RUN.csv RUN.mcap`. The recording and the export agree."""

import json
import sys

from mcap.reader import make_reader

import tactus_reader as tr

run = tr.read_recording(sys.argv[1])
with open(sys.argv[2], "rb") as file:
    reader = make_reader(file)
    counts = {}
    for schema, channel, message in reader.iter_messages():
        row = counts[channel.topic] = counts.get(channel.topic, -1) + 1
        data = json.loads(message.data)
        assert set(json.loads(schema.data)["required"]) <= set(data)
        assert abs(message.log_time * 1e-9 - run.time[row]) < 1e-6
        if channel.topic == "/joint_states":
            assert data["position"] == list(run.q[row])
    assert len(counts) == 6 and set(counts.values()) == {len(run) - 1}, counts
    notes = {record.name: record.metadata for record in reader.iter_metadata()}
    assert notes["tactus"]["primitive"] == run.notes["primitive"], notes
print(len(run), "cycles agree")
