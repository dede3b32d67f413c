//! The bytes of every message and of an image, pinned in `src/schema.txt`, and thereby the schema hash.
//!
//! After a change of the layouts: `UPDATE_DOCUMENTS=1 cargo test -p link --test link` writes text and hash anew.

use std::fmt::Write as _;
use std::path::Path;

use crate::samples::{EVENT_KINDS, Tables, event_index, replies, reply_index, request_index, requests};
use link::frame::{self, Envelope, FRAME_BYTES};
use link::image::{Hemisphere, IMAGE_SCHEMA, PrimitiveImage, image_bytes};
use link::message::{AccelerationSource, PoseFeedback};
use link::{HandStage, HomeSource, LINK_VERSION, Refusal, SCHEMA_HASH};

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

/// The text that `src/schema.txt` must be.
fn schema() -> String {
    let mut text = String::new();
    let mut line = |words: String| {
        text.push_str(&words);
        text.push('\n');
    };
    line("# Every layout of the link with its bytes. Written by tests/golden.rs, hashed into SCHEMA_HASH.".into());
    line(format!("link {LINK_VERSION}"));
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
    for choice in [PoseFeedback::Measured, PoseFeedback::Planned] {
        line(format!("pose_feedback {choice:?} {}", encoded(&choice)));
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
    let source = include_str!("../../src/report.rs").replace('\r', "");
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

/// Writes the schema text, and its hash into the documents in place of the old one.
fn update(root: &Path, expected: &str) {
    std::fs::write(root.join("crates/link/src/schema.txt"), expected).unwrap();
    for document in WITH_HASH {
        let text = std::fs::read_to_string(root.join(document)).unwrap();
        let (old, new) = (format!("{SCHEMA_HASH:#010x}"), format!("{:#010x}", hash_of(expected)));
        let text: Vec<String> = text
            .replace(&old, &new)
            .split_inclusive('\n')
            .map(|line| if line.starts_with("| 7 | Telemetry |") { telemetry_line() + "\n" } else { line.to_owned() })
            .collect();
        std::fs::write(root.join(document), text.concat()).unwrap();
    }
}

#[test]
fn every_layout_is_the_one_in_the_schema_text_and_its_hash_in_the_documents() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let expected = schema();
    if std::env::var_os("UPDATE_DOCUMENTS").is_some() {
        update(&root, &expected);
    }
    let read = |path: &str| std::fs::read_to_string(root.join(path)).unwrap().replace('\r', "");
    let written = read("crates/link/src/schema.txt");
    let difference = expected.lines().zip(written.lines()).find(|(new, old)| new != old);
    assert!(
        expected == written,
        "a layout changed: {difference:?}\nIf that is meant: raise LINK_VERSION or IMAGE_SCHEMA, then \
         UPDATE_DOCUMENTS=1 cargo test -p link --test link"
    );
    let hash = format!("{:#010x}", hash_of(&expected));
    for document in WITH_HASH {
        assert!(read(document).contains(&hash), "{document} should show {hash}");
    }
    let line = telemetry_line();
    assert!(read("docs/protocol.md").contains(&line), "docs/protocol.md should show: {line}");
}

#[test]
fn hash_of_the_schema_is_fnv_1a_of_its_text() {
    let written = include_str!("../../src/schema.txt").replace('\r', "");
    assert_eq!(SCHEMA_HASH, hash_of(&written));
    assert_eq!(hash_of("a"), 0xe40c_292c, "a published vector of FNV-1a");
}

#[test]
fn samples_cover_every_variant_in_order() {
    assert!(requests().iter().map(request_index).eq(0..37));
    assert!(replies().iter().map(reply_index).eq(0..14));
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
