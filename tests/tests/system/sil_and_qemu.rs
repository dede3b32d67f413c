//! The application in this process and the firmware under QEMU are the same arm.

use system_tests::execution::{Execution, distance, grasp_point, play};
use system_tests::{ready, taught};

fn run_on(address: &str) -> Execution {
    play(&mut ready(address), taught())
}

#[test]
fn sil_and_qemu_play_the_same_movement() {
    let (in_process, firmware) = (run_on("sil:seed=31"), run_on("sim:seed=31"));
    let (one, other) = (in_process.running(), firmware.running());
    assert!(one.len().abs_diff(other.len()) <= 1, "{} and {} cycles", one.len(), other.len());
    let mut farthest = 0.0;
    for (one, other) in one.iter().zip(&other) {
        // The same plan first: a difference there could never be one of timing.
        let plan = |pose: &[f32; 7]| [0, 1, 2].map(|axis| f64::from(pose[axis]));
        let apart = distance(&plan(&one.pose_d), &plan(&other.pose_d));
        assert!(apart < 1e-3, "the plans are {:.2} mm apart at phase {}", apart * 1e3, one.phase);
        farthest = f64::max(farthest, distance(&grasp_point(one), &grasp_point(other)));
    }
    let end = distance(&in_process.grasp_point, &firmware.grasp_point);
    println!("apart: {:.3} mm at the most, {:.3} mm at the end", farthest * 1e3, end * 1e3);
    assert!(farthest <= 3e-3, "the movements are {:.2} mm apart", farthest * 1e3);
    assert!(end <= 1e-3, "the ends are {:.2} mm apart", end * 1e3);
}
