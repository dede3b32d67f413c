//! The client against the device's own session: handshake, loss, silence, uploads, stopping.

mod agreement;
mod fixture;
mod secret;
#[cfg(unix)]
mod serial;
mod unusual;

use std::cell::RefCell;
use std::io::Write as _;
use std::rc::Rc;
use std::time::{Duration, Instant};

use control::State;
use device::Command;
use lab::client::{Client, Halted, Incoming, Interrupt, STORE_TIMEOUT, UploadOutcome, UploadPhase};
use lab::error::HostError;
use lab::transport::{StreamTransport, Transport, TransportError};
use link::{LINK_VERSION, Name, Refusal, Request, SCHEMA_HASH};

use fixture::{Device, STEP, connected, image};

#[test]
fn connecting_compares_versions_within_200_ms() {
    let client = connected();
    assert!(client.now() < Duration::from_millis(200), "{:?}", client.now());
    assert_eq!(client.hello().serial.as_str(), "T-1");
}

#[test]
fn c7_versions_that_differ_are_named_on_both_sides_and_nothing_else_is_sent() {
    let Err(error) = Client::connect_as(Device::new(), "test", 99, SCHEMA_HASH) else { panic!() };
    let text = error.to_string();
    assert!(text.contains("version 99") && text.contains(&format!("version {LINK_VERSION}")), "{text}");
    assert_eq!((error.code().exit() as u8, error.code().to_string()), (4, "E401".to_owned()));
    assert!(error.code().remedy().contains("flash"));

    let Err(error) = Client::connect_as(Device::new(), "test", LINK_VERSION, 0xBAD) else { panic!() };
    let text = error.to_string();
    assert!(text.contains("0x00000bad") && text.contains(&format!("{SCHEMA_HASH:#010x}")), "{text}");
    assert_eq!(error.code().to_string(), "E402");
}

/// A device on a line on which every host hears everything it says, and what each has not heard yet.
struct Party {
    device: Device,
    unheard: Vec<Vec<u8>>,
}

/// One of these hosts.
struct Guest {
    party: Rc<RefCell<Party>>,
    place: usize,
}

impl Guest {
    fn join(party: &Rc<RefCell<Party>>) -> Self {
        let mut inner = party.borrow_mut();
        inner.unheard.push(Vec::new());
        Self { party: Rc::clone(party), place: inner.unheard.len() - 1 }
    }
}

fn party() -> Rc<RefCell<Party>> {
    Rc::new(RefCell::new(Party { device: Device::new(), unheard: Vec::new() }))
}

impl Transport for Guest {
    fn send(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
        self.party.borrow_mut().device.send(bytes)
    }

    fn receive(&mut self, timeout: Duration, out: &mut Vec<u8>) -> Result<(), TransportError> {
        let Party { device, unheard } = &mut *self.party.borrow_mut();
        if unheard[self.place].is_empty() {
            let mut said = Vec::new();
            device.receive(timeout, &mut said)?;
            unheard.iter_mut().for_each(|host| host.extend(&said));
        }
        out.append(&mut unheard[self.place]);
        Ok(())
    }

    fn now(&self) -> Duration {
        self.party.borrow().device.now()
    }

    /// Each host draws a session number of its own.
    fn is_virtual(&self) -> bool {
        false
    }
}

#[test]
fn a_second_host_stops_the_arm_of_the_first_and_gets_nothing_else() {
    let party = party();
    let mut first = Client::connect(Guest::join(&party), "first").unwrap();
    first.gravity().unwrap();
    let before = first.now();
    let Ok(Halted::Others(error)) = Client::halt(Guest::join(&party), "second") else { panic!("not refused") };
    assert!(first.now() - before < Duration::from_millis(50), "it took {:?}", first.now() - before);
    assert_eq!(error.code().to_string(), "E504");
    assert_eq!(party.borrow().device.half.state, State::SoftStop);
    // The first keeps its session, and all of its messages are accounted for.
    first.status().unwrap();
    assert_eq!(first.gaps().messages, 0, "what was said to the second counts as lost");
}

#[test]
fn a_halt_of_a_device_that_nobody_has_opens_a_conversation() {
    let party = party();
    let Ok(Halted::Ours(mut client)) = Client::halt(Guest::join(&party), "test") else { panic!("not ours") };
    assert!(matches!(party.borrow().device.half.commands[..], [Command::Control(control::Command::Stop)]));
    client.status().unwrap();
    party.borrow_mut().device.dead = true;
    let Err(error) = Client::halt(Guest::join(&party), "test") else { panic!("a dead device has stopped nothing") };
    assert!(matches!(error, HostError::NoAnswer { request: "stop", .. }), "{error}");
}

#[test]
fn a_device_that_does_not_answer_is_given_up_after_two_seconds() {
    let mut device = Device::new();
    device.dead = true;
    let Err(error) = Client::connect(device, "test") else { panic!() };
    assert!(matches!(error, HostError::NoAnswer { request: "hello", .. }), "{error}");
    assert_eq!(error.code().exit() as u8, 7);

    let mut client = connected();
    let started = client.now();
    client.transport().dead = true;
    assert!(matches!(client.status(), Err(HostError::NoAnswer { request: "status", .. })));
    let waited = client.now() - started;
    assert!(waited >= Duration::from_secs(2) && waited < Duration::from_millis(2100), "{waited:?}");
}

#[test]
fn a_socket_behind_which_nobody_answers_is_given_up_in_two_seconds_of_wall_time() {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let started = Instant::now();
    let result = Client::connect(StreamTransport::tcp(&address).unwrap(), "test");
    let waited = started.elapsed();
    assert!(matches!(result.err(), Some(HostError::NoAnswer { .. })));
    // How exactly it keeps to two seconds is tested in virtual time; the rest is for a computer that does something
    // else as well.
    assert!(waited > Duration::from_millis(1900) && waited < Duration::from_secs(10), "{waited:?}");
}

#[test]
fn a_closed_socket_and_a_missing_one_are_told_apart() {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let transport = StreamTransport::tcp(&address).unwrap();
    drop(listener.accept().unwrap());
    drop(listener);
    let closed = Client::connect(transport, "test").err().unwrap();
    assert_eq!((closed.code().to_string(), closed.code().exit() as u8), ("E701".to_owned(), 7));
    // Nothing is wrong with a cable where there is none.
    let help = closed.into_failure("run").help.unwrap_or_default();
    assert!(help.contains("whether that program still runs") && !help.contains("cable"), "{help}");
    let missing = HostError::from(StreamTransport::tcp(&address).err().unwrap());
    assert_eq!((missing.code().to_string(), missing.code().exit() as u8), ("E301".to_owned(), 3));
}

#[cfg(unix)]
#[test]
fn a_unix_socket_carries_bytes_both_ways() {
    let path = std::env::temp_dir().join(format!("tactus-stream-{}", std::process::id()));
    let listener = std::os::unix::net::UnixListener::bind(&path).unwrap();
    let mut transport = StreamTransport::unix(&path).unwrap();
    let (mut other, _) = listener.accept().unwrap();
    std::fs::remove_file(&path).unwrap();
    let mut out = Vec::new();
    transport.receive(Duration::from_millis(5), &mut out).unwrap();
    assert!(out.is_empty(), "a time-out is no error");
    other.write_all(&[1, 0, 2]).unwrap();
    transport.receive(Duration::from_secs(1), &mut out).unwrap();
    assert_eq!(out, [1, 0, 2]);
    transport.send(&[3, 4]).unwrap();
    let mut back = [0; 2];
    std::io::Read::read_exact(&mut other, &mut back).unwrap();
    assert_eq!(back, [3, 4]);
}

#[test]
fn lost_requests_and_answers_are_repeated_and_done_once() {
    let mut device = Device::new();
    (device.lose_every, device.lose_answers_every) = (3, 4);
    let mut client = Client::connect(device, "test").unwrap();
    for _ in 0..20 {
        client.hold().unwrap();
    }
    assert!(client.round_trips().repeated > 5);
    let holds = client.transport().half.commands.len();
    assert_eq!(holds, 20, "each was done exactly once");
}

#[test]
fn a_device_that_reads_its_storage_is_waited_for_but_not_with_what_moves() {
    let mut client = connected();
    client.transport().reading = 5;
    assert!(client.list().unwrap().is_empty());
    assert_eq!(client.transport().reading, 0);
    client.transport().reading = 1;
    let refused = client.gravity();
    assert!(matches!(refused, Err(HostError::Refused { reason: Refusal::StoreFailed, .. })), "{refused:?}");
    // One that never comes to an end is told as what it is.
    client.transport().reading = u32::MAX;
    let started = client.now();
    let refused = client.list();
    assert!(matches!(refused, Err(HostError::Refused { reason: Refusal::StoreFailed, .. })), "{refused:?}");
    assert!(client.now() - started < Duration::from_secs(4));
}

/// The change of a host that was killed is carried out, and another one waits for it as long as its own host would
/// have.
/// The change of code that makes it fail: a change is given up after 3 s, as a question is.
#[test]
fn a_change_waits_for_the_change_of_another_host_for_the_time_that_it_may_take() {
    let mut client = connected();
    let nothing = Request::Delete { name: Name::new("nothing").unwrap() };
    let calibrate = Request::Calibrate { home: [0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0] };
    // Two erases of 4 s, and a try in 20 ms at most.
    for (change, expected) in [(nothing, Refusal::NoSuchPrimitive), (calibrate, Refusal::HasTorque)] {
        let started = client.now();
        client.transport().reading = 400;
        let refused = client.request(&change);
        assert!(matches!(&refused, Err(HostError::Refused { reason, .. }) if *reason == expected), "{refused:?}");
        assert!(client.now() - started >= Duration::from_secs(8), "{:?}", client.now() - started);
    }
    // One that never comes to an end is told as what it is.
    client.transport().reading = u32::MAX;
    let started = client.now();
    let refused = client.upload(&image("reach", 1.0), |_, _, _| {});
    assert!(matches!(refused, Err(HostError::Refused { reason: Refusal::StoreFailed, .. })), "{refused:?}");
    assert!(client.now() - started < STORE_TIMEOUT + Duration::from_secs(1));
}

#[test]
fn noise_between_the_frames_is_counted_and_harmless() {
    let mut client = connected();
    client.transport().half.line.extend_from_slice(&[7, 7, 7, 0, 3, 9, 0]);
    client.status().unwrap();
    let counters = client.counters();
    assert_eq!(counters.bad_cobs + counters.bad_crc, 2);
}

#[test]
fn telemetry_arrives_whole_and_keeps_the_session_alive() {
    let mut client = connected();
    client.gravity().unwrap();
    let mut stream = client.telemetry(1).unwrap();
    let cycles: Vec<u32> = (0..900).map(|_| stream.next().unwrap().unwrap().cycle).collect();
    assert!(cycles.windows(2).all(|pair| pair[1] == pair[0] + 1));
    drop(stream);
    assert_eq!((client.gaps().telemetry, client.gaps().messages), (0, 0));
    assert_eq!(client.transport().half.state, State::Gravity, "three seconds without a time-out");
    assert_eq!(client.next(Duration::from_millis(50)).unwrap(), None, "the stream was switched off");
}

#[test]
fn a_stream_without_cycles_ends_after_a_second_whatever_else_is_told() {
    let mut client = connected();
    let mut stream = client.telemetry(1).unwrap();
    stream.next().unwrap().unwrap();
    stream.client().transport().without_cycles = true;
    let begun = stream.client().now();
    let ended = stream.find(Result::is_err);
    assert!(matches!(ended, Some(Err(HostError::NoAnswer { request: "telemetry", .. }))), "{ended:?}");
    let waited = stream.client().now() - begun;
    assert!(waited > Duration::from_millis(990) && waited < Duration::from_millis(1020), "{waited:?}");
    assert!(stream.events().len() > 250);
}

#[test]
fn gaps_in_the_telemetry_are_counted() {
    let mut client = connected();
    client.set_telemetry(1).unwrap();
    client.transport().lose_answers_every = 5;
    let mut received = 0;
    while received < 100 {
        if let Some(Incoming::Telemetry(_)) = client.next(Duration::from_secs(1)).unwrap() {
            received += 1;
        }
    }
    let gaps = client.gaps();
    assert!((15..=40).contains(&gaps.telemetry), "{gaps:?}");
    assert!(gaps.messages >= gaps.telemetry);
}

#[test]
fn a_host_that_stops_listening_lets_the_device_stop_the_arm() {
    let mut client = connected();
    client.gravity().unwrap();
    let device = client.transport();
    (0..540).for_each(|_| device.step());
    assert_eq!(device.half.state, State::SoftStop, "600 ms of silence");
    let refused = client.gravity();
    assert!(
        matches!(refused, Err(HostError::Refused { reason: Refusal::NoSession, .. })),
        "a host that was suspended does not start where it left: {refused:?}"
    );
}

#[test]
fn an_interrupt_stops_the_arm_before_the_command_ends() {
    let mut client = connected();
    let interrupt = Interrupt::never();
    client.set_interrupt(interrupt.clone());
    client.gravity().unwrap();
    interrupt.raise();
    let started = client.now();
    let error = client.next(Duration::from_secs(10)).unwrap_err();
    assert!(matches!(error, HostError::Interrupted));
    assert_eq!(error.code().exit() as u8, 130);
    assert!(client.now() - started <= Duration::from_millis(200));
    assert_eq!(client.transport().half.state, State::SoftStop);
}

/// The change that makes it fail: an arm that has left its motion counts as standing, and is still braking.
#[test]
fn a_command_that_is_interrupted_ends_when_its_arm_stands_still() {
    for (cycles, longest) in [(75, 0.35), (u32::MAX, 1.1)] {
        let mut client = connected();
        let interrupt = Interrupt::never();
        client.set_interrupt(interrupt.clone());
        client.gravity().unwrap();
        client.transport().braking.0 = cycles;
        interrupt.raise();
        let started = client.now();
        let error = client.next(Duration::from_secs(10)).unwrap_err();
        assert!(matches!(error, HostError::Interrupted));
        let took = (client.now() - started).as_secs_f64();
        assert!(took < longest, "{took} s: an arm that never rests is not waited for");
        assert!(client.transport().braking.0 == 0 || cycles == u32::MAX, "after {took} s it still moves");
    }
}

/// The change that makes it fail: parts are sent whatever the user wishes.
#[test]
fn an_interrupt_in_the_middle_of_an_upload_leaves_the_device_what_it_had() {
    let mut client = connected();
    let interrupt = Interrupt::never();
    client.set_interrupt(interrupt.clone());
    let image = image("reach", 3.0);
    let error = client
        .upload(&image, |_, done, _| {
            if done > 0 {
                interrupt.raise()
            }
        })
        .unwrap_err();
    assert!(matches!(error, HostError::Left) && error.code().exit() as u8 == 130, "{error:?}");
    client.set_interrupt(Interrupt::never());
    assert_eq!(client.list().unwrap(), [], "nothing was stored");
    assert_eq!(client.status().unwrap().upload_received, None, "and nothing is under way");
    client.upload(&image, |_, _, _| {}).unwrap();
}

/// The change that makes it fail: a motion of the hand counts as going on until somebody stops it.
#[test]
fn an_interrupt_long_after_a_motion_of_the_hand_lets_an_arm_that_holds_be() {
    for (seconds, stops) in [(0.5, true), (20.0, false)] {
        let mut client = connected();
        let interrupt = Interrupt::never();
        client.set_interrupt(interrupt.clone());
        client.hold().unwrap();
        client.move_hand([0.0, 0.5, 0.5, 0.5], 1.0).unwrap();
        let end = client.now() + Duration::from_secs_f64(seconds);
        while client.now() < end {
            client.next(Duration::from_millis(100)).unwrap();
        }
        interrupt.raise();
        let error = client.next(Duration::from_secs(10)).unwrap_err();
        assert_eq!(matches!(error, HostError::Interrupted), stops, "{error:?} after {seconds} s");
        assert_eq!(client.transport().half.state == State::SoftStop, stops, "after {seconds} s");
    }
}

/// The fingers and then the spread have ten seconds each.
///
/// The change that makes it fail: an initialisation counts as over after ten seconds, whatever the status tells.
#[test]
fn an_interrupt_stops_a_hand_that_is_initialised_for_longer_than_usual() {
    let mut client = connected();
    let interrupt = Interrupt::never();
    client.set_interrupt(interrupt.clone());
    client.hold().unwrap();
    client.initialise_hand().unwrap();
    client.transport().half.hand = link::HandStage::Initialising;
    let end = client.now() + Duration::from_secs(18);
    while client.now() < end {
        client.next(Duration::from_millis(50)).unwrap();
        client.status().unwrap();
    }
    interrupt.raise();
    let error = client.next(Duration::from_secs(10)).unwrap_err();
    assert!(matches!(error, HostError::Interrupted), "{error:?}");
    assert_eq!(client.transport().half.state, State::SoftStop);
}

#[test]
fn dropping_a_client_that_moved_the_arm_says_stop() {
    let mut seen = Vec::new();
    /// Remembers what was sent.
    struct Spy<'a>(Device, &'a mut Vec<u8>);
    impl Transport for Spy<'_> {
        fn send(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
            self.1.extend_from_slice(bytes);
            self.0.send(bytes)
        }
        fn receive(&mut self, timeout: Duration, out: &mut Vec<u8>) -> Result<(), TransportError> {
            self.0.receive(timeout, out)
        }
        fn now(&self) -> Duration {
            self.0.now()
        }
        fn is_virtual(&self) -> bool {
            true
        }
    }
    let mut client = Client::connect(Spy(Device::new(), &mut seen), "test").unwrap();
    client.gravity().unwrap();
    drop(client);
    let mut decoder = link::frame::Decoder::<{ link::frame::FRAME_BYTES }>::new();
    let mut bytes = seen.as_slice();
    let sent: Vec<Request> =
        std::iter::from_fn(|| decoder.next::<Request>(&mut bytes)).map(|frame| frame.message).collect();
    assert_eq!(sent[sent.len() - 2..], [Request::Stop, Request::Goodbye]);
}

#[test]
fn an_upload_is_sent_checked_stored_and_read_back() {
    let mut client = connected();
    let image = image("reach", 3.0);
    let mut phases = Vec::new();
    let outcome = client
        .upload(&image, |phase, done, all| {
            assert!(done <= all);
            if phases.last() != Some(&phase) {
                phases.push(phase);
            }
        })
        .unwrap();
    assert!(matches!(outcome, UploadOutcome::Stored(ref listing) if listing.name.as_str() == "reach"));
    assert_eq!(phases, [UploadPhase::Send, UploadPhase::Commit, UploadPhase::Verify]);
    assert_eq!(client.read_image(&Name::new("reach").unwrap(), |_| {}).unwrap(), image);
    assert_eq!(client.list().unwrap().len(), 1);

    let again = client.upload(&image, |_, _, _| panic!("nothing should be sent")).unwrap();
    assert!(matches!(again, UploadOutcome::AlreadyThere(_)));
    client.delete(&Name::new("reach").unwrap()).unwrap();
    assert!(client.list().unwrap().is_empty());
}

#[test]
fn an_upload_over_a_lossy_line_arrives_whole() {
    let mut device = Device::new();
    (device.lose_every, device.lose_answers_every) = (7, 5);
    let mut client = Client::connect(device, "test").unwrap();
    let outcome = client.upload(&image("reach", 3.0), |_, _, _| {}).unwrap();
    assert!(matches!(outcome, UploadOutcome::Stored(_)));
}

#[test]
fn c4_a_cable_pulled_at_any_chunk_leaves_the_old_primitive() {
    let (old, new) = (image("reach", 3.0), image("reach", 5.0));
    for cut in 0..new.len().div_ceil(192) {
        let mut client = connected();
        client.upload(&old, |_, _, _| {}).unwrap();
        // The progress callback pulls the plug through a shared switch: the transport is the client's own.
        let mut parts = 0;
        let name = Name::new("reach").unwrap();
        let crc = link::image::stored_crc(&new);
        client.request(&Request::UploadBegin { name, length: new.len() as u32, crc }).unwrap();
        for part in new.chunks(192).take(cut) {
            let data = link::message::ChunkData::from_slice(part).unwrap();
            client.request(&Request::UploadChunk { offset: parts, data }).unwrap();
            parts += part.len() as u32;
        }
        client.transport().unplugged = true;
        let error = client.upload(&new, |_, _, _| {}).unwrap_err();
        assert_eq!(error.code().to_string(), "E701");
        let device = client.transport();
        (0..600).for_each(|_| device.step());
        assert_eq!(device::Store::image(device.session.store(), 0), Some(old.as_slice()), "after {cut} chunks");
    }
}

#[test]
fn what_is_no_image_is_not_even_sent() {
    let mut client = connected();
    let mut damaged = image("reach", 3.0);
    damaged[100] ^= 1;
    let before = client.round_trips().count;
    let error = client.upload(&damaged, |_, _, _| {}).unwrap_err();
    assert_eq!((error.code().to_string(), error.code().exit() as u8), ("E651".to_owned(), 6));
    assert_eq!(client.round_trips().count, before);
}

#[test]
fn a_refusal_names_request_reason_and_remedy() {
    let mut client = connected();
    let run = client.run(&Name::new("nothing").unwrap(), link::RunOptions::default());
    let error = run.unwrap_err();
    assert_eq!(error.to_string(), "the device refused 'run': the device stores no primitive of that name");
    assert_eq!((error.code().exit() as u8, error.code().to_string()), (5, "E513".to_owned()));
    let failure = error.into_failure("run refused").to_string();
    assert!(failure.contains("help: `tactus list`"), "{failure}");
}

#[test]
fn a_second_client_waits_for_the_first_to_be_gone() {
    // The first one was killed: it said nothing, and its session lives on for half a second.
    let mut device = Device::new();
    let mut buffer = [0; link::frame::FRAME_BYTES];
    let hello = link::HostHello {
        link_version: LINK_VERSION,
        schema_hash: SCHEMA_HASH,
        model_hash: control::MODEL_HASH,
        owner: link::Text::new("killed"),
    };
    let envelope = link::frame::Envelope { session: 999, sequence: 1, time_ms: 0 };
    let length = link::frame::encode(envelope, &Request::Hello(hello), &mut buffer).unwrap();
    device.session.receive(&buffer[..length]);
    device.step();
    let client = Client::connect(device, "test").unwrap();
    let waited = client.now();
    assert!(waited > Duration::from_millis(490) && waited < Duration::from_millis(800), "{waited:?}");
}

/// The device has let go of a host that was suspended: what that host waits for will never come, however many of its
/// pings are answered.
/// Suspended between two waits or in one, for less and for more than a device may be silent: what it hears afterwards
/// counts, and not that it has heard nothing meanwhile.
#[test]
fn a_host_that_the_device_has_let_go_of_does_not_wait_on_and_blames_nobody() {
    for (milliseconds, in_a_wait) in [(600, false), (600, true), (10_000, false), (10_000, true)] {
        let mut client = connected();
        client.gravity().unwrap();
        let device = client.transport();
        let steps = milliseconds * 9 / 10;
        if in_a_wait {
            device.suspended = steps;
        } else {
            (0..steps).for_each(|_| device.step());
        }
        let refused = loop {
            match client.next(Duration::from_secs(1)) {
                // The device has said that it stops the arm.
                Ok(Some(_)) => {}
                other => break other,
            }
        };
        assert!(matches!(refused, Err(HostError::Refused { reason: Refusal::NoSession, .. })), "{refused:?}");
        assert_eq!(client.transport().half.state, State::SoftStop, "after {milliseconds} ms of silence");
        let took = client.now().saturating_sub(STEP * steps);
        assert!(took < Duration::from_millis(300), "{took:?}");
    }
}

/// The change that makes it fail: a host that looks on and was suspended is refused for good.
#[test]
fn who_looked_on_and_was_suspended_looks_on_anew_on_the_same_line() {
    for milliseconds in [2_500, 10_000] {
        let mut client = Client::observe(Device::new(), "onlooker").unwrap();
        client.transport().suspended = milliseconds * 9 / 10;
        let refused = loop {
            match client.next(Duration::from_secs(1)) {
                Ok(_) => {}
                Err(error) => break error,
            }
        };
        assert!(matches!(refused, HostError::Refused { reason: Refusal::NoSession, .. }), "{refused:?}");
        client.observe_anew("onlooker").unwrap();
        client.status().unwrap();
        client.order_stop().unwrap();
        let moves = client.gravity();
        assert!(matches!(moves, Err(HostError::Refused { .. })), "who looks on commands nothing: {moves:?}");
    }
}

#[test]
fn a_device_that_falls_silent_is_given_up_after_two_seconds_of_listening() {
    let mut client = connected();
    client.transport().dead = true;
    client.transport().suspended = 3 * 900;
    let begun = client.now();
    let silent = client.next(Duration::from_secs(10));
    assert!(matches!(silent, Err(HostError::NoAnswer { request: "ping", .. })), "{silent:?}");
    let took = client.now() - begun;
    assert!((Duration::from_secs(4)..Duration::from_secs(6)).contains(&took), "{took:?}");
}
