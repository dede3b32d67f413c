//! `tactus sim --can`: the bus of the simulated arm, spoken to over a socket as foreign programs do.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A `tactus sim` that is killed when the test is over.
struct Served {
    child: Child,
    address: SocketAddr,
}

impl Served {
    fn start(folder: &Path, device: &str, arguments: &[&str]) -> Served {
        let mut child = Command::new(env!("CARGO_BIN_EXE_tactus"))
            .current_dir(folder)
            .args(["--device", device, "sim", "--can", "127.0.0.1:0"])
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stderr.take().unwrap());
        let mut line = String::new();
        while !line.contains("the arm's bus is served at ") {
            line.clear();
            assert!(lines.read_line(&mut line).unwrap() > 0, "it ended before it served");
        }
        let address = line.split_whitespace().nth(6).unwrap().parse().unwrap();
        std::thread::spawn(move || std::io::copy(&mut lines, &mut std::io::sink()));
        Served { child, address }
    }

    fn program(&self) -> Program {
        let socket = TcpStream::connect(self.address).unwrap();
        socket.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        Program { socket, heard: String::new() }
    }

    /// A program in raw mode.
    fn raw(&self) -> Program {
        let mut program = self.program();
        assert_eq!(program.hear(), "< hi >");
        assert_eq!(program.ask("< open can0 >"), "< ok >");
        assert_eq!(program.ask("< rawmode >"), "< ok >");
        program
    }

    /// Ends it as Ctrl-C does.
    fn interrupt(mut self) {
        assert!(Command::new("kill").args(["-INT", &self.child.id().to_string()]).status().unwrap().success());
        assert!(self.child.wait().unwrap().success());
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A foreign program.
struct Program {
    socket: TcpStream,
    heard: String,
}

impl Program {
    fn say(&mut self, text: &str) {
        self.socket.write_all(text.as_bytes()).unwrap();
    }

    /// The next message.
    fn hear(&mut self) -> String {
        loop {
            if let Some(end) = self.heard.find('>') {
                return self.heard.drain(..=end).collect();
            }
            let mut buffer = [0; 4096];
            let count = self.socket.read(&mut buffer).unwrap();
            assert!(count > 0, "the connection was closed");
            self.heard.push_str(std::str::from_utf8(&buffer[..count]).unwrap());
        }
    }

    fn ask(&mut self, text: &str) -> String {
        self.say(text);
        self.hear()
    }

    /// Identifiers and data of the next frames, up to the first of this identifier.
    fn frames_until(&mut self, id: &str) -> Vec<(String, String)> {
        let mut frames = Vec::new();
        loop {
            let message = self.hear();
            let words: Vec<&str> = message.split_whitespace().collect();
            assert_eq!(words[1], "frame", "{message}");
            frames.push((words[2].to_owned(), words[4].to_owned()));
            if words[2] == id {
                return frames;
            }
        }
    }

    /// Data of the next frame of this identifier.
    fn await_frame(&mut self, id: &str) -> String {
        self.frames_until(id).pop().unwrap().1
    }
}

/// Asks node 1 for STAT, which monitor and awake puck know.
const ASK_STATUS: &str = "< send 001 1 5 >";

#[test]
fn a_foreign_program_wakes_the_pucks_of_a_bus_without_co_controller_and_reads_them() {
    let folder = tempfile::tempdir().unwrap();
    let served = Served::start(folder.path(), "sil:world=simple,bus=bus.log", &["--can-only"]);
    let (mut program, mut listener) = (served.raw(), served.raw());
    std::thread::sleep(Duration::from_millis(200));
    program.say("< send 00A 1 8 >");
    assert_eq!(program.await_frame("546"), "88000100", "the operator has pressed Shift-Idle: the pucks have power");
    program.say("< send 001 1 5 >");
    assert_eq!(program.await_frame("426"), "85000000", "the monitor runs");
    program.say("< send 001 6 85 0 2 0 0 0 >");
    std::thread::sleep(Duration::from_millis(1200));
    program.say("< send 001 1 5 >");
    assert_eq!(program.await_frame("426"), "85000200", "the puck is awake");
    program.say("< send 404 1 30 >");
    assert!(program.frames_until("423").iter().all(|(id, _)| id != "404"), "who sends a frame does not hear it");
    assert_eq!(listener.await_frame("001"), "05");
    assert_eq!(listener.await_frame("404"), "30");
    assert_eq!(program.ask("< echo >"), "< echo >");
    served.interrupt();
    let log = std::fs::read_to_string(folder.path().join("bus.log")).unwrap();
    assert!(log.contains(" can0 001#850002000000\n") && log.contains(" can0 426#85000200\n"), "{log}");
}

#[test]
fn programs_see_the_control_cycle_and_what_they_ask_beside_it_does_not_end_it() {
    let folder = tempfile::tempdir().unwrap();
    let listen = format!("unix:{}", folder.path().join("arm.sock").display());
    let served = Served::start(folder.path(), "sil:world=simple", &["--listen", &listen]);
    let mut program = served.raw();
    let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"))
        .args(["--device", &listen, "--json", "hand", "--at-home", "open"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    // Start-up, zeroing, torques: all the while another reads pucks beside the co-controller.
    let mut asked = 0;
    while command.try_wait().unwrap().is_none() {
        program.say(ASK_STATUS);
        program.await_frame("426");
        asked += 1;
        // A puck that is asked while it answers loses the question; it may have been the co-controller's.
        std::thread::sleep(Duration::from_millis(20));
    }
    let output = command.wait_with_output().unwrap();
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(output.status.success() && asked > 30, "{asked} {result}");
    // Torques of the arm, as the co-controller sends them.
    program.await_frame("401");
    served.interrupt();
}

#[test]
fn nonsense_is_answered_a_crowd_is_refused_and_a_flood_delays_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let served = Served::start(folder.path(), "sil:world=simple", &["--can-only"]);
    let _silent = served.raw();
    let mut program = served.program();
    assert_eq!(program.hear(), "< hi >");
    for (said, answer) in [
        ("< send 001 0 >", "open can0 first"),
        ("< open can7 >", "the bus of the arm is can0"),
        ("< bcmmode >", "unknown command"),
        ("GET / HTTP/1.1\r\n\r\n", "angle brackets"),
        (&format!("< {} >", "x".repeat(1_000_000)), "at most 256 characters"),
    ] {
        let heard = program.ask(said);
        assert!(heard.starts_with("< error ") && heard.contains(answer), "{heard}");
    }
    assert_eq!(program.ask("< open can0 >"), "< ok >");
    assert!(program.ask("< send 001 0 >").contains("choose rawmode first"));
    assert_eq!(program.ask("< rawmode >"), "< ok >");
    assert!(program.ask("< send 00000001 0 >").contains("11 bits"));
    // Two have come; six more find room, the next none.
    let crowd: Vec<Program> = (0..6).map(|_| served.raw()).collect();
    let mut late = served.program();
    assert_eq!(late.hear(), "< error 8 programs use this bus >");
    drop(crowd);
    std::thread::sleep(Duration::from_millis(200));
    // One that sends more than the bus carries waits; the others come before it, because its identifier is the last.
    let flood = "< send 7FF 1 5 >".repeat(50);
    program.socket.set_nonblocking(true).unwrap();
    let mut sent = 0;
    let mut other = served.raw();
    for _ in 0..20 {
        while let Ok(count) = program.socket.write(flood.as_bytes()) {
            sent += count;
        }
        let begin = Instant::now();
        other.say("< send 00A 1 1 >");
        other.await_frame("546");
        assert!(begin.elapsed() < Duration::from_secs(1), "{:?}", begin.elapsed());
    }
    assert!(sent > 1_000_000, "{sent} bytes are no flood");
    served.interrupt();
}
