//! Recordings: what is wrong is named with file, line and column; what is right comes back as it was.

use std::path::Path;

use control::time::periods;
use lab::demonstration::{Demonstration, DemonstrationError, Preparation, Recording, RecordingError, layout};

use crate::common;

const FILE: &str = "folder/demo.csv";

/// Reads a file of these lines, the last one with its end.
fn parse(text: &str) -> Result<Recording, RecordingError> {
    Recording::parse(Path::new(FILE), format!("{text}\n").as_bytes())
}

/// The lines of a good recording; line numbers in the tests count from 1, the header is line 2.
fn good() -> Vec<String> {
    common::text(&common::rows(2.0)).lines().map(String::from).collect()
}

fn column(name: &str) -> usize {
    layout::header().iter().position(|known| *known == name).expect("a column of the layout")
}

/// Replaces one field; `line` and the column as people count them.
fn with_field(line: usize, name: &str, value: &str) -> String {
    let mut lines = good();
    let mut fields: Vec<&str> = lines[line - 1].split(',').collect();
    fields[column(name)] = value;
    lines[line - 1] = fields.join(",");
    lines.join("\n")
}

/// Asserts that the message names the file, the line and the column.
fn names(error: &impl std::fmt::Display, line: u64, column: usize) {
    let text = error.to_string();
    assert!(text.contains(FILE), "{text}");
    assert!(text.contains(&format!("line {line}, column {column}")), "{text}");
}

#[test]
fn nan_is_refused_with_its_place() {
    let error = parse(&with_field(40, "q3_rad", "NaN")).unwrap_err();
    assert!(matches!(error, RecordingError::NotFinite { .. }), "{error}");
    names(&error, 40, column("q3_rad") + 1);
    assert!(error.to_string().contains("(q3_rad)"));
}

#[test]
fn infinity_is_refused_with_its_place() {
    let error = parse(&with_field(41, "fx_N", "inf")).unwrap_err();
    assert!(matches!(error, RecordingError::NotFinite { .. }), "{error}");
    names(&error, 41, column("fx_N") + 1);
}

/// Guards `plot` and `report`, which drew a flat line beside a value with a damaged exponent.
#[test]
fn a_value_that_nothing_measures_is_refused_with_its_place_and_a_large_one_is_not() {
    for value in ["1e300", "-1.2e13"] {
        let error = parse(&with_field(42, "q1_rad", value)).unwrap_err();
        assert!(matches!(error, RecordingError::TooLarge { .. }), "{error}");
        names(&error, 42, column("q1_rad") + 1);
    }
    assert!(parse(&with_field(42, "dq1_rad_s", "2e9")).is_ok());
}

#[test]
fn text_in_a_number_is_refused_with_its_place() {
    let error = parse(&with_field(7, "x_m", "0.3m")).unwrap_err();
    assert!(matches!(error, RecordingError::NotANumber { .. }), "{error}");
    names(&error, 7, column("x_m") + 1);
    let error = parse(&with_field(8, "tau2_Nm", "")).unwrap_err();
    names(&error, 8, column("tau2_Nm") + 1);
}

#[test]
fn a_column_that_is_nobodys_may_hold_text_and_gaps_and_is_ignored() {
    let lines = good();
    let with = |index: usize, line: &String| {
        let field = ["# a note", "operator", "a, b", "nan", ""];
        match line.starts_with('#') {
            true => line.clone(),
            false => format!("{line},\"{}\"", field[index.min(4)]),
        }
    };
    let text: Vec<String> = lines.iter().enumerate().map(|(index, line)| with(index, line)).collect();
    let (plain, noted) = (parse(&lines.join("\n")).unwrap(), parse(&text.join("\n")).unwrap());
    assert_eq!((plain.time, plain.q), (noted.time, noted.q));
}

#[test]
fn commas_at_the_end_of_every_line_are_columns_of_nobody() {
    let text: Vec<String> = good()[1..].iter().map(|line| format!("{line},,")).collect();
    assert_eq!(parse(&text.join("\n")).unwrap().q, parse(&good().join("\n")).unwrap().q);
}

#[test]
fn a_mark_of_utf_8_and_blank_lines_do_not_hide_the_movement_that_a_recording_names() {
    let text = format!("# Tactus recording\n# primitive: reach 0x0a1b2c3d\n{}", good()[1..].join("\n"));
    let named = parse(&text).unwrap().origin;
    assert_eq!(named.primitive.as_ref().unwrap().movement, 0x0a1b_2c3d);
    for changed in [format!("\u{feff}{text}"), format!("\r\n{text}"), text.replace("# primitive", "\n# primitive")] {
        assert_eq!(parse(&changed).unwrap().origin, named, "{}", &changed[..60]);
    }
}

/// The change that makes it fail: `input_file::with_newlines` gives the bytes as they are.
#[test]
fn a_recording_whose_lines_end_in_carriage_returns_alone_is_read_with_its_notes_and_lines() {
    let lines = format!("# primitive: reach 0x0a1b2c3d\n{}\n", good().join("\n"));
    let [usual, returns] = [lines.clone(), lines.replace('\n', "\r")].map(|text| {
        let read = Recording::parse(Path::new(FILE), text.as_bytes()).unwrap();
        (read.origin.primitive.map(|played| played.name), read.lines, read.time)
    });
    assert!(usual.0.as_deref() == Some("reach") && usual == returns);
    let wrong = lines.replace(&good()[20], "1,2").replace('\n', "\r");
    names(&Recording::parse(Path::new(FILE), wrong.as_bytes()).unwrap_err(), 22, 3);
}

/// The change that makes it fail: any word is taken for a state.
#[test]
fn a_word_that_names_no_state_is_refused_with_its_place() {
    let error = parse(&with_field(40, "state", "runn")).unwrap_err();
    assert!(matches!(error, RecordingError::UnknownState { .. }), "{error}");
    names(&error, 40, column("state") + 1);
    assert!(error.to_string().contains("`runn` is no state, expected `idle`, `gravity`"), "{error}");
    for state in control::State::ALL.map(control::State::name).into_iter().chain(["unknown"]) {
        assert!(parse(&with_field(40, "state", state)).is_ok(), "{state}");
    }
}

#[test]
fn time_that_runs_backwards_or_stands_still_is_refused_with_its_place() {
    let before = good()[50].split(',').nth(column("t_s")).expect("a time").to_owned();
    for time in ["0.01", &before] {
        let error = parse(&with_field(52, "t_s", time)).unwrap_err();
        assert!(matches!(error, RecordingError::TimeRunsBackwards { .. }), "{error}");
        names(&error, 52, column("t_s") + 1);
    }
}

#[test]
fn missing_columns_are_named() {
    let text: Vec<String> = good()
        .into_iter()
        .map(|line| {
            if line.starts_with('#') {
                return line;
            }
            let mut fields: Vec<&str> = line.split(',').collect();
            fields.remove(column("q4_rad"));
            fields.join(",")
        })
        .collect();
    let error = parse(&text.join("\n")).unwrap_err();
    assert!(matches!(error, RecordingError::MissingColumns { .. }), "{error}");
    assert!(error.to_string().contains("q4_rad"), "{error}");
    names(&error, 2, layout::header().len());
    let error = parse("x_m,y_m,z_m\n0,0,0\n").unwrap_err().to_string();
    assert!(error.contains("t_s") && error.contains("line 1"), "{error}");
    let error = parse("t_s,x_m,y_m,z_m\n0,0,0,0\n").unwrap_err().to_string();
    assert!(error.contains("qw, qx, qy, qz"), "{error}");
}

#[test]
fn a_known_quantity_in_another_unit_is_refused() {
    let text = good().join("\n").replacen("q2_rad", "q2_deg", 1);
    let error = parse(&text).unwrap_err();
    assert!(matches!(error, RecordingError::WrongUnit { .. }), "{error}");
    names(&error, 2, column("q2_rad") + 1);
    assert!(error.to_string().contains("expected `q2_rad`"), "{error}");
}

#[test]
fn a_column_given_twice_is_refused() {
    let text = good().join("\n").replacen("dq1_rad_s", "q1_rad", 1);
    let error = parse(&text).unwrap_err();
    assert!(matches!(error, RecordingError::DuplicateColumn { .. }), "{error}");
    names(&error, 2, column("dq1_rad_s") + 1);
}

#[test]
fn a_quaternion_that_is_no_unit_is_refused_with_its_place() {
    let error = parse(&with_field(90, "qw", "1.2")).unwrap_err();
    assert!(matches!(error, RecordingError::NotAUnitQuaternion { .. }), "{error}");
    names(&error, 90, column("qw") + 1);
    let error = parse(&with_field(91, "qw_d", "-0.9")).unwrap_err();
    names(&error, 91, column("qw_d") + 1);
}

#[test]
fn ragged_lines_are_refused_with_their_place() {
    let columns = layout::header().len();
    let mut lines = good();
    lines[9].push_str(",7");
    let error = parse(&lines.join("\n")).unwrap_err();
    assert!(matches!(error, RecordingError::Ragged { .. }), "{error}");
    names(&error, 10, columns + 1);
    let mut lines = good();
    let cut = lines[10].rfind(',').expect("several fields");
    lines[10].truncate(cut);
    names(&parse(&lines.join("\n")).unwrap_err(), 11, columns);
}

#[test]
fn a_file_that_was_cut_within_its_last_number_is_told_and_not_read_with_another_value() {
    let (whole, last) = (good().join("\n"), good().len() as u64);
    let cut = [(whole.clone(), last), (whole[..whole.len() - 1].to_owned(), last), (format!("{whole}\n0"), last + 1)];
    for (text, line) in cut {
        let error = Recording::parse(Path::new(FILE), text.as_bytes()).unwrap_err();
        assert!(matches!(error, RecordingError::Unfinished { line: found, .. } if found == line), "{error}");
        assert!(error.to_string().contains(&format!("{FILE}: line {line}")), "{error}");
    }
    // The change that makes it fail: every file has to end its last line. Spreadsheets do not.
    let joints = "q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad,q7_rad";
    let rows: Vec<String> = (0..100).map(|row| format!("{},0,0.6,0,1.6,0,0.2,0.01", f64::from(row) * 0.004)).collect();
    let of_others = format!("t_s,{joints}\n{}", rows.join("\n"));
    assert_eq!(Recording::parse(Path::new(FILE), of_others.as_bytes()).expect("a whole file").time.len(), 100);
    for end in ["\r\n", "\r"] {
        let whole = good()[1..].join(end) + end;
        assert!(Recording::parse(Path::new(FILE), whole.as_bytes()).is_ok(), "{end:?}");
    }
}

#[test]
fn a_file_with_other_separators_is_told_which_it_has() {
    for (separator, name) in [(";", "semicolons"), ("\t", "tabs")] {
        let error = parse(&good().join("\n").replace(',', separator)).unwrap_err();
        assert!(matches!(error, RecordingError::Separator { line: 2, .. }), "{error}");
        assert!(error.to_string().contains(name) && error.to_string().contains(FILE), "{error}");
    }
    // A column of nobody may have any name.
    let noted = good().join("\n").replacen("cycle,", "a;b,", 1);
    assert!(parse(&noted).is_ok());
}

#[test]
fn a_file_of_another_kind_is_told_as_such_and_not_by_its_second_line() {
    for text in ["schema = \"tactus-primitive/1\"\nname = \"reach\"\n[a]\nb = [1, 2]", "{\"a\": 1}", "time,speed\n0,1"]
    {
        let error = parse(text).unwrap_err();
        assert!(matches!(error, RecordingError::NoColumns { line: 1, .. }), "{error}");
        assert!(error.to_string().contains("no recording"), "{error}");
    }
}

#[test]
fn too_few_samples_are_refused() {
    let text = good()[..50].join("\n");
    let error = parse(&text).unwrap_err();
    assert!(matches!(error, RecordingError::TooFewSamples { found: 48, .. }), "{error}");
    names(&error, 50, 1);
    let error = parse(&good()[..2].join("\n")).unwrap_err();
    assert!(matches!(error, RecordingError::TooFewSamples { found: 0, .. }), "{error}");
}

#[test]
fn empty_files_and_folders_are_refused() {
    for text in ["", "\n\n", "# only a note\n"] {
        let error = parse(text).unwrap_err();
        assert!(matches!(error, RecordingError::Empty { .. }), "{error}");
        names(&error, 1, 1);
    }
    let error = Recording::read(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap_err();
    assert!(matches!(error, RecordingError::Unreadable { .. }), "{error}");
}

#[test]
fn a_file_in_utf_16_or_packed_is_called_so_and_not_a_wrong_count_of_columns() {
    let text = "# a note\nt_s,q1_rad\n0,1\n";
    let wide: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let mut packed = text.as_bytes().to_vec();
    packed.insert(14, 0);
    for (bytes, line) in [(wide, 1), (packed, 2)] {
        let error = Recording::parse(Path::new("a.csv"), &bytes).unwrap_err();
        assert!(matches!(error, RecordingError::NotText { line: found, .. } if found == line), "{error}");
    }
}

#[test]
fn bytes_that_are_no_text_are_refused_and_never_panic() {
    let mut state = 1_u32;
    for length in [10, 1000, 20_000] {
        let bytes: Vec<u8> = (0..length)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 24) as u8
            })
            .collect();
        let error = Recording::parse(Path::new(FILE), &bytes).unwrap_err();
        assert!(error.to_string().contains(FILE), "{error}");
    }
}

#[test]
fn notes_and_blank_lines_do_not_shift_line_numbers() {
    let mut lines = good();
    lines.insert(20, "# a note in the middle".to_owned());
    lines.insert(21, String::new());
    // What was line 40 is now line 42.
    let mut fields: Vec<&str> = lines[41].split(',').collect();
    fields[column("q1_rad")] = "x";
    lines[41] = fields.join(",");
    names(&parse(&lines.join("\n")).unwrap_err(), 42, column("q1_rad") + 1);
    // Line ends of another system.
    names(&parse(&lines.join("\r\n")).unwrap_err(), 42, column("q1_rad") + 1);
    // An editor leaves spaces in a line that looks empty.
    lines[20] = "  ".to_owned();
    lines.push("   \n".to_owned());
    names(&parse(&lines.join("\n")).unwrap_err(), 42, column("q1_rad") + 1);
    lines[41] = good()[39].clone();
    assert_eq!(parse(&lines.join("\n")).unwrap().len(), parse(&good().join("\n")).unwrap().len());
}

#[test]
fn what_was_written_is_read() {
    let rows = common::rows(2.0);
    let recording = parse(&common::text(&rows)).unwrap();
    assert_eq!(recording.len(), rows.len());
    assert_eq!((recording.gaps, recording.missing_samples), (0, 0));
    for (index, row) in rows.iter().enumerate() {
        assert_eq!(recording.time[index], row.time);
        assert_eq!(recording.cycle.as_ref().unwrap()[index], row.telemetry.cycle);
        assert_eq!(recording.state.as_ref().unwrap()[index], row.state());
        assert_eq!(recording.q.as_ref().unwrap()[index].map(|value| value as f32), row.telemetry.q);
        assert_eq!(recording.dq.as_ref().unwrap()[index].map(|value| value as f32), row.telemetry.dq);
        assert_eq!(recording.tau.as_ref().unwrap()[index].map(|value| value as f32), row.telemetry.tau);
        assert_eq!(recording.wrench.as_ref().unwrap()[index].map(|value| value as f32), row.telemetry.wrench);
        assert_eq!(recording.position.as_ref().unwrap()[index], row.pose[..3]);
        assert_eq!(recording.lines[index], index as u64 + 3);
    }
}

#[test]
fn recordings_of_the_time_before_the_hand_are_read() {
    let old = layout::header().iter().position(|name| *name == layout::HAND[0]).unwrap();
    let cut: Vec<String> =
        good()
            .iter()
            .map(|line| {
                if line.starts_with('#') {
                    line.clone()
                } else {
                    line.split(',').take(old).collect::<Vec<_>>().join(",")
                }
            })
            .collect();
    let recording = parse(&cut.join("\n")).unwrap();
    assert!(recording.hand.is_none() && recording.gauges.is_none() && recording.surprise.is_none());
    assert!(recording.wrench.is_some() && recording.flags.is_some());
    let now = parse(&good().join("\n")).unwrap();
    assert_eq!(now.hand.unwrap()[0], [0.0, 0.25, 0.5, 0.75]);
    assert_eq!(now.hand_d.unwrap()[0], [0.0, 0.25, 0.5, 1.0]);
    assert_eq!(now.gauges.unwrap()[0], [0.0, -0.5, 0.125]);
    assert_eq!(now.surprise.unwrap()[0], 1.5);
}

#[test]
fn cli_8_lost_samples_are_counted_by_the_cycle_counter_and_by_time() {
    let mut rows = common::rows(2.0);
    rows.drain(100..103);
    rows.drain(200..201);
    let recording = parse(&common::text(&rows)).unwrap();
    assert_eq!((recording.gaps, recording.missing_samples), (2, 4));
    // The same without the counter.
    let text = common::foreign(1.0);
    let mut lines: Vec<&str> = text.lines().collect();
    lines.drain(300..305);
    let recording = parse(&lines.join("\n")).unwrap();
    assert_eq!((recording.gaps, recording.missing_samples), (1, 5));
}

/// Seen: an addition that overflowed, and 18446744073709551614 missing samples.
///
/// The change that makes it fail: a typical step of two lines of the same sample.
#[test]
fn lines_that_are_the_same_sample_twice_hide_no_samples_between_the_others() {
    let text = common::foreign(1.0);
    let (head, samples): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| line.starts_with(['#', 't']));
    let of = |times: &dyn Fn(usize) -> Vec<String>| {
        let lines = samples.iter().enumerate().flat_map(|(index, line)| {
            let (_, rest) = line.split_once(',').unwrap();
            times(index).into_iter().map(move |time| format!("{time},{rest}"))
        });
        let text = format!("{}\n{}", head.join("\n"), lines.collect::<Vec<_>>().join("\n"));
        let recording = parse(&text).unwrap();
        (recording.gaps, recording.missing_samples)
    };
    let shown = |index: usize| index as f64 / 300.0;
    assert_eq!(of(&|index| (0..3).map(|nth| format!("{:.9}", shown(index) + f64::from(nth) * 1e-9)).collect()), (0, 0));
    let tiny = |index: usize| if index < 800 { index as f64 * 1e-300 } else { shown(index - 799) };
    assert_eq!(of(&|index| vec![format!("{:e}", tiny(index))]), (0, 0));
}

#[test]
fn a_counter_that_begins_anew_is_no_gap_of_four_thousand_million_samples() {
    let mut rows = common::rows(2.0);
    rows.iter_mut().skip(300).enumerate().for_each(|(index, row)| row.telemetry.cycle = index as u32);
    let recording = parse(&common::text(&rows)).unwrap();
    assert_eq!((recording.gaps, recording.missing_samples), (0, 0));
}

#[test]
fn a_gap_that_hides_movement_is_refused_with_its_place() {
    let mut rows = common::rows(2.0);
    let begin = usize::from(periods(1.0 / 3.0));
    rows.drain(begin..begin + usize::from(periods(0.133)));
    let recording = parse(&common::text(&rows)).unwrap();
    let error = Demonstration::prepare(&recording, &Preparation::default()).unwrap_err();
    assert!(matches!(error, DemonstrationError::Recording(RecordingError::GapTooLong { .. })), "{error}");
    names(&error, begin as u64 + 3, column("t_s") + 1);
}

#[test]
fn ten_samples_a_second_are_no_gap_and_the_place_of_one_is_told_wherever_the_time_stands() {
    let lines: Vec<String> = common::rows(9.0)
        .iter()
        .step_by(30)
        .enumerate()
        .map(|(index, row)| {
            let q: Vec<String> = row.telemetry.q.iter().map(ToString::to_string).collect();
            format!("{},{}.{}", q.join(","), index / 10, index % 10)
        })
        .collect();
    let header = "q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad,q7_rad,t_s";
    let prepared = |lines: &[String]| {
        let recording = parse(&format!("{header}\n{}", lines.join("\n"))).unwrap();
        Demonstration::prepare(&recording, &Preparation::default())
    };
    assert!(prepared(&lines).is_ok(), "{:?}", prepared(&lines).err());
    let error = prepared(&[&lines[..40], &lines[41..]].concat()).unwrap_err();
    names(&error, 42, 8);
}

#[test]
fn rest_before_and_behind_the_movement_is_cut_off() {
    let recording = parse(&common::text(&common::rows(3.0))).unwrap();
    let trimmed = Demonstration::prepare(&recording, &Preparation::default()).unwrap();
    let (before, behind) = trimmed.trimmed;
    assert!((0.2..0.6).contains(&before) && (0.2..0.6).contains(&behind), "{before} {behind}");
    assert!((before + behind + trimmed.duration() - 4.0).abs() < 1e-9);
    let whole = Demonstration::prepare(&recording, &Preparation { still_speed: None }).unwrap();
    assert_eq!(whole.len(), recording.len());
}

#[test]
fn an_arm_that_does_not_move_is_no_demonstration() {
    let mut rows = common::rows(2.0);
    let first = rows[0].clone();
    for row in &mut rows {
        (row.telemetry.q, row.pose) = (first.telemetry.q, first.pose);
    }
    let recording = parse(&common::text(&rows)).unwrap();
    let error = Demonstration::prepare(&recording, &Preparation::default()).unwrap_err();
    assert!(matches!(error, DemonstrationError::Still { .. }), "{error}");
    assert!(error.to_string().contains(FILE) && error.to_string().contains("lines 3 to"), "{error}");
}

#[test]
fn the_pose_comes_from_the_joint_angles_where_there_are_any() {
    let recording = parse(&common::text(&common::rows(2.0))).unwrap();
    let demonstration = Demonstration::prepare(&recording, &Preparation { still_speed: None }).unwrap();
    let index = 200;
    let (position, _) = lab::arm::tool_pose(&recording.q.as_ref().unwrap()[index]);
    for (computed, expected) in demonstration.position[index].iter().zip(position) {
        assert!((computed - expected).abs() < 1e-12);
    }
}

#[test]
fn other_rates_are_resampled_to_the_control_rate() {
    let text = common::foreign(1.0);
    // Every third sample: 100 Hz.
    let (head, samples): (Vec<_>, Vec<_>) = text.lines().enumerate().partition(|(index, _)| *index < 2);
    let thinned: Vec<&str> =
        head.iter().map(|(_, line)| *line).chain(samples.iter().step_by(3).map(|(_, line)| *line)).collect();
    let full = parse(&text).unwrap();
    let recording = parse(&thinned.join("\n")).unwrap();
    let preparation = Preparation { still_speed: None };
    let a = Demonstration::prepare(&full, &preparation).unwrap();
    let b = Demonstration::prepare(&recording, &preparation).unwrap();
    let samples = usize::from(periods(4.0)) + 1;
    assert_eq!((a.len(), b.len()), (samples, samples));
    for (a, b) in a.position.iter().zip(&b.position) {
        for axis in 0..3 {
            assert!((a[axis] - b[axis]).abs() < 2e-5, "{a:?} {b:?}");
        }
    }
}

#[test]
fn quaternions_of_either_sign_give_the_same_demonstration() {
    let text = common::foreign(2.5);
    let flipped: Vec<String> = text
        .lines()
        .enumerate()
        .map(|(index, line)| {
            if index < 2 || index % 7 < 4 {
                return line.to_owned();
            }
            let mut fields: Vec<String> = line.split(',').map(String::from).collect();
            for field in &mut fields[4..8] {
                *field = (-field.parse::<f64>().unwrap()).to_string();
            }
            fields.join(",")
        })
        .collect();
    let preparation = Preparation { still_speed: None };
    let a = Demonstration::prepare(&parse(&text).unwrap(), &preparation).unwrap();
    let b = Demonstration::prepare(&parse(&flipped.join("\n")).unwrap(), &preparation).unwrap();
    for (a, b) in a.orientation.iter().zip(&b.orientation) {
        for part in 0..4 {
            assert!((a[part] - b[part]).abs() < 1e-12);
        }
    }
}

#[test]
fn the_layout_names_every_state_that_a_recording_can_hold() {
    let quantity = layout::LAYOUT.iter().find(|quantity| quantity.columns.contains(&layout::STATE)).unwrap();
    for state in control::State::ALL {
        assert!(quantity.meaning.contains(&format!("`{}`", state.name())), "{state}");
    }
}

#[test]
fn the_table_of_the_document_is_the_layout() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/recording-format.md");
    let document = std::fs::read_to_string(&path).unwrap();
    let head = "| columns | unit | meaning |\n|---|---|---|\n";
    let start = document.find(head).expect("the table") + head.len();
    let end = start + document[start..].find("\n\n").expect("its end") + 1;
    let row = |quantity: &layout::Quantity| {
        let columns = quantity.columns.iter().map(|column| format!("`{column}`")).collect::<Vec<_>>().join(", ");
        format!("| {columns} | {} | {} |\n", quantity.unit, quantity.meaning)
    };
    let table: String = layout::LAYOUT.iter().map(row).collect();
    if std::env::var_os("UPDATE_DOCUMENTS").is_some() {
        std::fs::write(&path, [&document[..start], &table, &document[end..]].concat()).unwrap();
    } else {
        assert_eq!(
            document[start..end],
            table,
            "UPDATE_DOCUMENTS=1 cargo test -p lab --test library recording:: mends it"
        );
    }
}
