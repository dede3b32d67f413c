//! `tactus experiment` refuses what it cannot do before it teaches or writes anything.

use system_tests::command::{stderr, stdout, tactus};
use system_tests::{expect, taught};

#[test]
fn figures_only_draws_results_that_are_there_and_teaches_nothing() {
    let folder = expect(tempfile::tempdir());
    expect(taught().write(&folder.path().join("primitive.toml")));
    let line = ["experiment", "flashlight", "--figures-only", "--out", "none"];
    let empty = tactus(folder.path(), &line).failure().code(2);
    assert!(stderr(&empty).contains("error[E242]"), "{}", stderr(&empty));
    let empty = tactus(folder.path(), &[&line[..], &["--primitive", "primitive.toml"]].concat()).failure().code(2);
    assert!(stderr(&empty).contains("there are no results in none"), "{}", stderr(&empty));
    assert!(!folder.path().join("none").join("results.jsonl").exists());
}

#[test]
fn an_object_that_is_none_is_refused_before_anything_is_taught_or_written() {
    const CUP: &str = include_str!("../../../crates/sim/objects/cup.toml");
    let folder = expect(tempfile::tempdir());
    let folder = folder.path();
    expect(std::fs::write(folder.join("heavy.toml"), CUP.replacen("mass = 0.2", "mass = -0.2", 1)));
    expect(std::fs::write(folder.join("cup.toml"), CUP));
    for (object, code, exit, reason) in [
        ("teapot", "E271", 2, "there is no object 'teapot'; there are small-torch, flashlight"),
        ("none.toml", "E233", 2, "No such file"),
        ("heavy.toml", "E663", 6, "is -0.2; it must be from"),
        ("cup.toml", "E663", 6, "the name 'cup' is that of an object which is compiled in"),
    ] {
        let failed = tactus(folder, &["experiment", "cup", "--object", object, "--out", "results"]);
        let failed = stderr(&failed.failure().code(exit));
        assert!(failed.contains(&format!("error[{code}]")) && failed.contains(reason), "{failed}");
        assert!(!folder.join("results").exists(), "{object}");
    }
}

/// The changes that make it fail: `setup::configuration` that takes its folder before it looks at what it is given, a
/// grid that is looked at once a primitive was taught for it, and an address of which the engine alone is read.
#[test]
fn what_cannot_be_tried_is_refused_before_anything_is_taught_and_leaves_no_folder() {
    let folder = expect(tempfile::tempdir());
    let folder = folder.path();
    expect(taught().write(&folder.join("primitive.toml")));
    expect(std::fs::write(folder.join("file"), ""));
    for (line, code, exit, reason) in [
        ("--device sil:seed=7 experiment cup --out new", "E201", 2, "`--seed 7`"),
        ("experiment cup --primitive none.toml --out new", "E233", 2, "none.toml"),
        ("experiment cup --grid 99:99 --out new", "E660", 6, "99:99 (not on the table)"),
        ("experiment cup --grid 99:99 --primitive primitive.toml --modes a --out new", "E660", 6, "99:99"),
        (
            "experiment cup --grid 0:0 --primitive primitive.toml --out new",
            "E635",
            6,
            "`tactus rehearse primitive.toml`",
        ),
        ("experiment cup --grid 0:0 --primitive primitive.toml --modes a --out file", "E231", 2, "name a folder"),
    ] {
        let failed = tactus(folder, &line.split(' ').collect::<Vec<_>>());
        let failed = stderr(&failed.failure().code(exit));
        assert!(failed.contains(&format!("error[{code}]")) && failed.contains(reason), "{line}: {failed}");
        assert!(!folder.join("new").exists(), "{line}");
    }
}

/// The change that makes it fail: a primitive that is written into the folder where none is, and otherwise tried
/// under the name of the one that is there.
#[test]
fn a_primitive_is_not_tried_in_the_folder_of_another_one() {
    let folder = expect(tempfile::tempdir());
    let folder = folder.path();
    expect(taught().write(&folder.join("primitive.toml")));
    expect(std::fs::create_dir(folder.join("out")));
    for other in ["", "something of somebody else"] {
        expect(std::fs::write(folder.join("out/cup.toml"), other));
        let line = "experiment cup --grid 0:0 --modes a --primitive primitive.toml --out out";
        let failed = stderr(&tactus(folder, &line.split(' ').collect::<Vec<_>>()).failure().code(2));
        assert!(failed.contains("error[E230]") && failed.contains("is another primitive"), "{failed}");
        assert_eq!(expect(std::fs::read_to_string(folder.join("out/cup.toml"))), other);
        assert!(!folder.join("out/results.jsonl").exists());
    }
}

/// The changes that make it fail: figures of the usual grid and plant whatever the results are of, and advice to remove
/// them.
#[test]
fn figures_need_no_options_again_and_who_forgets_them_to_go_on_is_told_them() {
    let folder = expect(tempfile::tempdir());
    let folder = folder.path();
    expect(taught().write(&folder.join("primitive.toml")));
    let run = |line: &str| tactus(folder, &line.split(' ').collect::<Vec<_>>());
    let begun = "experiment flashlight --modes a --out out --grid -4:0,0:0 --plant ideal --vary mass=1.1";
    run(&format!("{begun} --primitive primitive.toml")).success();
    let figures = stdout(&run("experiment flashlight --out out --figures-only").success());
    assert!(figures.contains("(a) ") && figures.contains("/2"), "{figures}");
    let failed = stderr(&run("experiment flashlight --modes a --out out --resume").failure().code(4));
    assert!(failed.contains("give `--grid -4:0,0:0 --plant ideal --vary mass=1.1`"), "{failed}");
    assert!(failed.contains("error[E404]") && !failed.contains("remove"), "{failed}");
    run(&format!("{begun} --resume")).success();
}
