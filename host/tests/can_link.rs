//! The link over a CAN bus: the same upload and the same run as over the serial line, at the speed of the line.

use std::path::Path;
use std::time::Duration;

use assert_cmd::Command;
use control::State;
use embedded_can::Frame as _;
use lab::client::{Client, Incoming, UploadOutcome};
use lab::device::Device;
use lab::primitive_file::PrimitiveFile;
use lab::procedure;
use lab::simulation::{CYCLE_TICKS, SLOT_TICKS};
use lab::transport::Address;
use lab::transport::can::CanPort as _;
use link::can::{BITS_PER_SECOND, DeviceNumber, Direction, LINE_BYTES_PER_SECOND, SEGMENT_BYTES, Segmenter};
use link::frame::{self, Envelope, FRAME_BYTES};
use link::message::{CHUNK_BYTES, ChunkData};
use link::{Name, Request, RunOptions, Telemetry};
use puck::{CanFrame, CanId};

use crate::common;

/// A primitive with as many kernels as a device takes: the longest upload there is.
fn primitive(folder: &Path, kernels: &str) -> PrimitiveFile {
    common::demonstration(folder, 2.0);
    Command::new(env!("CARGO_BIN_EXE_tactus"))
        .current_dir(folder)
        .args(["learn", "demo.csv", "--kernels", kernels, "-o", "reach.toml"])
        .assert()
        .success();
    PrimitiveFile::read(&folder.join("reach.toml")).unwrap()
}

fn arm(address: &str) -> Client<Device> {
    let address: Address = address.parse().unwrap();
    Client::connect(Device::open(&address, |_| {}).unwrap(), "test").unwrap()
}

/// Waits until this time of the simulated arm, shortly after a control slot: what is sent now reaches the next one
/// whatever the line.
fn wait_until(client: &mut Client<Device>, seconds: f64) {
    let cycle = (seconds * control::RATE).round();
    let behind_control_slot = cycle * sim::seconds(CYCLE_TICKS) + sim::seconds(SLOT_TICKS) + 0.1e-3;
    let until = Duration::from_secs_f64(behind_control_slot);
    while client.now() < until {
        let _ = client.next(until - client.now()).unwrap();
    }
}

/// Upload and run, every order at a fixed time. Returns the cycles from before the run until after its end.
fn upload_and_run(address: &str, file: &PrimitiveFile) -> (Client<Device>, Vec<Telemetry>) {
    let mut client = arm(address);
    let image = file.to_image().unwrap();
    let outcome = client.upload(&image, |_, _, _| {}).unwrap();
    assert!(matches!(outcome, UploadOutcome::Stored(_)));
    wait_until(&mut client, 5.0);
    client.zero(control::model::HOME.map(|angle| angle as f32)).unwrap();
    wait_until(&mut client, 7.0);
    client.initialise_hand().unwrap();
    wait_until(&mut client, 16.0);
    client.hold().unwrap();
    wait_until(&mut client, 17.0);
    client.approach(file.start.posture.map(|angle| angle as f32), 4.0).unwrap();
    wait_until(&mut client, 30.0);
    client.set_telemetry(1).unwrap();
    let first = client.status().unwrap().cycle + 60;
    wait_until(&mut client, 30.5);
    client.run(&Name::new(&file.name).unwrap(), RunOptions::default()).unwrap();
    let mut cycles = Vec::new();
    while cycles.len() < 1500 {
        if let Some(Incoming::Telemetry(cycle)) = client.next(Duration::from_millis(100)).unwrap() {
            cycles.push(cycle);
        }
    }
    cycles.retain(|cycle| cycle.cycle >= first);
    (client, cycles)
}

/// At 300 Hz: the lines carry the telemetry of every cycle, which they do not at 500 Hz (decision 0017).
#[test]
fn a_run_over_can_is_the_run_over_the_serial_line_to_the_last_bit() {
    let folder = tempfile::tempdir().unwrap();
    let file = primitive(folder.path(), "50");
    let (_, serial) = upload_and_run("sil:world=simple", &file);
    let (mut client, can) = upload_and_run("sil:world=simple,line=can", &file);
    let running = |cycles: &[Telemetry]| cycles.iter().filter(|cycle| cycle.state == State::Run.code()).count();
    assert!(running(&serial) > 500, "{}", running(&serial));
    let goal = file.goal.posture[3] as f32;
    let arrived = serial.last().unwrap();
    assert!((arrived.q[3] - goal).abs() < 0.03, "J4 at {} rad instead of {goal}", arrived.q[3]);
    let both: Vec<_> =
        serial.iter().filter_map(|one| Some((one, can.iter().find(|it| it.cycle == one.cycle)?))).collect();
    assert!(both.len() > 1300, "{} cycles in common", both.len());
    for (one, other) in both {
        assert_eq!(one, other);
    }
    let gaps = client.gaps();
    let statistics = client.statistics().unwrap();
    assert_eq!((gaps.telemetry, gaps.messages, statistics.telemetry_dropped), (0, 0, 0), "every cycle told");
    let Device::SimulatedCan(line) = client.transport() else { panic!("a CAN line was asked for") };
    let at_host = line.segments();
    let at_device = line.port().inspect(|bus| bus.device_segments());
    assert_eq!((at_host.gaps, at_host.duplicates, at_host.malformed), (0, 0, 0));
    assert_eq!((at_device.gaps, at_device.duplicates, at_device.malformed), (0, 0, 0));
}

/// The most that a bus could carry of these very bytes: frames of eight, back to back, with the stuff bits they have.
/// Byte/s.
fn possible(bytes: &[u8]) -> f64 {
    let frames = bytes.chunks(SEGMENT_BYTES).filter_map(|part| CanFrame::new(CanId::new(0x010)?, part));
    let bits: u32 = frames.map(|frame| sim::wire::frame_bits(&frame)).sum();
    bytes.len() as f64 * f64::from(BITS_PER_SECOND) / f64::from(bits)
}

/// The same upload with every part waiting for its answer, byte/s: what windows are for.
fn one_at_a_time(client: &mut Client<Device>, image: &[u8]) -> f64 {
    let name = Name::new("slow").unwrap();
    let (length, crc) = (image.len() as u32, link::image::stored_crc(image));
    client.request(&Request::UploadBegin { name, length, crc }).unwrap();
    let started = client.now();
    for (number, part) in image.chunks(CHUNK_BYTES).enumerate() {
        let data = ChunkData::from_slice(part).unwrap();
        client.request(&Request::UploadChunk { offset: (number * CHUNK_BYTES) as u32, data }).unwrap();
    }
    let rate = image.len() as f64 / (client.now() - started).as_secs_f64();
    client.request(&Request::UploadAbort).unwrap();
    rate
}

/// At 300 Hz: at 500 Hz parts on their way gain 13 % on a CAN line, not 20.
#[test]
fn an_upload_fills_the_line() {
    let folder = tempfile::tempdir().unwrap();
    let image = primitive(folder.path(), "100").to_image().unwrap();
    let can = possible(&image);
    assert!(can < LINE_BYTES_PER_SECOND);
    // Ten bits a byte on the serial line.
    for (line, full) in [("can", can), ("serial", 92_160.0)] {
        let mut client = arm(&format!("sil:world=simple,line={line}"));
        client.upload(&image, |_, _, _| {}).unwrap();
        let transfer = client.transfer();
        let (sent, read) = (transfer.sending_rate(), transfer.reading_rate());
        eprintln!(
            "{line}: {} bytes; line {:.1} kB/s; sent at {:.1} kB/s, {:.1} %; read at {:.1} kB/s, {:.1} %",
            transfer.bytes,
            full / 1000.0,
            sent / 1000.0,
            100.0 * sent / full,
            read / 1000.0,
            100.0 * read / full
        );
        let waiting = one_at_a_time(&mut client, &image);
        eprintln!("{line}: {:.1} kB/s if every part waits for its answer", waiting / 1000.0);
        assert!(sent >= 1.2 * waiting, "{line}: {sent} B/s with parts on their way, {waiting} without");
        assert!(sent >= 0.80 * full, "{line}: sent at {sent} of {full} B/s");
        assert!(read >= 0.80 * full, "{line}: read at {read} of {full} B/s");
    }
}

/// At 300 Hz: the lines carry the telemetry of every cycle, which they do not at 500 Hz (decision 0017).
#[test]
fn full_telemetry_fits_on_the_bus_and_an_order_still_gets_through() {
    let mut client = arm("sil:world=simple,line=can");
    procedure::make_ready(&mut client, false, |_| {}).unwrap();
    client.set_telemetry(1).unwrap();
    let mut cycles = 0;
    let until = client.now() + Duration::from_secs(3);
    let mut slowest = Duration::ZERO;
    while client.now() < until {
        if client.next(Duration::from_millis(50)).unwrap().is_some() {
            cycles += 1;
        }
        if cycles % 50 == 0 {
            let asked = client.now();
            client.stop().unwrap();
            slowest = slowest.max(client.now() - asked);
        }
    }
    eprintln!("{cycles} messages in 3 s; a stop took at most {slowest:?}");
    assert_eq!(client.statistics().unwrap().telemetry_dropped, 0);
    assert_eq!(client.gaps().telemetry, 0);
    assert!(slowest.as_millis() <= 50, "{slowest:?}");
}

/// The frames in which another host on the bus says this.
fn said_by_another(sender: &mut Segmenter, sequence: u16, request: &Request) -> Vec<CanFrame> {
    let mut buffer = [0; FRAME_BYTES];
    let envelope = Envelope { session: 999, sequence, time_ms: 0 };
    let length = frame::encode(envelope, request, &mut buffer).unwrap();
    // Every message of a host on a bus begins with a zero byte.
    let message = [&[0], &buffer[..length]].concat();
    let mut bytes = message.as_slice();
    let segments = std::iter::from_fn(|| sender.cut(&mut bytes));
    segments.map(|segment| CanFrame::new(CanId::new(segment.id()).unwrap(), segment.data()).unwrap()).collect()
}

#[test]
fn a_second_host_on_the_bus_stops_the_arm_whatever_the_place_of_its_segments() {
    let mut client = arm("sil:world=simple,line=can");
    procedure::make_ready(&mut client, false, |_| {}).unwrap();
    let mut stopped = 0;
    for place in 0..16 {
        // All places that its sequence can have relative to that of the first host.
        let mut other = Segmenter::new(Direction::ToDevice, DeviceNumber::FIRST);
        for _ in 0..place {
            other.cut(&mut &[1_u8][..]);
        }
        client.hold().unwrap();
        client.gravity().unwrap();
        let Device::SimulatedCan(line) = client.transport() else { panic!("a CAN line was asked for") };
        for frame in said_by_another(&mut other, 1, &Request::Stop) {
            line.port().send(frame).unwrap();
        }
        let asked = client.now();
        while client.status().unwrap().state == State::Gravity.code() {
            assert!(client.now() - asked < Duration::from_millis(100), "place {place}: the arm was not stopped");
        }
        stopped += usize::from(client.status().unwrap().state == State::SoftStop.code());
        // The first host goes on, with at most a repetition.
        client.request(&Request::Ping).unwrap();
    }
    assert_eq!(stopped, 16);
}

/// Both say something every 100 ms, in turn: after each message of the one the next is the other's.
#[test]
fn a_host_that_looks_on_over_the_bus_does_not_silence_the_one_that_commands() {
    let mut client = arm("sil:world=simple,line=can");
    procedure::make_ready(&mut client, false, |_| {}).unwrap();
    for place in 0..16 {
        let mut other = Segmenter::new(Direction::ToDevice, DeviceNumber::FIRST);
        for _ in 0..place {
            other.cut(&mut &[1_u8][..]);
        }
        client.hold().unwrap();
        client.gravity().unwrap();
        for turn in 0..10 {
            client.next(Duration::from_millis(110)).unwrap_or_else(|error| panic!("place {place}, {turn}: {error}"));
            let Device::SimulatedCan(line) = client.transport() else { panic!("a CAN line was asked for") };
            for frame in said_by_another(&mut other, turn, &Request::Ping) {
                line.port().send(frame).unwrap();
            }
        }
        assert_eq!(client.status().unwrap().state, State::Gravity.code(), "place {place}: the arm was stopped");
    }
}

#[test]
fn devices_on_a_bus_hear_only_what_is_meant_for_them() {
    // The simulated device is number 0; a host that means number 3 must not reach it.
    let address: Address = "sil:world=simple".parse().unwrap();
    let Device::Simulated(simulation) = Device::open(&address, |_| {}).unwrap() else { panic!("a serial line") };
    let port = lab::simulation::SimulatedCan::attach(*simulation, DeviceNumber::FIRST);
    let line = lab::transport::CanTransport::new(port, DeviceNumber::new(3).unwrap());
    let error = Client::connect(line, "test").err().unwrap();
    assert_eq!(error.code().to_string(), "E702", "{error}");
}

#[test]
fn an_interface_that_is_not_there_is_named_with_what_there_is() {
    let run = Command::new(env!("CARGO_BIN_EXE_tactus")).args(["--device", "can:nocan7", "list"]).assert().code(3);
    let words = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
    assert!(words.starts_with("error[E303]: list: there is no network interface 'nocan7'; "), "{words}");
    assert!(words.contains("help: "), "{words}");
}
