//! The telemetry of a run, cycle by cycle: the material of the time series and of the adaptation.

use control::State;
use lab::demonstration::RATE;

use super::shaking::high_pass;

/// Sensor channels of an expectation: force (world axes), torque (tool axes), gauges of F1 to F3.
pub const CHANNELS: usize = 9;

/// Time over which the height of the hand is averaged, s.
const MEAN_SECONDS: f64 = 1.0;

/// Frequency above which the force at the wrist is chatter, Hz.
const CHATTER: f64 = 3.0;

/// One control cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cycle {
    /// Time after the primitive started, s.
    pub time: f64,
    /// True while the primitive runs: before and after it the plan is another one.
    pub runs: bool,
    /// Measured grasp point, world, m.
    pub position: [f64; 3],
    /// Measured orientation, tool to world (w, x, y, z).
    pub orientation: [f64; 4],
    /// Planned grasp point, world, m.
    pub position_d: [f64; 3],
    /// Planned orientation (w, x, y, z).
    pub orientation_d: [f64; 4],
    /// Measured sensor values: force (world, N), torque (tool axes, N m), gauges (N m).
    pub sensors: [f64; CHANNELS],
    /// Measured spread and fingers 1 to 3, rad.
    pub hand: [f64; 4],
    /// Planned spread and fingers 1 to 3, rad.
    pub hand_d: [f64; 4],
    /// Joint angles, rad.
    pub q: [f64; 7],
    /// Statistic of the watch.
    pub surprise: f64,
}

/// A run as the device told it; what the link lost is missing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trace {
    /// Cycles in order of time.
    pub cycles: Vec<Cycle>,
}

impl Trace {
    /// Largest distance (m) and angle (degrees) of the plan from the taught one, up to `end` (s).
    ///
    /// `taught` is the plan without feedback at the control rate from the start of the movement, `speed` that of the
    /// run relative to it.
    pub fn adaptation(&self, taught: &[([f64; 3], [f64; 4])], speed: f64, end: f64) -> (f64, f64) {
        let Some(last) = taught.last() else {
            return (0.0, 0.0);
        };
        let mut largest = (0.0_f64, 0.0_f64);
        for cycle in self.cycles.iter().filter(|cycle| (0.0..=end).contains(&cycle.time)) {
            let (position, orientation) = taught.get((cycle.time * speed * RATE).round() as usize).unwrap_or(last);
            let distance = (0..3).map(|axis| (cycle.position_d[axis] - position[axis]).powi(2)).sum::<f64>().sqrt();
            let angle = lab::demonstration::angle_between(&cycle.orientation_d, orientation).to_degrees();
            largest = (largest.0.max(distance), largest.1.max(angle));
        }
        largest
    }

    /// Mean distance of the hand below its plan between two times, m; negative where it is above, `None` without a
    /// cycle between them.
    pub fn sag(&self, from: f64, to: f64) -> Option<f64> {
        let cycles = self.cycles.iter().filter(|cycle| (from..=to).contains(&cycle.time));
        let (sum, count) =
            cycles.fold((0.0, 0.0), |(sum, count), cycle| (sum + cycle.position_d[2] - cycle.position[2], count + 1.0));
        (count > 0.0).then(|| sum / count)
    }

    /// The same over the last second of the run: what holds the hand behind it has another plan. `None` where no run
    /// lasted for so long.
    pub fn lifted_sag(&self) -> Option<f64> {
        let end = self.cycles.iter().rev().find(|cycle| cycle.runs)?.time;
        if end >= MEAN_SECONDS { self.sag(end - MEAN_SECONDS, end) } else { None }
    }

    /// The same over the last second before something is touched (s after the start): what a free hand sags. `None`
    /// where the hand was not free for so long.
    pub fn free_sag(&self, touched: f64) -> Option<f64> {
        if touched >= MEAN_SECONDS { self.sag(touched - MEAN_SECONDS, touched) } else { None }
    }

    /// Content above 3 Hz of the force at the wrist between two times, N: root mean square of the vector; `None`
    /// without a cycle between them.
    pub fn chatter(&self, from: f64, to: f64) -> Option<f64> {
        let before = self.cycles.partition_point(|cycle| cycle.time < from);
        let within = self.cycles.partition_point(|cycle| cycle.time < to).saturating_sub(before);
        // The filter is at rest at the first cycle and gives a value from the second on.
        let squares = |axis: usize| {
            let fast = high_pass(self.cycles.iter().map(|cycle| cycle.sensors[axis]), CHATTER);
            fast.skip(before.saturating_sub(1)).take(within).map(|value| value * value).sum::<f64>()
        };
        (within > 0).then(|| ((0..3).map(squares).sum::<f64>() / within as f64).sqrt())
    }
}

impl Cycle {
    /// From what came over the link; `first` is the first cycle of the run.
    pub fn of(telemetry: &link::Telemetry, first: u32) -> Cycle {
        let q = telemetry.q.map(f64::from);
        let (position, orientation) = lab::arm::tool_pose(&q);
        let [x, y, z, w, a, b, c] = telemetry.pose_d.map(f64::from);
        // The counter may have wrapped between the two.
        let cycles = telemetry.cycle.wrapping_sub(first) as i32;
        Cycle {
            time: f64::from(cycles) / RATE,
            runs: telemetry.state == State::Run.code(),
            position,
            orientation,
            position_d: [x, y, z],
            orientation_d: [w, a, b, c],
            sensors: std::array::from_fn(|channel| {
                let value = if channel < 6 { telemetry.wrench[channel] } else { telemetry.gauges[channel - 6] };
                f64::from(value)
            }),
            hand: telemetry.hand.map(f64::from),
            hand_d: telemetry.hand_d.map(f64::from),
            q,
            surprise: f64::from(telemetry.surprise),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn cycle(time: f64) -> Cycle {
        Cycle {
            time,
            runs: true,
            position: [0.7, 0.2, 0.0],
            orientation: [1.0, 0.0, 0.0, 0.0],
            position_d: [0.7, 0.2, 0.0],
            orientation_d: [1.0, 0.0, 0.0, 0.0],
            sensors: [0.0; CHANNELS],
            hand: [0.0; 4],
            hand_d: [0.0; 4],
            q: [0.0; 7],
            surprise: 0.0,
        }
    }

    #[test]
    fn adaptation_is_the_distance_of_the_plans_not_of_the_hand() {
        let taught: Vec<_> = (0..300).map(|k| ([0.7, 0.2 + f64::from(k) * 1e-3, 0.0], [1.0, 0.0, 0.0, 0.0])).collect();
        let mut trace = Trace { cycles: (0..600).map(|k| cycle(f64::from(k) / RATE)).collect() };
        for (index, cycle) in trace.cycles.iter_mut().enumerate() {
            cycle.position_d = taught[index.min(299)].0;
            cycle.position[0] = 0.1;
        }
        assert_eq!(trace.adaptation(&taught, 1.0, 9.0), (0.0, 0.0));
        trace.cycles[200].position_d[0] += 0.05;
        let half = 5.0_f64.to_radians();
        trace.cycles[550].orientation_d = [half.cos(), half.sin(), 0.0, 0.0];
        let (distance, angle) = trace.adaptation(&taught, 1.0, 9.0);
        assert!((distance - 0.05).abs() < 1e-12 && (angle - 10.0).abs() < 1e-6);
        // After the movement the plan is another one: the lift is no adaptation.
        assert!(trace.adaptation(&taught, 1.0, 1.0).1 < 1e-9);
    }

    /// The change that makes it fail: the plan of a run is compared with the taught place at the same time.
    #[test]
    fn a_run_at_another_speed_has_adapted_to_nothing() {
        let taught: Vec<_> = (0..300).map(|k| ([0.7, 0.2 + f64::from(k) * 1e-3, 0.0], [1.0, 0.0, 0.0, 0.0])).collect();
        let mut trace = Trace { cycles: (0..140).map(|k| cycle(f64::from(k) / RATE)).collect() };
        for (index, cycle) in trace.cycles.iter_mut().enumerate() {
            cycle.position_d = taught[2 * index].0;
        }
        assert_eq!(trace.adaptation(&taught, 2.0, 9.0), (0.0, 0.0));
    }

    #[test]
    fn chatter_is_what_is_fast_in_all_axes_of_the_force_and_only_between_the_two_times() {
        let mut trace = Trace { cycles: (0..1200).map(|k| cycle(f64::from(k) / RATE)).collect() };
        for cycle in &mut trace.cycles {
            let turn = |hertz: f64| (std::f64::consts::TAU * hertz * cycle.time).sin();
            let fast = if cycle.time < 2.0 { turn(12.0) } else { 0.0 };
            cycle.sensors = [fast, 9.0 * turn(0.1), 2.0 * fast, 0.0, 0.0, 0.0, 5.0 * fast, 0.0, 0.0];
        }
        let whole = (5.0_f64 / 2.0).sqrt();
        assert!((trace.chatter(0.5, 1.9).unwrap() - whole).abs() < 0.03, "{:?}", trace.chatter(0.5, 1.9));
        assert!(trace.chatter(2.5, 3.9).unwrap() < 0.03, "{:?}", trace.chatter(2.5, 3.9));
        assert_eq!(trace.chatter(9.0, 10.0), None, "there was no cycle");
    }

    #[test]
    fn sag_is_what_the_hand_is_below_its_plan_in_the_mean() {
        let mut trace = Trace { cycles: vec![cycle(1.0), cycle(2.0), cycle(3.0)] };
        trace.cycles[0].position_d[2] = 0.5;
        trace.cycles[1].position_d[2] = 0.004;
        trace.cycles[2].position[2] = 0.02;
        assert!((trace.sag(1.5, 2.5).unwrap() - 0.004).abs() < 1e-12);
        assert!((trace.sag(1.5, 3.5).unwrap() + 0.008).abs() < 1e-12);
        assert_eq!(trace.sag(7.0, 8.0), None, "there was no cycle");
    }

    /// The change that makes it fail: the second counts from the last cycle on, as it was. What holds a load behind a
    /// run has a plan that is centimetres above the hand.
    #[test]
    fn a_lifted_hand_sags_over_the_last_second_of_its_run_and_not_behind_it() {
        let mut trace = Trace { cycles: (0..900).map(|k| cycle(f64::from(k) / RATE)).collect() };
        for cycle in &mut trace.cycles {
            cycle.runs = cycle.time < 2.5;
            cycle.position_d[2] += if cycle.time < 1.45 || !cycle.runs { 1.0 } else { 0.01 };
        }
        assert!((trace.lifted_sag().unwrap() - 0.01).abs() < 1e-12);
        trace.cycles.retain(|cycle| cycle.time < 0.9 || !cycle.runs);
        assert_eq!(trace.lifted_sag(), None, "it did not run for a second");
        trace.cycles.retain(|cycle| !cycle.runs);
        assert_eq!(trace.lifted_sag(), None, "it did not run");
    }

    #[test]
    fn a_free_hand_sags_over_the_last_second_before_it_touches_something() {
        let mut trace = Trace { cycles: (0..900).map(|k| cycle(f64::from(k) / RATE)).collect() };
        trace.cycles.iter_mut().filter(|cycle| cycle.time > 1.45).for_each(|cycle| cycle.position_d[2] += 0.01);
        trace.cycles.iter_mut().filter(|cycle| cycle.time > 2.55).for_each(|cycle| cycle.position_d[2] += 1.0);
        assert!((trace.free_sag(2.5).unwrap() - 0.01).abs() < 1e-12);
        assert_eq!(trace.free_sag(0.9), None, "it was not free for a second");
    }
}
