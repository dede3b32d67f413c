//! The terminal of `tactus monitor`: taken, given to the shell for a while, taken back; and the keys pressed in it.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver};

use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event as Input, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use rustix::process::{Signal, kill_current_process_group};
use signal_hook::consts::signal::SIGCONT;

use super::{Watch, draw};

/// A wish of the person at the keyboard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// Stop the arm.
    Stop,
    /// End the monitor.
    Leave,
    /// Give the terminal to the shell for a while (Ctrl-Z).
    Suspend,
}

/// The terminal, which shows the arm until this is dropped.
pub struct Screen {
    terminal: DefaultTerminal,
    keys: Receiver<io::Result<Input>>,
    /// Somebody had stopped this program and let it go on: what the terminal shows is another's.
    was_stopped: Arc<AtomicBool>,
}

impl Screen {
    /// Takes the terminal.
    ///
    /// # Errors
    /// There is none, or it cannot be set up.
    pub fn open() -> io::Result<Self> {
        let was_stopped = Arc::new(AtomicBool::new(false));
        signal_hook::flag::register(SIGCONT, Arc::clone(&was_stopped))?;
        Ok(Self { terminal: ratatui::try_init()?, keys: keys(), was_stopped })
    }

    /// Draws everything; anew if the shell has had the terminal meanwhile.
    ///
    /// # Errors
    /// The terminal cannot be written to.
    pub fn show(&mut self, watch: &Watch) -> io::Result<()> {
        if self.was_stopped.load(Ordering::SeqCst) {
            self.take_back()?;
        }
        self.terminal.draw(|frame| draw(frame, watch)).map(|_| ())
    }

    /// Takes the terminal once more, whatever the shell has made of it.
    ///
    /// # Errors
    /// It cannot be set up.
    pub fn take_back(&mut self) -> io::Result<()> {
        self.was_stopped.store(false, Ordering::SeqCst);
        ratatui::restore();
        self.terminal = ratatui::try_init()?;
        Ok(())
    }

    /// Gives the terminal to the shell and stops this program with all of its group, as Ctrl-Z does with any other;
    /// returns when it is continued. Where no shell waits for it, the system does not stop it.
    ///
    /// # Errors
    /// The terminal cannot be taken back.
    pub fn suspend(&mut self) -> io::Result<()> {
        ratatui::restore();
        kill_current_process_group(Signal::TSTP)?;
        self.take_back()
    }

    /// The wish since the last look. A stop counts more than all else.
    ///
    /// # Errors
    /// The keyboard cannot be read.
    pub fn wish(&self) -> io::Result<Option<Wish>> {
        let mut newest = None;
        for input in self.keys.try_iter() {
            let Input::Key(key) = input? else { continue };
            if newest != Some(Wish::Stop) {
                newest = meant(key).or(newest);
            }
        }
        Ok(newest)
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

/// The wish that a key stands for. Whoever presses one in a hurry does not look whether capitals are locked.
fn meant(key: KeyEvent) -> Option<Wish> {
    let KeyCode::Char(letter) = key.code else {
        return (key.kind == KeyEventKind::Press && key.code == KeyCode::Esc).then_some(Wish::Leave);
    };
    let has_control = key.modifiers.contains(KeyModifiers::CONTROL);
    match letter.to_ascii_lowercase() {
        _ if key.kind != KeyEventKind::Press => None,
        's' | ' ' => Some(Wish::Stop),
        'c' if has_control => Some(Wish::Leave),
        'z' if has_control => Some(Wish::Suspend),
        'q' => Some(Wish::Leave),
        _ => None,
    }
}

/// Input of the keyboard. It is read beside the watching: where a terminal was closed the library that reads it
/// may never return, and nobody would see any more that the command is to end.
fn keys() -> Receiver<io::Result<Input>> {
    let (sender, keys) = mpsc::channel();
    std::thread::spawn(move || {
        loop {
            let input = event::read();
            let is_broken = input.is_err();
            if sender.send(input).is_err() || is_broken {
                return;
            }
        }
    });
    keys
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_is_understood_with_capitals_locked_and_a_plain_c_or_z_means_nothing() {
        let pressed = |letter, modifiers| meant(KeyEvent::new(KeyCode::Char(letter), modifiers));
        for letter in ['s', 'S', ' '] {
            assert_eq!(pressed(letter, KeyModifiers::NONE), Some(Wish::Stop), "{letter:?}");
            assert_eq!(pressed(letter, KeyModifiers::SHIFT), Some(Wish::Stop), "{letter:?}");
        }
        assert_eq!(pressed('Q', KeyModifiers::SHIFT), Some(Wish::Leave));
        assert_eq!(pressed('c', KeyModifiers::CONTROL), Some(Wish::Leave));
        assert_eq!(pressed('z', KeyModifiers::CONTROL), Some(Wish::Suspend));
        assert_eq!(pressed('c', KeyModifiers::NONE), None);
        assert_eq!(pressed('z', KeyModifiers::NONE), None);
    }
}
