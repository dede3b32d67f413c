//! Recordings as MCAP: read back with the crate that reads such files.

use std::collections::BTreeMap;
use std::path::Path;

use lab::demonstration::Recording;
use lab::export;
use mcap::MessageStream;
use serde_json::Value;

use crate::common;

fn exported(text: &str) -> (Recording, Vec<u8>) {
    let recording = Recording::parse(Path::new("run.csv"), text.as_bytes()).unwrap();
    let bytes = export::mcap(&recording).unwrap();
    (recording, bytes)
}

fn messages(bytes: &[u8]) -> BTreeMap<String, Vec<(u64, Value)>> {
    let mut topics: BTreeMap<String, Vec<(u64, Value)>> = BTreeMap::new();
    for message in MessageStream::new(bytes).unwrap() {
        let message = message.unwrap();
        assert_eq!(message.channel.message_encoding, "json");
        let value = serde_json::from_slice(&message.data).unwrap();
        topics.entry(message.channel.topic.clone()).or_default().push((message.log_time, value));
    }
    topics
}

#[test]
fn every_quantity_of_a_recording_has_its_channel_and_reads_back_as_it_was() {
    let (recording, bytes) = exported(&common::text(&common::rows(2.0)));
    let topics = messages(&bytes);
    let names: Vec<&str> = topics.keys().map(String::as_str).collect();
    assert_eq!(names, ["/hand", "/joint_states", "/movement", "/tool_pose", "/tool_pose_desired", "/wrench"]);
    assert!(topics.values().all(|messages| messages.len() == recording.time.len()));
    // 1.33 s after the start.
    let row = usize::from(control::time::periods(4.0 / 3.0));
    let at = |topic: &str| &topics[topic][row].1;
    let (time, pose) = &topics["/tool_pose"][row];
    assert_eq!(*time, (recording.time[row] * 1e9).round() as u64);
    assert_eq!(pose["timestamp"]["sec"], 1);
    let (position, orientation) =
        (recording.position.as_ref().unwrap()[row], recording.orientation.as_ref().unwrap()[row]);
    assert_eq!(pose["pose"]["position"]["z"].as_f64(), Some(position[2]));
    assert_eq!(pose["pose"]["orientation"]["w"].as_f64(), Some(orientation[0]));
    assert_eq!(pose["pose"]["orientation"]["z"].as_f64(), Some(orientation[3]));
    let q = recording.q.as_ref().unwrap()[row];
    assert_eq!(at("/joint_states")["position"][6].as_f64(), Some(q[6]));
    assert_eq!(at("/joint_states")["effort"][1], 20.0);
    assert_eq!((&at("/wrench")["force"]["y"], &at("/wrench")["torque"]["z"]), (&(-0.25).into(), &0.125.into()));
    assert_eq!((&at("/hand")["desired"][3], &at("/hand")["gauges"][1]), (&1.0.into(), &(-0.5).into()));
    assert_eq!((&at("/movement")["state"], &at("/movement")["surprise"]), (&"gravity".into(), &1.5.into()));
}

#[test]
fn a_quantity_that_was_not_recorded_is_left_out_and_no_schema_has_references_or_choices() {
    let (_, bytes) = exported(&common::foreign(1.0));
    let topics = messages(&bytes);
    assert_eq!(topics.keys().collect::<Vec<_>>(), ["/movement", "/tool_pose", "/wrench"]);
    assert_eq!(topics["/movement"][0].1.as_object().unwrap().len(), 1, "the time alone is known");
    let (_, bytes) = exported(&common::text(&common::rows(2.0)));
    for message in MessageStream::new(&bytes).unwrap() {
        let schema = message.unwrap().channel.schema.clone().unwrap();
        assert_eq!(schema.encoding, "jsonschema");
        let text = std::str::from_utf8(&schema.data).unwrap();
        assert!(!text.contains("$ref") && !text.contains("null") && text.contains("timestamp"), "{text}");
    }
}

#[test]
fn everything_that_the_notes_say_is_in_the_metadata() {
    let notes = "# primitive: reach 0x0a1b2c3d\n# speed: 0.5\n# mode: adapt\n# goal_m: 0.5,-0.25,0.1\n\
                 # device: board\n# firmware: 0.1.0\n# date: 2026-11-22T17:05:09Z\n";
    let (recording, bytes) = exported(&format!("{notes}{}", common::foreign(1.0)));
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let metadata = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap().metadata;
    let kept: Vec<String> = metadata.iter().map(|(key, value)| format!("{key}: {value}")).collect();
    let mut expected: Vec<String> = recording.origin.to_string().lines().map(str::to_owned).collect();
    expected.sort();
    assert_eq!(kept, expected);
}
