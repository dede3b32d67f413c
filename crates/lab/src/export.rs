//! Recordings as MCAP, the file format of robotics viewers: JSON messages, each with the JSON schema of its type.
//!
//! Times are nanoseconds since the first line of the recording; its notes, the date among them, are the metadata record
//! `tactus`. Poses have the layout and the name of Foxglove's `PoseInFrame`, so that its 3D panel shows them.

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::records::{MessageHeader, Metadata};
use mcap::{McapError, WriteOptions, Writer};
use schemars::{JsonSchema, generate::SchemaSettings};
use serde::Serialize;

use crate::demonstration::Recording;

// A quantity that was not recorded is left out: the type of a viewer's field is one type, never "or null".

/// Frame of positions and forces: origin where the axes of J1 and J2 meet, z up.
const WORLD: &str = "world";

/// A moment, as ROS 2 and Foxglove write it.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
struct Time {
    sec: u32,
    nsec: u32,
}

impl Time {
    fn of(nanoseconds: u64) -> Self {
        let (sec, nsec) = (nanoseconds / 1_000_000_000, nanoseconds % 1_000_000_000);
        Self { sec: u32::try_from(sec).unwrap_or(u32::MAX), nsec: nsec as u32 }
    }
}

/// A vector.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
struct Vector3 {
    x: f64,
    y: f64,
    z: f64,
}

impl Vector3 {
    fn of(values: &[f64]) -> Self {
        Self { x: values[0], y: values[1], z: values[2] }
    }
}

/// A unit quaternion.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

/// A position, m, and an orientation, tool to world.
#[derive(Debug, Clone, Serialize, JsonSchema)]
struct Pose {
    position: Vector3,
    orientation: Quaternion,
}

/// A pose of the tool frame, as `foxglove.PoseInFrame`.
#[derive(Debug, Clone, Serialize, JsonSchema)]
struct PoseInFrame {
    timestamp: Time,
    frame_id: &'static str,
    pose: Pose,
}

/// Joints of arm: angles, rad; velocities, rad/s; torques commanded, N m.
#[derive(Debug, Clone, Serialize, JsonSchema)]
struct JointStates {
    timestamp: Time,
    name: [&'static str; 7],
    position: [f64; 7],
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "[f64; 7]")]
    velocity: Option<[f64; 7]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "[f64; 7]")]
    effort: Option<[f64; 7]>,
}

/// Wrench of the environment on the robot: force in world axes, N; torque about the grasp point in tool axes, N m.
#[derive(Debug, Clone, Serialize, JsonSchema)]
struct Wrench {
    timestamp: Time,
    force: Vector3,
    torque: Vector3,
}

/// Hand: spread and fingers 1 to 3, measured and desired, rad; torque on the outer joints of the fingers, N m.
#[derive(Debug, Clone, Serialize, JsonSchema)]
struct Hand {
    timestamp: Time,
    position: [f64; 4],
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "[f64; 4]")]
    desired: Option<[f64; 4]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "[f64; 3]")]
    gauges: Option<[f64; 3]>,
}

/// State of the supervisor, code of the latched fault, phase of the movement (1 to 0) and statistic of the watch.
#[derive(Debug, Clone, Serialize, JsonSchema)]
struct Movement {
    timestamp: Time,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "String")]
    state: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "u32")]
    fault: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64")]
    phase: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64")]
    surprise: Option<f64>,
}

const JOINT_NAMES: [&str; 7] = ["j1", "j2", "j3", "j4", "j5", "j6", "j7"];

/// A file in the making.
struct Export(Writer<Cursor<Vec<u8>>>);

/// A channel of messages of one type.
struct Channel<T> {
    id: u16,
    messages: std::marker::PhantomData<T>,
}

impl Export {
    fn channel<T: JsonSchema>(&mut self, topic: &str, schema: &str) -> Result<Channel<T>, McapError> {
        // Viewers do not follow references.
        let settings = SchemaSettings::draft07().for_serialize().with(|settings| settings.inline_subschemas = true);
        let text = settings.into_generator().into_root_schema_for::<T>().as_value().to_string();
        let schema = self.0.add_schema(schema, "jsonschema", text.as_bytes())?;
        let id = self.0.add_channel(schema, topic, "json", &BTreeMap::new())?;
        Ok(Channel { id, messages: std::marker::PhantomData })
    }

    fn write<T: Serialize>(&mut self, channel: &Channel<T>, row: usize, at: u64, message: &T) -> Result<(), McapError> {
        let data = serde_json::to_vec(message).map_err(std::io::Error::from)?;
        let sequence = u32::try_from(row).unwrap_or(u32::MAX);
        let header = MessageHeader { channel_id: channel.id, sequence, log_time: at, publish_time: at };
        self.0.write_to_known_channel(&header, &data)
    }

    fn poses(
        &mut self,
        topic: &str,
        times: &[u64],
        position: Option<&[[f64; 3]]>,
        orientation: Option<&[[f64; 4]]>,
    ) -> Result<(), McapError> {
        let (Some(position), Some(orientation)) = (position, orientation) else { return Ok(()) };
        let channel = self.channel::<PoseInFrame>(topic, "foxglove.PoseInFrame")?;
        for (row, at) in times.iter().enumerate() {
            let [w, x, y, z] = orientation[row];
            let pose = Pose { position: Vector3::of(&position[row]), orientation: Quaternion { x, y, z, w } };
            let message = PoseInFrame { timestamp: Time::of(*at), frame_id: WORLD, pose };
            self.write(&channel, row, *at, &message)?;
        }
        Ok(())
    }
}

/// The recording as the bytes of an MCAP file, with a channel for each quantity that it holds.
///
/// # Errors
/// The format cannot express it: none is known.
pub fn mcap(recording: &Recording) -> Result<Vec<u8>, McapError> {
    let options = WriteOptions::new().compression(None).library(concat!("tactus ", env!("CARGO_PKG_VERSION")));
    let mut export = Export(options.create(Cursor::new(Vec::new()))?);
    let first = recording.time.first().copied().unwrap_or_default();
    let times: Vec<u64> = recording.time.iter().map(|time| ((time - first) * 1e9).round() as u64).collect();
    export.0.write_metadata(&Metadata { name: "tactus".to_owned(), metadata: notes(recording) })?;
    if let Some(q) = &recording.q {
        let channel = export.channel::<JointStates>("/joint_states", "tactus.JointStates")?;
        for (row, at) in times.iter().enumerate() {
            let message = JointStates {
                timestamp: Time::of(*at),
                name: JOINT_NAMES,
                position: q[row],
                velocity: recording.dq.as_ref().map(|dq| dq[row]),
                effort: recording.tau.as_ref().map(|tau| tau[row]),
            };
            export.write(&channel, row, *at, &message)?;
        }
    }
    export.poses("/tool_pose", &times, recording.position.as_deref(), recording.orientation.as_deref())?;
    export.poses("/tool_pose_desired", &times, recording.position_d.as_deref(), recording.orientation_d.as_deref())?;
    if let Some(wrench) = &recording.wrench {
        let channel = export.channel::<Wrench>("/wrench", "tactus.Wrench")?;
        for (row, at) in times.iter().enumerate() {
            let (force, torque) = (Vector3::of(&wrench[row][..3]), Vector3::of(&wrench[row][3..]));
            export.write(&channel, row, *at, &Wrench { timestamp: Time::of(*at), force, torque })?;
        }
    }
    if let Some(hand) = &recording.hand {
        let channel = export.channel::<Hand>("/hand", "tactus.Hand")?;
        for (row, at) in times.iter().enumerate() {
            let message = Hand {
                timestamp: Time::of(*at),
                position: hand[row],
                desired: recording.hand_d.as_ref().map(|hand_d| hand_d[row]),
                gauges: recording.gauges.as_ref().map(|gauges| gauges[row]),
            };
            export.write(&channel, row, *at, &message)?;
        }
    }
    let channel = export.channel::<Movement>("/movement", "tactus.Movement")?;
    for (row, at) in times.iter().enumerate() {
        let message = Movement {
            timestamp: Time::of(*at),
            state: recording.state.as_ref().map(|state| state[row].clone()),
            fault: recording.fault.as_ref().map(|fault| fault[row]),
            phase: recording.phase.as_ref().map(|phase| phase[row]),
            surprise: recording.surprise.as_ref().map(|surprise| surprise[row]),
        };
        export.write(&channel, row, *at, &message)?;
    }
    export.0.finish()?;
    Ok(export.0.into_inner().into_inner())
}

/// Where the recording comes from, as far as it says.
fn notes(recording: &Recording) -> BTreeMap<String, String> {
    let origin = &recording.origin;
    let notes = [
        ("primitive", origin.primitive.as_ref().map(ToString::to_string)),
        ("speed", origin.speed.map(|speed| speed.to_string())),
        ("mode", origin.mode.clone()),
        ("goal_m", origin.goal.map(|[x, y, z]| format!("{x},{y},{z}"))),
        ("changes", origin.changes.clone()),
        ("device", origin.device.clone()),
        ("firmware", origin.firmware.clone()),
        ("date", origin.date.clone()),
    ];
    notes.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))).collect()
}
