//! Files that were made elsewhere, or for something else: what they are is told in a few words.

use crate::tool::{learned, said, tactus};

/// The change that makes it fail: the parser shows the line that it stumbles over, however long that is.
#[test]
fn a_file_that_is_no_toml_and_has_long_lines_does_not_fill_the_screen() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("picture.svg"), format!("<svg>{}</svg>\n", "<path/>".repeat(100_000))).unwrap();
    std::fs::create_dir(at.join("tactus")).unwrap();
    let device = "--device sil:world=simple --non-interactive";
    for line in [
        "check picture.svg".to_owned(),
        format!("{device} upload picture.svg"),
        format!("{device} config diff picture.svg"),
        "--device sil:world=simple,faults=picture.svg list".to_owned(),
    ] {
        let output = tactus(at, &line);
        let said = said(&output);
        let shown: String = said.chars().take(1000).collect();
        assert!(!output.status.success() && said.len() < 1000 && said.contains("line 1"), "{line}: {shown}");
    }
    std::fs::rename(at.join("picture.svg"), at.join("tactus/config.toml")).unwrap();
    let output = tactus(at, "list");
    let said = said(&output);
    assert!(said.len() < 1000 && said.contains("config.toml"), "{}", said.chars().take(1000).collect::<String>());
}

/// The change that makes it fail: a text is parsed as it stands in the file.
#[test]
fn a_primitive_whose_lines_end_in_carriage_returns_alone_is_checked() {
    let folder = learned(3.0);
    let at = folder.path();
    let text = std::fs::read_to_string(at.join("reach.toml")).unwrap();
    std::fs::write(at.join("mac.toml"), text.replace('\n', "\r")).unwrap();
    let [usual, returns] = ["reach", "mac"].map(|name| tactus(at, &format!("check {name}.toml")).stdout);
    assert!(!usual.is_empty() && usual == returns);
}
