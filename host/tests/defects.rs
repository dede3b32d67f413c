//! `docs/defects.md`: what a new user found wrong by trying the tool, and the tests that fail if it comes back.
//!
//! A test is named here by its function. After a change:
//! `UPDATE_DOCUMENTS=1 cargo test -p tactus --test command defects::`.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Found, and the tests that hold it mended.
const DEFECTS: &[(&str, &[&str])] = &[
    (
        "a refused or cancelled `teach` or `record` empties the file it was to write",
        &[
            "a_refused_teach_leaves_the_recording_that_it_was_to_replace",
            "a_full_disk_an_interrupt_and_a_kill_leave_what_existed_whole",
        ],
    ),
    (
        "`sim --listen unix:F` deletes any file F",
        &["h12_two_simulated_devices_do_not_share_a_flash_and_a_served_arm_takes_no_file_away"],
    ),
    (
        "`learn X -o X` replaces the demonstration",
        &["h14_an_output_that_is_an_input_a_device_or_a_folder_is_refused_even_when_forced"],
    ),
    (
        "`run --record` writes only at the end",
        &[
            "cli_8_a_killed_run_leaves_its_recording_beside_the_one_it_was_to_replace",
            "h14_what_was_recorded_before_a_signal_is_kept_and_named",
        ],
    ),
    (
        "`statistics`, `plot` and `compare` mix movements; recordings do not say where they come from",
        &[
            "recordings_say_where_they_come_from_and_no_command_mixes_movements",
            "a_run_by_its_name_in_the_device_is_a_run_of_the_file_that_was_uploaded",
        ],
    ),
    ("files are replaced unasked", &["no_command_replaces_a_file_unless_it_is_forced"]),
    (
        "a run that ends 220 mm beside its goal is a success",
        &["an_arm_that_ends_away_from_its_goal_has_missed_it_and_the_distance_is_told"],
    ),
    (
        "a goal out of reach is \"ready to run\"; `check` ignores goal and speed",
        &[
            "cli_5_a_goal_out_of_reach_is_refused_by_check_and_by_a_dry_run",
            "h4_a_goal_that_is_changed_is_checked_with_the_run",
        ],
    ),
    (
        "hand postures of 90 rad pass; \"a number in the request is out of range\"",
        &["a_hand_posture_out_of_its_range_is_refused_with_the_finger_and_the_range"],
    ),
    (
        "every primitive has the same image check sum",
        &["every_primitive_has_its_own_image_checksum_and_the_device_tells_the_same"],
    ),
    ("`can replay` says \"0 different\" after Ctrl-C", &["a_replay_that_is_interrupted_says_that_nothing_can_be_said"]),
    (
        "a change of speed or goal after the end is ignored",
        &["a_change_after_the_end_of_the_run_is_refused_before_anything_moves"],
    ),
    ("a fit error of 156 mm ends with 0", &["a_primitive_that_leaves_the_way_it_was_shown_is_not_written"]),
    (
        "unknown values are 0",
        &["a_figure_that_nobody_measured_is_null_and_not_zero", "what_is_not_known_is_null_for_a_script"],
    ),
    (
        "a full device cannot be emptied",
        &[
            "a_full_device_says_which_command_frees_a_place",
            "primitives_are_renamed_read_back_and_deleted_and_no_version_is_lost_unasked",
        ],
    ),
    (
        "`rehearse --speed 0.3` fails after 100 s for a reason known before",
        &["a_speed_whose_expectation_could_not_be_kept_is_refused_before_the_arm_moves"],
    ),
    (
        "`--figures-only` teaches first; a torn results file cannot be resumed",
        &[
            "figures_only_draws_results_that_are_there_and_teaches_nothing",
            "an_experiment_goes_on_where_it_was_ended_even_in_the_middle_of_a_line",
        ],
    ),
    (
        "the stand-in cannot be calibrated after `hand init`",
        &["the_guides_stand_in_can_be_calibrated_after_its_hand_was_initialised"],
    ),
    ("`plot -r` of a gravity recording fails", &["a_recording_in_which_nothing_was_played_is_drawn_as_a_whole"]),
    ("a closed pipe and a full output are panics", &["a_closed_pipe_and_a_full_output_are_no_crash"]),
    ("names that are no Unicode are panics", &["names_that_are_no_unicode_are_written_and_reported"]),
    (
        "a full disk is an internal error, a missing file exit 6",
        &[
            "a_disk_that_fills_up_is_named_as_such_and_keeps_what_fits",
            "a_missing_file_is_a_wrong_command_line_and_the_reason_is_told",
        ],
    ),
    (
        "an interrupt delivered twice loses message and confirmation",
        &[
            "h14_what_was_recorded_before_a_signal_is_kept_and_named",
            "cli_3_a_second_interrupt_ends_a_run_whose_device_does_not_confirm_the_stop",
        ],
    ),
    (
        "nobody is told who uses the arm",
        &[
            "who_finds_the_device_busy_is_told_whose_it_is_and_since_when_but_not_the_number_of_the_session",
            "a_stored_primitive_runs_by_its_name_and_others_look_on_without_costing_it_a_cycle",
        ],
    ),
    ("help without examples, longer than a screen", &["every_help_fits_a_screen_and_has_examples_that_the_tool_takes"]),
    (
        "a recording that a fault ends does not show the fault",
        &["a_run_that_fails_is_kept_as_well_with_its_failure_and_what_was_recorded"],
    ),
    (
        "`teach` takes the end of standard input for Enter",
        &["a_demonstration_that_nobody_ends_is_no_success_and_what_was_recorded_is_kept"],
    ),
    (
        "one demonstration in ten cannot be learned: the arm creeps once it is let go",
        &["an_arm_that_creeps_away_once_it_is_let_go_is_cut_off_there_and_that_is_said"],
    ),
    (
        "a busy machine makes a served arm take its programs for silent",
        &["a_machine_that_was_late_makes_up_for_a_moment_and_no_more"],
    ),
    (
        "`calibrate gravity --reset` deletes the declared payload; the settings give a measured weight to another one",
        &[
            "g4_forgetting_a_weight_keeps_the_declared_payload_and_says_so",
            "g4_the_settings_do_not_give_a_measured_weight_to_another_payload",
        ],
    ),
    (
        "a wrong declaration is answered with \"check the pendant and the cables\"",
        &[
            "g4_a_declared_payload_is_kept_and_a_start_up_that_contradicts_it_is_blocked_with_the_reason",
            "g4_a_fault_that_a_wrong_declaration_keeps_from_being_cleared_is_answered_with_the_declaration",
            "every_reason_that_blocks_a_start_up_has_a_remedy_of_its_own",
        ],
    ),
    ("`rehearse` drops the statistics without a word", &["a_rehearsal_says_that_it_drops_the_statistics"]),
    ("`rename X X` advises to delete the only copy", &["a_primitive_is_not_renamed_to_its_own_name"]),
    ("`statistics` takes one recording three times for three runs", &["one_run_does_not_count_as_several"]),
    ("a folder hides the primitive of its name in the device", &["a_folder_does_not_hide_a_primitive_in_the_device"]),
    (
        "a refused run advises a check that passes, or a speed that was tried",
        &[
            "a_refused_run_advises_a_check_that_shows_the_same",
            "a_change_on_the_way_that_breaks_a_limit_is_named_with_its_time",
            "a_slower_run_is_advised_only_where_it_is_slower_and_can_help",
        ],
    ),
    (
        "advice that cannot be followed: to calibrate without end, to clear a fault that is gone, to show the movement \
         again where an option is to blame",
        &[
            "cli_15_an_arm_is_weighed_once_with_a_report_and_its_device_keeps_the_weight_over_a_restart",
            "a_fault_of_an_arm_that_ended_with_its_command_is_not_to_be_cleared",
            "an_option_that_is_to_blame_is_named_and_not_the_movement",
            "advice_names_commands_and_options_that_there_are",
        ],
    ),
    ("a flash that is not kept is told of 130 times", &["a_flash_that_is_not_kept_is_told_of_once"]),
    ("the lab guide shows a fault that does not come", &["a_fault_looks_as_the_lab_guide_shows"]),
    ("an arm that is served fast cannot be commanded", &["an_arm_that_is_served_fast_can_be_commanded"]),
];

const HEAD: &str = "\
# Defects of the command line tool

Who reads this: whoever changes the tool and wants to know what was wrong once. Written from `host/tests/defects.rs`;
change it there. Each was found by trying, and has tests that fail if it comes back.

| found | held by |
|---|---|
";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Names of the test functions of the tool, the library and the device.
fn tests(folder: &Path, names: &mut BTreeSet<String>) {
    for entry in folder.read_dir().unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            tests(&entry, names);
        } else if entry.extension().is_some_and(|extension| extension == "rs") {
            let text = std::fs::read_to_string(&entry).unwrap();
            let mut is_test = false;
            for line in text.lines().map(str::trim) {
                if let Some(rest) = line.strip_prefix("fn ").filter(|_| is_test) {
                    names.insert(rest.split('(').next().unwrap_or_default().to_owned());
                }
                is_test = line == "#[test]" || (is_test && line.starts_with("#["));
            }
        }
    }
}

#[test]
fn every_defect_has_tests_that_exist_and_the_document_names_them() {
    let mut names = BTreeSet::new();
    for folder in ["host", "crates/lab", "crates/experiment", "crates/device", "tests/tests"] {
        tests(&root().join(folder), &mut names);
    }
    let mut text = HEAD.to_owned();
    for (found, held) in DEFECTS {
        for test in *held {
            assert!(names.contains(*test), "there is no test {test}");
        }
        let held: Vec<String> = held.iter().map(|test| format!("`{test}`")).collect();
        writeln!(text, "| {found} | {} |", held.join(", ")).unwrap();
    }
    let path = root().join("docs/defects.md");
    if std::env::var_os("UPDATE_DOCUMENTS").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(found == text, "UPDATE_DOCUMENTS=1 cargo test -p tactus --test command defects:: mends it");
}
