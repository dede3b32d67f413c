"""Drives the simulated pucks with unmodified python-can: `socketcand.py HOST PORT FOLDER`.

The bus is that of `tactus sim --can HOST:PORT --can-only`. FOLDER holds the transcripts of conversations between the
manufacturer's library and its pucks (`crates/puck/tests/vectors`). Their requests are sent, and the answers compared.
"""

import csv
import pathlib
import sys
import time

import can

STAT, ROLE, VERS = 5, 1, 0
READY = 2
GET_POSITIONS = 0x30
SAFETY, HAND, ARM = 10, range(11, 15), range(1, 8)

# What the transcripts' pucks answer otherwise than these: they are of an older firmware (VERS), and have been
# initialised before (MODE).
DIFFERENT = {0x80 | VERS, 0x88}


def listen(bus, seconds):
    """Frames that come within a time, as (identifier, data)."""
    frames, end = [], time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        message = bus.recv(timeout=left)
        if message is not None:
            assert not message.is_error_frame, "frames were lost"
            frames.append((message.arbitration_id, bytes(message.data)))
    return frames


def say(bus, identifier, data):
    bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))


def replies(bus, identifiers, within=2.0):
    """Data of the next frame of each identifier, in whatever order they come."""
    heard, end = {}, time.monotonic() + within
    while len(heard) < len(identifiers):
        message = bus.recv(timeout=max(end - time.monotonic(), 0))
        missing = [f"{identifier:03X}" for identifier in identifiers if identifier not in heard]
        assert message is not None, f"no frame {missing} within {within} s"
        if message.arbitration_id in identifiers:
            heard.setdefault(message.arbitration_id, bytes(message.data))
    return heard


def ask(bus, node, prop):
    """Value of a property of a node: 16 or 32 bits."""
    say(bus, node, [prop])
    data = replies(bus, [0x406 | node << 5]).popitem()[1]
    assert data[0] == 0x80 | prop, data.hex()
    return int.from_bytes(data[2:], "little", signed=True)


def wake(bus, nodes):
    for node in nodes:
        say(bus, node, [0x80 | STAT, 0, READY, 0, 0, 0])
    listen(bus, 1.2)
    for node in nodes:
        assert ask(bus, node, STAT) == READY, f"node {node} sleeps"


def transcript(bus, path):
    """Sends the requests of a transcript; gives how many answers were compared."""
    with open(path) as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    frames = [(row["dir"], int(row["can_id_hex"], 16), bytes.fromhex(row["data_hex"])) for row in rows]
    compared = 0
    for number, (direction, identifier, data) in enumerate(frames):
        if direction == "R":
            continue
        expected = {}
        for later, node, answer in frames[number + 1 :]:
            if later == "T":
                break
            expected[node] = answer
        say(bus, identifier, data)
        is_wake = data[0] == 0x80 | STAT
        heard = replies(bus, expected) if expected else {}
        for node, answer in expected.items():
            same = heard[node] == answer if answer[0] not in DIFFERENT else heard[node][0] == answer[0]
            assert same, f"{node:03X}: {heard[node].hex()} instead of {answer.hex()}"
            compared += 1
        if not expected:
            listen(bus, 1.2 if is_wake else 0.01)
    return compared


def main():
    host, port, folder = sys.argv[1], int(sys.argv[2]), pathlib.Path(sys.argv[3])
    with can.Bus(interface="socketcand", host=host, port=port, channel="can0") as bus:
        listen(bus, 0.3)
        print("safety module, VERS", ask(bus, SAFETY, VERS))
        wake(bus, ARM)
        say(bus, 0x404, [GET_POSITIONS])
        positions = [frame for frame in listen(bus, 0.1) if frame[0] & 0x41F == 0x403]
        assert len(positions) == 7, positions
        print("positions of", len(positions), "pucks")
        for name in ["transcript_safety_ctor.csv", "transcript_hand_init.csv"]:
            print(name, transcript(bus, folder / name), "answers as expected")


main()
