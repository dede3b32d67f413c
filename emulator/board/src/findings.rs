//! Findings of the emulator about the image: accesses that nothing models, that the chip refuses or ignores.

use std::collections::BTreeMap;

use fdcan_model::{Remark, RemarkKind};
use rigless::emulator::Settled;
use rigless::session::Session;
use serde_json::{Value, json};

use crate::board::Board;
use crate::excuses;
use crate::image::Image;

/// Grade of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Grade {
    /// Nothing models it: the run proves nothing about what follows.
    Unmodelled,
    /// The chip refuses the access, or works outside its limits.
    Refused,
    /// The chip ignores the write.
    Ignored,
    /// Listed with a reason.
    Excused,
    /// Worth knowing.
    Noted,
}

impl Grade {
    /// For people and for the report.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unmodelled => "unmodelled",
            Self::Refused => "refused",
            Self::Ignored => "ignored",
            Self::Excused => "excused",
            Self::Noted => "noted",
        }
    }
}

/// One finding; the same one again is counted, not repeated.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// Grade.
    pub grade: Grade,
    /// Instance and register.
    pub register: String,
    /// Address, where it was an access.
    pub address: Option<u64>,
    /// Function of the image, where it was an access.
    pub function: Option<String>,
    /// Description.
    pub text: String,
    /// When it was first seen, ns.
    pub at: u64,
}

impl Finding {
    /// One line for people.
    #[must_use]
    pub fn line(&self) -> String {
        let address = self.address.map(|address| format!(" ({address:#010x})")).unwrap_or_default();
        let function = self.function.as_ref().map(|name| format!(", by {name}")).unwrap_or_default();
        let (grade, us) = (self.grade.name(), self.at / 1000);
        format!("{grade}: {}{address}{function}, at {us} us: {}", self.register, self.text)
    }

    /// For the report.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "register": self.register,
            "address": self.address,
            "function": self.function,
            "text": self.text,
            "at_us": self.at / 1000,
        })
    }
}

/// All of them, in the order they were found.
#[derive(Debug, Default)]
pub struct Findings {
    list: Vec<Finding>,
    /// Number of entries of each of the session's lists that have been read.
    seen: Seen,
}

#[derive(Debug, Default, PartialEq, Eq, Clone, Copy)]
struct Seen {
    unmapped: usize,
    refused: usize,
    unimplemented: usize,
    undefined: usize,
    told: usize,
    unrouted: usize,
}

impl Findings {
    /// Everything found so far.
    #[must_use]
    pub fn all(&self) -> &[Finding] {
        &self.list
    }

    /// Those of one grade.
    pub fn of(&self, grade: Grade) -> impl Iterator<Item = &Finding> {
        self.list.iter().filter(move |finding| finding.grade == grade)
    }

    /// Adds one unless the same is there.
    pub fn add(&mut self, finding: Finding) {
        let same = |known: &Finding| {
            known.grade == finding.grade && known.register == finding.register && known.text == finding.text
        };
        if !self.list.iter().any(same) {
            self.list.push(finding);
        }
    }

    /// Looks at what is new since the last call, right after something happened.
    pub fn look(&mut self, session: &Session<Board>, image: &Image, settled: &Settled) {
        let counts = Seen {
            unmapped: self.seen.unmapped,
            refused: session.refused().len(),
            unimplemented: session.unimplemented().len(),
            undefined: session.undefined().len(),
            told: session.told().count(),
            unrouted: session.unrouted().len(),
        };
        let Settled::Access { access, .. } = settled else {
            self.sweep(session, image, counts, None);
            return;
        };
        if counts != self.seen {
            self.sweep(session, image, counts, access.program_counter);
        }
    }

    fn sweep(&mut self, session: &Session<Board>, image: &Image, mut counts: Seen, pc: Option<u64>) {
        let function = |pc: u64| Some(image.function_at(pc as u32));
        let unmapped = session.unmapped();
        counts.unmapped = unmapped.len();
        if counts == self.seen {
            return;
        }
        self.seen = counts;
        for entry in unmapped {
            self.add(Finding {
                grade: Grade::Unmodelled,
                register: format!("address {:#010x}", entry.address),
                address: Some(entry.address),
                function: function(entry.program_counter),
                text: "nothing answers at this address".into(),
                at: 0,
            });
        }
        for (address, fault) in session.refused() {
            self.add(Finding {
                grade: Grade::Refused,
                register: format!("address {address:#010x}"),
                address: Some(*address),
                function: pc.and_then(function),
                text: fault.to_string(),
                at: 0,
            });
        }
        for (address, entry) in session.unimplemented() {
            let excuse = excuses::register(entry.instance, entry.register, entry.writes > 0);
            self.add(Finding {
                grade: if excuse.is_some() { Grade::Excused } else { Grade::Unmodelled },
                register: format!("{}.{}", entry.instance, entry.register),
                address: Some(*address),
                function: function(entry.program_counter),
                text: excuse.unwrap_or("no model stands behind this register").into(),
                at: 0,
            });
        }
        for (address, entry) in session.undefined() {
            let excuse = excuses::address(*address);
            self.add(Finding {
                grade: if excuse.is_some() { Grade::Excused } else { Grade::Unmodelled },
                register: format!("{} at {address:#010x}", entry.instance),
                address: Some(*address),
                function: function(entry.program_counter),
                text: excuse.unwrap_or("the chip's description has no register here").into(),
                at: 0,
            });
        }
        for told in session.told() {
            let grade = if told.reason.contains("ignored") { Grade::Ignored } else { Grade::Refused };
            let register = format!("{}.{}", told.instance, told.register);
            let by = pc.and_then(function);
            let known = |finding: &Finding| finding.register == register && finding.at == told.at.0;
            if self.list.iter().any(known) {
                continue;
            }
            let excuse = excuses::told(&register, by.as_deref().unwrap_or(""));
            self.add(Finding {
                grade: if excuse.is_some() { Grade::Excused } else { grade },
                register,
                address: None,
                function: by,
                text: excuse.unwrap_or(told.reason).into(),
                at: told.at.0,
            });
        }
        for (instance, number) in session.unrouted() {
            self.add(Finding {
                grade: Grade::Unmodelled,
                register: format!("{instance} interrupt {number}"),
                address: None,
                function: None,
                text: "the core has no such line".into(),
                at: 0,
            });
        }
    }

    /// Remarks of the CAN controllers during the last access.
    pub fn note_remarks(&mut self, remarks: Vec<Remark>, image: &Image, settled: &Settled) {
        let pc = match settled {
            Settled::Access { access, .. } => access.program_counter,
            _ => None,
        };
        for remark in remarks {
            let grade = match remark.kind {
                RemarkKind::Ignored => Grade::Ignored,
                RemarkKind::Unmodelled => Grade::Unmodelled,
                RemarkKind::Unwritten => Grade::Refused,
                RemarkKind::Suspicious | RemarkKind::Erratum | RemarkKind::Lost => Grade::Noted,
            };
            let unit = remark.unit.map(|unit| format!("{unit:?}")).unwrap_or_default();
            self.add(Finding {
                grade,
                register: format!("FDCAN {unit} {}", remark.register),
                address: None,
                function: pc.map(|pc| image.function_at(pc as u32)),
                text: remark.text.into(),
                at: remark.at,
            });
        }
    }

    /// Number of findings of each grade, with the first entries, for the report.
    #[must_use]
    pub fn json(&self) -> BTreeMap<&'static str, Value> {
        let grades = [Grade::Unmodelled, Grade::Refused, Grade::Ignored, Grade::Excused, Grade::Noted];
        grades
            .into_iter()
            .map(|grade| {
                let entries: Vec<Value> = self.of(grade).map(Finding::json).collect();
                (grade.name(), json!({ "count": entries.len(), "entries": entries }))
            })
            .collect()
    }
}
