//! A recording: what was measured at each instant, read from CSV and checked value by value.
//!
//! Reading parses, it does not merely validate: a `Recording` that exists has strictly increasing time, finite
//! numbers, whole groups of columns and unit quaternions whose sign does not jump.

use std::path::{Path, PathBuf};

use crate::input_file;

use super::error::{Place, RecordingError};
use super::layout;
use super::origin::Origin;

/// Samples that a recording must have at least: 0.2 s, the shortest movement that can be filtered at
/// 7.5 Hz and differentiated twice. Fewer would be fitted by chance.
pub const FEWEST_SAMPLES: usize = control::time::periods(0.2) as usize;

/// Largest distance of a quaternion's norm from 1. Recordings print about 5 digits; an error above this value is
/// not rounding but a wrong column or a wrong convention.
pub const QUATERNION_NORM_TOLERANCE: f64 = 5e-3;

/// No value of a recording is larger: counters end at 4e9, seconds since 1970 are 2e9.
const LARGEST_VALUE: f64 = 1e12;

/// Two samples further apart than this many typical sample periods have a gap between them.
const GAP_FACTOR: f64 = 1.5;

/// No recorder has a shorter sample period, s. Samples nearer to each other are the same one written twice, with the
/// rounding of their times between them, and tell nothing of the period.
const SHORTEST_PERIOD: f64 = 1e-5;

/// Everything that was recorded, one entry per line of the file in each column that exists.
#[derive(Clone, PartialEq)]
pub struct Recording {
    /// The file it was read from.
    pub file: PathBuf,
    /// CRC-32/ISCSI of the file's bytes.
    pub checksum: u32,
    /// Where it comes from, as far as its notes say.
    pub origin: Origin,
    /// Line of the header in the file, from 1.
    pub header_line: u64,
    /// Names of the columns, as the header has them.
    pub names: Vec<String>,
    /// Line of each sample in the file, from 1.
    pub lines: Vec<u64>,
    /// Time of each sample, s, strictly increasing.
    pub time: Vec<f64>,
    /// Number of the control cycle.
    pub cycle: Option<Vec<u32>>,
    /// State of the supervisor, a word.
    pub state: Option<Vec<String>>,
    /// Code of the latched fault, 0 for none.
    pub fault: Option<Vec<u32>>,
    /// Phase of the movement, 1.
    pub phase: Option<Vec<f64>>,
    /// Joint angles, rad.
    pub q: Option<Vec<[f64; layout::JOINTS]>>,
    /// Joint velocities, rad/s.
    pub dq: Option<Vec<[f64; layout::JOINTS]>>,
    /// Joint torques commanded on the bus, N m.
    pub tau: Option<Vec<[f64; layout::JOINTS]>>,
    /// Measured position of the tool frame, world, m.
    pub position: Option<Vec<[f64; 3]>>,
    /// Measured orientation, unit quaternion (w, x, y, z) tool to world, sign-continuous.
    pub orientation: Option<Vec<[f64; 4]>>,
    /// Desired position, world, m.
    pub position_d: Option<Vec<[f64; 3]>>,
    /// Desired orientation, unit quaternion, sign-continuous.
    pub orientation_d: Option<Vec<[f64; 4]>>,
    /// Wrench of the environment on the robot: force N (world axes), torque N m.
    pub wrench: Option<Vec<[f64; 6]>>,
    /// Flag bits of each cycle, see `control::cycle::record::flags`.
    pub flags: Option<Vec<u32>>,
    /// Measured hand: spread and fingers 1 to 3, rad.
    pub hand: Option<Vec<[f64; 4]>>,
    /// Desired hand: spread and fingers 1 to 3, rad.
    pub hand_d: Option<Vec<[f64; 4]>>,
    /// Torque of the environment on fingers 1 to 3, N m.
    pub gauges: Option<Vec<[f64; 3]>>,
    /// Statistic of the watch for unusual runs, 1.
    pub surprise: Option<Vec<f64>>,
    /// Gaps: places where samples are missing.
    pub gaps: usize,
    /// Samples that are missing in all gaps together.
    pub missing_samples: usize,
    /// The longest distance in time between two neighbours, s, and the index of the later one.
    pub longest_gap: (f64, usize),
}

impl Recording {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// The first thing that is wrong, with its line and column.
    pub fn read(file: &Path) -> Result<Recording, RecordingError> {
        let bytes = input_file::read(file, input_file::LONGEST_RECORDING)
            .map_err(|cause| RecordingError::Unreadable { file: file.to_owned(), cause })?;
        Recording::parse(file, &bytes)
    }

    /// Checks bytes that were read from `file`.
    ///
    /// # Errors
    /// The first thing that is wrong, with its line and column.
    pub fn parse(file: &Path, bytes: &[u8]) -> Result<Recording, RecordingError> {
        let table = Table::parse(file, &input_file::with_newlines(bytes))?;
        let mut missing: Vec<String> = Vec::new();
        if table.column(layout::TIME).is_none() {
            missing.push(layout::TIME.to_owned());
        }
        let q = table.vectors(&layout::JOINT_POSITIONS, &mut missing);
        let dq = table.vectors(&layout::JOINT_VELOCITIES, &mut missing);
        let tau = table.vectors(&layout::JOINT_TORQUES, &mut missing);
        let has_alias = layout::POSITION_ALIAS.iter().any(|name| table.column(name).is_some());
        let position_names = if has_alias { layout::POSITION_ALIAS } else { layout::POSITION };
        let position = table.vectors(&position_names, &mut missing);
        let orientation = table.vectors(&layout::ORIENTATION, &mut missing);
        let position_d = table.vectors(&layout::POSITION_D, &mut missing);
        let orientation_d = table.vectors(&layout::ORIENTATION_D, &mut missing);
        let wrench = table.vectors(&layout::WRENCH, &mut missing);
        let hand = table.vectors(&layout::HAND, &mut missing);
        let hand_d = table.vectors(&layout::HAND_D, &mut missing);
        let gauges = table.vectors(&layout::GAUGES, &mut missing);
        // A position without an orientation (or the reverse) is half a pose: say which half is missing.
        match (&position, &orientation) {
            (Some(_), None) if missing.is_empty() => missing.extend(layout::ORIENTATION.map(String::from)),
            (None, Some(_)) if missing.is_empty() => missing.extend(layout::POSITION.map(String::from)),
            _ => {}
        }
        let time = table.time(&missing)?;
        let cycle = table.whole_numbers(layout::CYCLE)?;
        let (gaps, missing_samples, longest_gap) = count_gaps(&time, cycle.as_deref());
        Ok(Recording {
            file: file.to_owned(),
            checksum: checksum(bytes),
            origin: Origin::of_notes(notes(bytes).iter().map(String::as_str)),
            header_line: table.header_line,
            phase: table.numbers(layout::PHASE),
            surprise: table.numbers(layout::SURPRISE),
            flags: table.whole_numbers(layout::FLAGS)?,
            fault: table.whole_numbers(layout::FAULT)?,
            orientation: table.unit_quaternions(orientation, layout::ORIENTATION[0])?,
            orientation_d: table.unit_quaternions(orientation_d, layout::ORIENTATION_D[0])?,
            state: table.states,
            lines: table.lines,
            names: table.names,
            q,
            dq,
            tau,
            position,
            position_d,
            wrench,
            hand,
            hand_d,
            gauges,
            time,
            cycle,
            gaps,
            missing_samples,
            longest_gap,
        })
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.time.len()
    }

    /// True if there are no samples; a recording that was read is never empty.
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
    }

    pub(super) fn select(&self, keep: &[usize]) -> Recording {
        fn pick<T: Clone>(values: &[T], keep: &[usize]) -> Vec<T> {
            keep.iter().map(|index| values[*index].clone()).collect()
        }
        let time = pick(&self.time, keep);
        let cycle = self.cycle.as_ref().map(|values| pick(values, keep));
        let (gaps, missing_samples, longest_gap) = count_gaps(&time, cycle.as_deref());
        Recording {
            file: self.file.clone(),
            checksum: self.checksum,
            origin: self.origin.clone(),
            header_line: self.header_line,
            names: self.names.clone(),
            lines: pick(&self.lines, keep),
            state: self.state.as_ref().map(|values| pick(values, keep)),
            fault: self.fault.as_ref().map(|values| pick(values, keep)),
            phase: self.phase.as_ref().map(|values| pick(values, keep)),
            q: self.q.as_ref().map(|values| pick(values, keep)),
            dq: self.dq.as_ref().map(|values| pick(values, keep)),
            tau: self.tau.as_ref().map(|values| pick(values, keep)),
            position: self.position.as_ref().map(|values| pick(values, keep)),
            orientation: self.orientation.as_ref().map(|values| pick(values, keep)),
            position_d: self.position_d.as_ref().map(|values| pick(values, keep)),
            orientation_d: self.orientation_d.as_ref().map(|values| pick(values, keep)),
            wrench: self.wrench.as_ref().map(|values| pick(values, keep)),
            hand: self.hand.as_ref().map(|values| pick(values, keep)),
            hand_d: self.hand_d.as_ref().map(|values| pick(values, keep)),
            gauges: self.gauges.as_ref().map(|values| pick(values, keep)),
            flags: self.flags.as_ref().map(|values| pick(values, keep)),
            surprise: self.surprise.as_ref().map(|values| pick(values, keep)),
            time,
            cycle,
            gaps,
            missing_samples,
            longest_gap,
        }
    }

    /// The place of one sample in the file, in the column of this name.
    pub fn place(&self, sample: usize, name: &str) -> Place {
        Place {
            file: self.file.clone(),
            line: self.lines.get(sample).copied().unwrap_or_default(),
            column: self.names.iter().position(|known| known == name).map_or(1, |column| column + 1),
            name: name.to_owned(),
        }
    }
}

/// Short: a recording has ten thousands of numbers, and nobody reads them in a message.
impl std::fmt::Debug for Recording {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("Recording")
            .field("file", &self.file)
            .field("samples", &self.len())
            .field("gaps", &self.gaps)
            .finish_non_exhaustive()
    }
}

/// CRC-32/ISCSI of a file's bytes, the same polynomial that guards the link and the primitive image.
pub fn checksum(bytes: &[u8]) -> u32 {
    link::frame::CRC.checksum(bytes)
}

/// The notes before the header, without their sign. A spreadsheet puts a mark of UTF-8 before the first one, and blank
/// lines may stand between them.
pub fn notes(bytes: &[u8]) -> Vec<String> {
    let bytes = input_file::with_newlines(bytes);
    let lines = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(&bytes).split(|byte| *byte == b'\n');
    let filled = lines.filter(|line| !line.trim_ascii().is_empty());
    let notes = filled.map_while(|line| line.strip_prefix(b"#"));
    notes.map(|note| String::from_utf8_lossy(note).trim().to_owned()).collect()
}

/// Number of gaps, samples missing in them, and the longest step with the index of its later end.
fn count_gaps(time: &[f64], cycle: Option<&[u32]>) -> (usize, usize, (f64, usize)) {
    let steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted: Vec<f64> = steps.iter().copied().filter(|step| *step >= SHORTEST_PERIOD).collect();
    sorted.sort_by(f64::total_cmp);
    let typical = sorted.get(sorted.len() / 2).copied().unwrap_or(f64::INFINITY);
    let longest = steps.iter().enumerate().fold(
        (0.0, 0),
        |best, (index, step)| {
            if *step > best.0 { (*step, index + 1) } else { best }
        },
    );
    let lost = |index: usize| -> usize {
        match cycle {
            // The counter knows exactly what is missing; time only lets one guess.
            Some(cycle) => match cycle[index + 1].wrapping_sub(cycle[index]) {
                // A counter that begins anew, of another device or after a restart, tells nothing.
                steps if steps > u32::MAX / 2 => 0,
                steps => (steps as usize).saturating_sub(1),
            },
            None if steps[index] > GAP_FACTOR * typical => {
                ((steps[index] / typical).round() as usize).saturating_sub(1)
            }
            None => 0,
        }
    };
    let losses: Vec<usize> = (0..steps.len()).map(lost).filter(|count| *count > 0).collect();
    (losses.len(), losses.iter().sum(), longest)
}

/// The numbers of a file with the names of their columns.
struct Table<'a> {
    file: &'a Path,
    header_line: u64,
    names: Vec<String>,
    known: Vec<bool>,
    lines: Vec<u64>,
    rows: Vec<Vec<f64>>,
    states: Option<Vec<String>>,
}

impl<'a> Table<'a> {
    fn parse(file: &'a Path, bytes: &[u8]) -> Result<Table<'a>, RecordingError> {
        if let Some(zero) = bytes.iter().position(|byte| *byte == 0) {
            let before = bytes.iter().take(zero).filter(|byte| **byte == b'\n').count();
            return Err(RecordingError::NotText { file: file.to_owned(), line: before as u64 + 1 });
        }
        let is_cut = !matches!(bytes.last(), Some(b'\n' | b'\r'));
        let cut = is_cut.then(|| bytes.iter().filter(|byte| **byte == b'\n').count() as u64 + 1);
        let unfinished = |line| RecordingError::Unfinished { file: file.to_owned(), line };
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .flexible(true)
            .has_headers(false)
            .trim(csv::Trim::All)
            .from_reader(bytes);
        let (names, known, lines, rows) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut table = Table { file, header_line: 0, names, known, lines, rows, states: None };
        let mut record = csv::ByteRecord::new();
        let mut newlines = Newlines::new(bytes);
        loop {
            match reader.read_byte_record(&mut record) {
                Ok(true) => {}
                Ok(false) => break,
                Err(cause) => {
                    return Err(RecordingError::Unreadable { file: file.to_owned(), cause: cause.into() });
                }
            }
            // The reader's own line is that of the last byte it skipped, notes included: count from the offset.
            let offset = record.position().map_or(0, csv::Position::byte);
            let line = newlines.line_at(offset as usize);
            if record.len() == 1 && record.iter().all(<[u8]>::is_empty) {
                // A line of spaces is as empty as one without.
                continue;
            }
            if table.names.is_empty() {
                table.read_header(line, &record)?;
            } else {
                // What is wrong with a line that was cut is that.
                table.read_row(line, &record).map_err(|wrong| match cut {
                    Some(cut) if cut == line && table.is_ours() => unfinished(cut),
                    _ => wrong,
                })?;
            }
        }
        if table.names.is_empty() {
            return Err(RecordingError::Empty { file: file.to_owned() });
        }
        match cut {
            Some(line) if table.is_ours() => Err(unfinished(line)),
            _ => Ok(table),
        }
    }

    /// True if the columns are those of our recordings, which end every line. Others often do not end the last one.
    fn is_ours(&self) -> bool {
        layout::header().iter().eq(self.names.iter())
    }

    fn read_header(&mut self, line: u64, record: &csv::ByteRecord) -> Result<(), RecordingError> {
        self.header_line = line;
        if let Some(found) = other_separator(record) {
            return Err(RecordingError::Separator { file: self.file.to_owned(), line, found });
        }
        for (index, field) in record.iter().enumerate() {
            let name = String::from_utf8_lossy(field).trim_start_matches('\u{feff}').to_owned();
            let place = Place { file: self.file.to_owned(), line, column: index + 1, name: name.clone() };
            // Spreadsheets end lines with commas: columns without a name mean nothing.
            if !name.is_empty() && self.names.contains(&name) {
                return Err(RecordingError::DuplicateColumn { place });
            }
            if let Some(expected) = layout::intended(&name) {
                return Err(RecordingError::WrongUnit { place, expected });
            }
            self.known.push(layout::is_known(&name));
            self.names.push(name);
        }
        if !self.known.contains(&true) {
            return Err(RecordingError::NoColumns { file: self.file.to_owned(), line });
        }
        if self.names.iter().any(|name| name == layout::STATE) {
            self.states = Some(Vec::new());
        }
        Ok(())
    }

    fn read_row(&mut self, line: u64, record: &csv::ByteRecord) -> Result<(), RecordingError> {
        let place = |column: usize, names: &[String]| Place {
            file: self.file.to_owned(),
            line,
            column: column + 1,
            name: names.get(column).cloned().unwrap_or_default(),
        };
        if record.len() != self.names.len() {
            return Err(RecordingError::Ragged {
                place: place(record.len().min(self.names.len()), &self.names),
                found: record.len(),
                expected: self.names.len(),
            });
        }
        let mut row = Vec::with_capacity(record.len());
        for (column, field) in record.iter().enumerate() {
            let text = String::from_utf8_lossy(field);
            if self.names[column] == layout::STATE {
                if !layout::is_state(&text) {
                    let (place, text) = (place(column, &self.names), text.chars().take(40).collect());
                    return Err(RecordingError::UnknownState { place, text });
                }
                if let Some(states) = &mut self.states {
                    states.push(text.into_owned());
                }
                row.push(0.0);
                continue;
            }
            if !self.known[column] {
                // Whatever others note beside our columns: never looked at.
                row.push(f64::NAN);
                continue;
            }
            let value: f64 = text.parse().map_err(|_| RecordingError::NotANumber {
                place: place(column, &self.names),
                text: text.chars().take(40).collect(),
            })?;
            if !value.is_finite() {
                return Err(RecordingError::NotFinite { place: place(column, &self.names), value });
            }
            if value.abs() > LARGEST_VALUE {
                return Err(RecordingError::TooLarge { place: place(column, &self.names), value });
            }
            row.push(value);
        }
        self.lines.push(line);
        self.rows.push(row);
        Ok(())
    }

    fn column(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|known| known == name)
    }

    /// Time of each sample, s, strictly increasing; refuses a file without columns that it needs, or with few samples.
    fn time(&self, missing: &[String]) -> Result<Vec<f64>, RecordingError> {
        let (Some(column), true) = (self.column(layout::TIME), missing.is_empty()) else {
            return Err(RecordingError::MissingColumns {
                file: self.file.to_owned(),
                line: self.header_line,
                column: self.names.len() + 1,
                missing: missing.join(", "),
            });
        };
        if self.rows.len() < FEWEST_SAMPLES {
            return Err(RecordingError::TooFewSamples {
                file: self.file.to_owned(),
                line: self.lines.last().copied().unwrap_or(self.header_line),
                found: self.rows.len(),
                needed: FEWEST_SAMPLES,
            });
        }
        let time: Vec<f64> = self.rows.iter().map(|row| row[column]).collect();
        match time.windows(2).position(|pair| pair[1] <= pair[0]) {
            None => Ok(time),
            Some(index) => Err(RecordingError::TimeRunsBackwards {
                place: self.place(index + 1, column),
                time: time[index + 1],
                before: time[index],
            }),
        }
    }

    /// The columns of a group; `None` if the header has none of them. If it has some, the others go to `missing`.
    fn vectors<const SIZE: usize>(
        &self,
        names: &[impl AsRef<str>; SIZE],
        missing: &mut Vec<String>,
    ) -> Option<Vec<[f64; SIZE]>> {
        let columns: [Option<usize>; SIZE] = std::array::from_fn(|index| self.column(names[index].as_ref()));
        if columns.iter().all(Option::is_none) {
            return None;
        }
        let absent = names.iter().zip(columns).filter(|(_, column)| column.is_none());
        missing.extend(absent.map(|(name, _)| name.as_ref().to_owned()));
        // An incomplete group is refused by its missing names.
        Some(self.rows.iter().map(|row| columns.map(|column| column.map_or(f64::NAN, |column| row[column]))).collect())
    }

    /// Unit quaternions with continuous signs; `first` names their first column.
    fn unit_quaternions(
        &self,
        values: Option<Vec<[f64; 4]>>,
        first: &str,
    ) -> Result<Option<Vec<[f64; 4]>>, RecordingError> {
        let Some(mut values) = values else { return Ok(None) };
        for (index, value) in values.iter_mut().enumerate() {
            let norm = value.iter().map(|part| part * part).sum::<f64>().sqrt();
            if (norm - 1.0).abs() > QUATERNION_NORM_TOLERANCE {
                let place = self.place(index, self.column(first).unwrap_or_default());
                return Err(RecordingError::NotAUnitQuaternion { place, norm });
            }
            for part in value {
                *part /= norm;
            }
        }
        make_sign_continuous(&mut values);
        Ok(Some(values))
    }

    fn numbers(&self, name: &str) -> Option<Vec<f64>> {
        let column = self.column(name)?;
        Some(self.rows.iter().map(|row| row[column]).collect())
    }

    fn whole_numbers(&self, name: &str) -> Result<Option<Vec<u32>>, RecordingError> {
        let Some(column) = self.column(name) else { return Ok(None) };
        let values = self.rows.iter().enumerate().map(|(index, row)| {
            let value = row[column];
            if value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value) {
                Ok(value as u32)
            } else {
                Err(RecordingError::NotANumber { place: self.place(index, column), text: format!("{value}") })
            }
        });
        values.collect::<Result<_, _>>().map(Some)
    }

    fn place(&self, sample: usize, column: usize) -> Place {
        Place {
            file: self.file.to_owned(),
            line: self.lines[sample],
            column: column + 1,
            name: self.names[column].clone(),
        }
    }
}

/// The separator of the columns of a header that is no comma, in words.
fn other_separator(header: &csv::ByteRecord) -> Option<&'static str> {
    let known = |name: &str| layout::is_known(name.trim_start_matches('\u{feff}').trim());
    let fields: Vec<_> = header.iter().map(String::from_utf8_lossy).collect();
    if fields.iter().any(|field| known(field)) {
        return None;
    }
    let separates = |separator: char| fields.iter().any(|field| field.split(separator).any(known));
    let names = [(';', "semicolons"), ('\t', "tabs"), (' ', "spaces")];
    names.into_iter().find(|(separator, _)| separates(*separator)).map(|(_, name)| name)
}

/// Turns each quaternion to the side of the one before it: q and -q are the same orientation, a jump between them
/// would be differentiated into an angular velocity of hundreds of rad/s.
pub fn make_sign_continuous(quaternions: &mut [[f64; 4]]) {
    for index in 1..quaternions.len() {
        let before = quaternions[index - 1];
        let dot: f64 = before.iter().zip(&quaternions[index]).map(|(a, b)| a * b).sum();
        if dot < 0.0 {
            quaternions[index] = quaternions[index].map(|part| -part);
        }
    }
}

/// Line numbers for increasing byte offsets.
struct Newlines<'a> {
    bytes: &'a [u8],
    offset: usize,
    line: u64,
}

impl<'a> Newlines<'a> {
    fn new(bytes: &'a [u8]) -> Newlines<'a> {
        Newlines { bytes, offset: 0, line: 1 }
    }

    /// The line of the record that starts at or behind `offset`: notes and blank lines before it are passed over.
    fn line_at(&mut self, offset: usize) -> u64 {
        self.advance_to(offset);
        loop {
            let rest = &self.bytes[self.offset..];
            let end = rest.iter().position(|byte| *byte == b'\n');
            let text = &rest[..end.unwrap_or(rest.len())];
            let skipped = text.first() == Some(&b'#') || text.iter().all(|byte| *byte == b'\r');
            match end {
                Some(end) if skipped => self.advance_to(self.offset + end + 1),
                _ => return self.line,
            }
        }
    }

    fn advance_to(&mut self, offset: usize) {
        let offset = offset.clamp(self.offset, self.bytes.len());
        let passed = &self.bytes[self.offset..offset];
        self.line += passed.iter().filter(|byte| **byte == b'\n').count() as u64;
        self.offset = offset;
    }
}
