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
        // Computed by one of the two floating-point units each, from the same primitive.
        assert!((one.phase - other.phase).abs() < 1e-6, "phases {} and {}", one.phase, other.phase);
        farthest = f64::max(farthest, distance(&grasp_point(one), &grasp_point(other)));
    }
    let end = distance(&in_process.grasp_point, &firmware.grasp_point);
    println!("apart: {:.3} mm at the most, {:.3} mm at the end", farthest * 1e3, end * 1e3);
    assert!(farthest <= 3e-3, "the movements are {:.2} mm apart", farthest * 1e3);
    assert!(end <= 1e-3, "the ends are {:.2} mm apart", end * 1e3);
}
