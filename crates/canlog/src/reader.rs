//! A whole log, line after line: each interface with what its frames have told so far.

use crate::candump::{AnyFrame, LogLine};
use crate::decoder::{Decoder, Meaning};
use crate::host_link::HostLink;

/// The traffic of an interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BusKind {
    /// Barrett's protocol.
    Arm,
    /// The link between host and devices.
    Host,
}

/// One interface of a log.
pub struct Interface {
    /// Its name.
    pub name: Box<str>,
    kind: BusKind,
    /// The pucks, as far as they have told.
    pub decoder: Decoder,
    /// The link, as far as it was seen.
    pub link: HostLink,
}

impl Interface {
    fn new(name: &str) -> Self {
        // Until an identifier shows otherwise: every arm's bus has others than those of segments, and the first frame
        // is one unless the log begins in the middle of an enumeration.
        Self { name: name.into(), kind: BusKind::Host, decoder: Decoder::default(), link: HostLink::default() }
    }

    /// Its traffic, as far as is known.
    #[must_use]
    pub fn kind(&self) -> BusKind {
        self.kind
    }

    /// Reads its next frame.
    pub fn read(&mut self, frame: &AnyFrame) -> Meaning {
        if let AnyFrame::Data(frame) = frame {
            if self.kind == BusKind::Host && HostLink::is_segment(frame) {
                return self.link.read(frame).unwrap_or_else(|| Meaning::unknown("?", "?", "no segment"));
            }
            self.kind = BusKind::Arm;
        }
        self.decoder.read(frame)
    }
}

/// Reads a log in the order of its lines.
#[derive(Default)]
pub struct Reader {
    interfaces: Vec<Interface>,
}

impl Reader {
    /// The meaning of a line, and the interface it belongs to.
    pub fn read(&mut self, line: &LogLine) -> (Meaning, &Interface) {
        let place = self.interfaces.iter().position(|interface| interface.name == line.interface);
        let place = place.unwrap_or_else(|| {
            self.interfaces.push(Interface::new(&line.interface));
            self.interfaces.len() - 1
        });
        let interface = &mut self.interfaces[place];
        (interface.read(&line.frame), interface)
    }

    /// The interfaces seen so far.
    #[must_use]
    pub fn interfaces(&self) -> &[Interface] {
        &self.interfaces
    }
}
