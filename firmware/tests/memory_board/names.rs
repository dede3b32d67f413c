//! Sources for all boards name none.

use std::fs;
use std::path::Path;

/// Words that belong into a board's module.
const WORDS: [&str; 16] = [
    "mps2",
    "stm32",
    "nucleo",
    "h743",
    "qemu",
    "semihosting",
    "cmsdk",
    "fdcan",
    "usart",
    "embassy",
    "pac::",
    "0x4000",
    "0x5800",
    "lockstep",
    "register",
    "peripherals::",
];

fn sources(folder: &Path, found: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(folder).expect("a folder of this package") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else {
            found.push((path.display().to_string(), fs::read_to_string(&path).expect("text")));
        }
    }
}

#[test]
fn application_and_image_name_no_board_chip_or_register() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root.join("application"), &mut files);
    let image = root.join("bin").join("arm.rs");
    files.push((image.display().to_string(), fs::read_to_string(image).expect("text")));
    assert!(files.len() > 6, "looked at too little");
    for (name, text) in files {
        let text = text.to_lowercase();
        for word in WORDS {
            assert!(!text.contains(word), "{name} says '{word}'");
        }
    }
}
