//! Finds in a line what may point somewhere: links, code spans, paths, numbers of decisions, fault identifiers.

/// The line with blanks in place of its code spans, and the spans.
pub(super) fn code_spans(line: &str) -> (String, Vec<&str>) {
    let (mut prose, mut spans) = (String::new(), Vec::new());
    // A span between two backticks on one line; what begins on one line and ends on the next is not looked at.
    let parts: Vec<&str> = line.split('`').collect();
    for (index, part) in parts.iter().enumerate() {
        if index % 2 == 1 && index + 1 < parts.len() {
            prose.push(' ');
            spans.push(*part);
        } else {
            prose.push_str(part);
        }
    }
    (prose, spans)
}

/// Targets of `[text](target)` and `[text]: target`.
pub(super) fn links(prose: &str) -> Vec<&str> {
    let mut targets = Vec::new();
    for (at, _) in prose.match_indices("](") {
        let rest = &prose[at + 2..];
        targets.extend(rest.find(')').and_then(|end| rest[..end].split_whitespace().next()));
    }
    let definition = prose.trim_start();
    if let Some((label, target)) = definition.split_once("]: ")
        && label.starts_with('[')
    {
        targets.extend(target.split_whitespace().next());
    }
    targets
}

/// The comment of a line of Rust; none if the slashes belong to an address.
pub(super) fn comment(line: &str) -> Option<&str> {
    let at = line.find("//")?;
    let is_address = line[..at].ends_with(':');
    (!is_address).then(|| line[at..].trim_start_matches(['/', '!']).trim_start())
}

/// Words that may be paths: without the punctuation around them.
pub(super) fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| c.is_whitespace() || "`\"'()[]<>;|=\\".contains(c))
        .map(|word| word.trim_end_matches(['.', ',', ':', '…']))
        .filter(|word| word.contains('/'))
}

/// Numbers after the word "decision".
pub(super) fn decisions(line: &str) -> impl Iterator<Item = &str> {
    line.match_indices("ecision ").filter_map(|(at, word)| {
        let rest = &line[at + word.len()..];
        let number = rest.get(..4)?;
        let ends = !rest[4..].starts_with(|c: char| c.is_ascii_alphanumeric());
        (ends && number.bytes().all(|byte| byte.is_ascii_digit())).then_some(number)
    })
}

/// True if a code span is the name of a test: lower case, at least five words.
pub(super) fn is_test_name(span: &str) -> bool {
    span.split('_').count() >= 5
        && span.starts_with(|c: char| c.is_ascii_lowercase())
        && span.split('_').all(|word| !word.is_empty())
        && span.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_')
}

/// The name of the function that a line of Rust begins.
pub(super) fn name(line: &str) -> Option<&str> {
    let line = line.trim_start();
    let rest = line.strip_prefix("fn ").or_else(|| line.split_once(" fn ").map(|(_, rest)| rest))?;
    let end = rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_')?;
    (end > 0 && !line.starts_with("//")).then(|| &rest[..end])
}

/// Fault identifiers that a function's name begins with: `b5_b7_a_stuck_sensor` has two. A name that is nothing else
/// has none.
pub(super) fn identifiers_of_name(name: &str) -> Vec<String> {
    let is_one = |word: &&str| is_identifier(&word.to_ascii_uppercase()) && !matches!(*word, "f32" | "f64");
    let first: Vec<&str> = name.split('_').take_while(is_one).collect();
    if first.len() == name.split('_').count() {
        return Vec::new();
    }
    first.into_iter().map(str::to_ascii_uppercase).collect()
}

/// Fault identifiers of a text: alone in brackets, before a colon at its beginning, or after the word "fault".
pub(super) fn identifiers(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (at, _) in text.match_indices('(') {
        let rest = &text[at + 1..];
        found.extend(rest.find(')').and_then(|end| all_identifiers(&rest[..end])).unwrap_or_default());
    }
    if let Some((first, _)) = text.split_once(": ") {
        found.extend(all_identifiers(first).unwrap_or_default());
    }
    for word in ["fault ", "faults "] {
        for (at, _) in text.match_indices(word) {
            let rest: Vec<&str> = text[at + word.len()..].split([' ', ',', ')', '.', ';', ':']).collect();
            let listed = rest.iter().filter(|word| !word.is_empty());
            let listed = listed.take_while(|word| is_identifier(word) || matches!(**word, "to" | "and"));
            found.extend(listed.filter(|word| is_identifier(word)).map(|word| (*word).to_owned()));
        }
    }
    found
}

/// The identifiers of a text that consists of nothing else: "A8", "B5, B7", "B2 to B7".
fn all_identifiers(text: &str) -> Option<Vec<String>> {
    let words: Vec<&str> = text.split([' ', ',']).filter(|word| !matches!(*word, "" | "to" | "and")).collect();
    let all = !words.is_empty() && words.iter().all(|word| is_identifier(word));
    all.then(|| words.into_iter().map(str::to_owned).collect())
}

/// A letter A to H and a number from 1 to 99.
pub(super) fn is_identifier(word: &str) -> bool {
    let mut bytes = word.bytes();
    let letter = bytes.next();
    let digits: Vec<u8> = bytes.collect();
    matches!(letter, Some(b'A'..=b'H'))
        && (1..=2).contains(&digits.len())
        && digits.iter().all(u8::is_ascii_digit)
        && digits.first() != Some(&b'0')
}
