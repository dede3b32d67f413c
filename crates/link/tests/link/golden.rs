//! The bytes of every message and of an image, pinned in `src/schema.txt`, and thereby the schema hash.
//!
//! After a change of the layouts: `UPDATE_DOCUMENTS=1 cargo test -p link --test link` writes text, version, hash and
//! the lines of the documents anew.

use std::fmt::Write as _;
use std::path::Path;

use crate::samples::{EVENT_KINDS, Tables, event_index, replies, reply_index, request_index, requests};
use link::frame::{self, Envelope, FRAME_BYTES};
use link::image::{Hemisphere, IMAGE_SCHEMA, PrimitiveImage, image_bytes};
use link::message::AccelerationSource;
use link::{HandStage, HomeSource, LINK_VERSION, Refusal, SCHEMA_HASH, SecretState};

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").unwrap();
        text
    })
}

fn encoded<T: serde::Serialize>(value: &T) -> String {
    let mut buffer = [0; 512];
    hex(postcard::to_slice(value, &mut buffer).unwrap())
}

/// First word of the debug text: the variant.
fn variant(value: &impl std::fmt::Debug) -> String {
    let text = format!("{value:?}");
    text.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default().to_owned()
}

/// The text that `src/schema.txt` must be, of a version of the link.
fn schema(version: u16) -> String {
    let mut text = String::new();
    let mut line = |words: String| {
        text.push_str(&words);
        text.push('\n');
    };
    line("# Every layout of the link with its bytes. Written by tests/golden.rs, hashed into SCHEMA_HASH.".into());
    line(format!("link {version}"));
    line("payload session:u16 sequence:u16 time_ms:u32 message:postcard crc32_iscsi:u32 in COBS, 00".into());
    for request in requests() {
        line(format!("request {:2} {} {}", request_index(&request), variant(&request), encoded(&request)));
    }
    for reply in replies() {
        line(format!("reply {:2} {} {}", reply_index(&reply), variant(&reply), encoded(&reply)));
    }
    for refusal in Refusal::ALL {
        line(format!("refusal {:2} {refusal:?} {}", refusal.code(), encoded(&refusal)));
    }
    for kind in EVENT_KINDS {
        line(format!("event {} {kind:?} {}", event_index(kind), encoded(&kind)));
    }
    for code in 0..=4 {
        let stage = HandStage::from_code(code).expect("a stage");
        line(format!("hand_stage {code} {stage:?} {}", encoded(&stage)));
    }
    for source in [HomeSource::Model, HomeSource::Stored, HomeSource::Damaged, HomeSource::Foreign] {
        line(format!("home_source {source:?} {}", encoded(&source)));
    }
    for state in [SecretState::Nothing, SecretState::Kept, SecretState::Unreadable, SecretState::NotOffered] {
        line(format!("secret_state {state:?} {}", encoded(&state)));
    }
    for choice in [AccelerationSource::Analytic, AccelerationSource::Differentiated] {
        line(format!("acceleration {choice:?} {}", encoded(&choice)));
    }
    line(format!("image {IMAGE_SCHEMA} kernels 2 gain points 1 expectation points 2 experience points 1"));
    for part in Tables::new(2, 1, 2, 1).image().chunks(32) {
        line(hex(part));
    }
    text
}

/// Documents that show the hash of the schema.
const WITH_HASH: [&str; 2] = ["docs/protocol.md", "docs/lab-guide.md"];

/// FNV-1a, 32 bit.
fn hash_of(text: &str) -> u32 {
    text.bytes().fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

/// Names and types of the telemetry, as its struct says, for the table of `docs/protocol.md`.
fn telemetry_fields() -> String {
    let source = include_str!("../../src/telemetry.rs").replace('\r', "");
    let (_, after) = source.split_once("pub struct Telemetry {\n").expect("the struct");
    let (fields, _) = after.split_once("\n}").expect("its end");
    let field = |line: &str| {
        let (name, kind) = line.trim().strip_prefix("pub ")?.strip_suffix(',')?.split_once(": ")?;
        let array = kind.strip_prefix('[').and_then(|kind| kind.strip_suffix(']')?.split_once("; "));
        Some(array.map_or(format!("{name} {kind}"), |(kind, count)| format!("{name} {count} {kind}")))
    };
    fields.lines().filter_map(field).collect::<Vec<_>>().join(", ")
}

/// Line of `docs/protocol.md` with the fields of the telemetry.
fn telemetry_line() -> String {
    format!("| 7 | Telemetry | {} |", telemetry_fields())
}

/// Bytes of a telemetry message whose integers are as long as they get: postcard writes 7 bits a byte.
pub(crate) fn longest_telemetry_frame() -> usize {
    let bytes = |kind: &str| match kind {
        "u8" | "bool" => 1,
        "u16" => 3,
        "u32" => 5,
        "f32" => 4,
        other => panic!("the length of {other} is not known here"),
    };
    let field = |field: &str| match field.split(' ').collect::<Vec<_>>()[..] {
        [_, count, kind] => count.parse::<usize>().expect("a count") * bytes(kind),
        [_, kind] => bytes(kind),
        _ => panic!("{field:?} is no field"),
    };
    let fields: usize = telemetry_fields().split(", ").map(field).sum();
    // Envelope and number of the message before them, check sum, stuffing and zero behind them.
    8 + 1 + fields + 4 + 2
}

/// The sentence of `docs/protocol.md` about the length of a telemetry message and its share of the serial line.
fn telemetry_load() -> String {
    let bytes = longest_telemetry_frame();
    let (rate, line) = (f64::from(u32::try_from(bytes).unwrap()) * 300.0, 921_600.0 / 10.0);
    format!("at most {bytes} bytes a message, {:.0} kB/s, {:.0} % of the serial line", rate / 1e3, 100.0 * rate / line)
}

/// The document with version and hash of a schema text, and what the struct of the telemetry says.
fn brought_up_to_date(document: &str, schema: &str, version: u16) -> String {
    let text = document
        .replace(&format!("version **{LINK_VERSION}**"), &format!("version **{version}**"))
        .replace(&format!("{SCHEMA_HASH:#010x}"), &format!("{:#010x}", hash_of(schema)));
    let line = |line: &str| {
        if line.starts_with("| 7 | Telemetry |") {
            return telemetry_line() + "\n";
        }
        match (line.split_once("at most "), line.split_once("of the serial line")) {
            (Some((before, _)), Some((_, after))) => before.to_owned() + &telemetry_load() + after,
            _ => line.to_owned(),
        }
    };
    text.split_inclusive('\n').map(line).collect()
}

#[test]
fn every_layout_is_the_one_in_the_schema_text_and_its_hash_in_the_documents() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let read = |path: &str| std::fs::read_to_string(root.join(path)).unwrap().replace('\r', "");
    let same = schema(LINK_VERSION) == include_str!("../../src/schema.txt").replace('\r', "");
    let version = if same { LINK_VERSION } else { LINK_VERSION + 1 };
    let expected = schema(version);
    let document = |path: &str| brought_up_to_date(&read(path), &expected, version);
    if std::env::var_os("UPDATE_DOCUMENTS").is_some() {
        for path in WITH_HASH {
            std::fs::write(root.join(path), document(path)).unwrap();
        }
        std::fs::write(root.join("crates/link/src/schema.txt"), &expected).unwrap();
    }
    let written = read("crates/link/src/schema.txt");
    let difference = expected.lines().zip(written.lines()).skip(2).find(|(new, old)| new != old);
    assert!(
        expected == written,
        "a layout changed: {difference:?}\nIf that is meant: UPDATE_DOCUMENTS=1 cargo test -p link --test link. It \
         raises the version of the link; raise IMAGE_SCHEMA by hand if the image changed"
    );
    for path in WITH_HASH {
        let (hash, found) = (format!("{:#010x}", hash_of(&expected)), read(path));
        assert!(
            found.contains(&hash) && found == document(path),
            "{path}: UPDATE_DOCUMENTS=1 cargo test -p link --test link"
        );
    }
    let protocol = read("docs/protocol.md");
    let told = [telemetry_line(), telemetry_load(), format!("version **{version}**")];
    told.iter().for_each(|told| assert!(protocol.contains(told), "docs/protocol.md should show: {told}"));
}

#[test]
fn hash_of_the_schema_is_fnv_1a_of_its_text() {
    let written = include_str!("../../src/schema.txt").replace('\r', "");
    assert_eq!(SCHEMA_HASH, hash_of(&written));
    assert_eq!(hash_of("a"), 0xe40c_292c, "a published vector of FNV-1a");
}

#[test]
fn samples_cover_every_variant_in_order() {
    assert!(requests().iter().map(request_index).eq(0..43));
    assert!(replies().iter().map(reply_index).eq(0..17));
    assert!(EVENT_KINDS.iter().map(|kind| event_index(*kind)).eq(0..10));
    assert!(Refusal::ALL.iter().map(|refusal| usize::from(refusal.code())).eq(0..Refusal::ALL.len()));
}

#[test]
fn every_refusal_explains_itself_and_names_a_remedy() {
    for refusal in Refusal::ALL {
        assert!(refusal.explanation().len() > 10 && !refusal.explanation().ends_with('.'), "{refusal:?}");
        assert!(refusal.remedy().len() > 10 && !refusal.remedy().ends_with('.'), "{refusal:?}");
    }
}

/// The worked example of `docs/protocol.md`; run with `--nocapture` to print it.
#[test]
fn worked_example_of_the_protocol_document() {
    let mut buffer = [0; FRAME_BYTES];
    let envelope = Envelope { session: 0x2A17, sequence: 5, time_ms: 1200 };
    let length = frame::encode(envelope, &link::Request::List { index: 0 }, &mut buffer).unwrap();
    let frame = hex(&buffer[..length]);
    println!("request List {{ index: 0 }}: {frame}");
    let document = include_str!("../../../../docs/protocol.md");
    assert!(document.contains(&frame), "the document should show {frame}");
}

/// The worked example of `docs/image-format.md`.
#[test]
fn worked_example_of_the_image_document() {
    let image = Tables::new(2, 1, 2, 1).image();
    assert_eq!(image.len(), image_bytes(2, 1, 1, 2, 1));
    let parsed = PrimitiveImage::parse(&image).unwrap();
    assert_eq!(parsed.content().hemisphere, Hemisphere::Demonstrated);
    let document = include_str!("../../../../docs/image-format.md");
    for (offset, row) in image.chunks(16).enumerate().filter(|(index, _)| *index < 6) {
        let line = format!("{:04x}  {}", 16 * offset, hex(row));
        println!("{line}");
        assert!(document.contains(&line), "the document should show {line}");
    }
    let last = format!("{:04x}  {}", image.len() - 4, hex(&image[image.len() - 4..]));
    println!("{last}");
    assert!(document.contains(&last), "the document should show {last}");
}
