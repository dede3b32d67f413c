//! The pendant of a served arm: its buttons are words on standard input.

use std::io::{BufRead, IsTerminal};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use sim::PendantAction;

/// Words that the pendant takes, for people.
pub(super) const WORDS: &str = "`idle` (Shift-Idle), `activate` (Shift-Activate), `estop` (emergency stop), \
                                `release` (it, and carry the arm home)";

/// The action of a word.
fn action(word: &str) -> Option<PendantAction> {
    match word {
        "idle" => Some(PendantAction::ShiftIdle),
        "activate" => Some(PendantAction::ShiftActivate),
        "estop" => Some(PendantAction::PressEStop),
        "release" => Some(PendantAction::ReleaseEStop),
        _ => None,
    }
}

/// Words of standard input as they come.
pub(super) struct Pendant(Option<Receiver<String>>);

impl Pendant {
    /// Listens to standard input. A program in the background of a terminal must not: reading would stop it.
    pub(super) fn listen() -> Self {
        let stdin = std::io::stdin();
        if stdin.is_terminal() && !is_in_foreground() {
            return Self(None);
        }
        let (words, receiver) = channel();
        std::thread::spawn(move || {
            for line in stdin.lock().lines() {
                let Ok(line) = line else { return };
                if words.send(line).is_err() {
                    return;
                }
            }
        });
        Self(Some(receiver))
    }

    /// The next button that was pressed; a word that means none is the error.
    pub(super) fn pressed(&mut self) -> Option<Result<PendantAction, String>> {
        loop {
            match self.0.as_ref()?.try_recv() {
                Ok(line) if line.trim().is_empty() => {}
                Ok(line) => return Some(action(line.trim()).ok_or(line)),
                Err(TryRecvError::Empty) => return None,
                Err(TryRecvError::Disconnected) => {
                    self.0 = None;
                    return None;
                }
            }
        }
    }
}

/// True unless the terminal of standard input belongs to another group of processes now.
fn is_in_foreground() -> bool {
    let group = rustix::termios::tcgetpgrp(std::io::stdin());
    group.map_or(true, |group| group == rustix::process::getpgrp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_that_people_are_told_is_a_button_and_no_other() {
        let told: Vec<&str> = WORDS.split('`').skip(1).step_by(2).collect();
        assert_eq!(told.len(), 4);
        assert!(told.iter().all(|word| action(word).is_some()), "{told:?}");
        assert_eq!(action("Idle now"), None);
    }
}
