//! Names of primitives and short texts: what is one, and how it is shown.

use link::name::{NAME_BYTES, TEXT_BYTES};
use link::{Name, NameError, Text};

#[test]
fn a_name_is_what_was_typed_and_is_shown_so() {
    let name: Name = "side-grasp.2".parse().unwrap();
    assert_eq!(name.as_str(), "side-grasp.2");
    assert_eq!(format!("{name}|{name:<14}|{name:?}"), "side-grasp.2|side-grasp.2  |\"side-grasp.2\"");
    assert_eq!("".parse::<Name>(), Err(NameError::Empty));
}

#[test]
fn a_text_that_is_no_name_is_told_which_rule_it_breaks() {
    let words = "a name has letters, digits, '-', '_' and '.', and starts with a letter, digit or '_'";
    for text in ["-a", ".a", "a b", "a/b", "ä"] {
        assert_eq!(Name::new(text), Err(NameError::BadCharacter), "{text}");
    }
    assert_eq!(NameError::BadCharacter.to_string(), words);
    assert!(Name::new(&"n".repeat(NAME_BYTES)).is_ok());
    assert_eq!(Name::new(&"n".repeat(NAME_BYTES + 1)), Err(NameError::TooLong));
    assert_eq!(NameError::TooLong.to_string(), "the name is longer than 32 characters");
    assert_eq!(NameError::Empty.to_string(), "the name is empty");
}

#[test]
fn a_text_that_is_too_long_is_cut_behind_a_whole_character() {
    let fits = "x".repeat(TEXT_BYTES - 1);
    assert_eq!(Text::new(&format!("{fits}ä")).as_str(), fits);
    assert_eq!(Text::new(&format!("{fits}yz")).as_str(), format!("{fits}y"));
    let text = Text::from("anna@lab3");
    assert_eq!(format!("{text}|{text:>10}|{text:?}"), "anna@lab3| anna@lab3|\"anna@lab3\"");
}
