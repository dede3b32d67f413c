//! `Mass`: mass matrix of the arm and its factor, renewed part by part, so that no control period pays for all of it.

use nalgebra::SMatrix;

use crate::model::arm::ArmModel;
use crate::model::kinematics::Frames;
use crate::model::mass_matrix::Composite;
use crate::real::Real;
use crate::sense::leisure::Leisure;
use crate::time::few_periods;
use crate::units::{JOINTS, Vector7};

/// Time after which the mass matrix is renewed: 27 ms, in control periods. The posture changes little in it.
const RENEWAL: u8 = few_periods(0.027);

/// Parts of a renewal, a control period each: the wrist's joints, the other ones, the factor.
const PARTS: u8 = 3;

/// First joint (from 0) of the first part.
const WRIST: usize = 5;

/// Inertia of the arm.
#[derive(Clone, Debug)]
pub(crate) struct Mass<R: Real> {
    matrix: SMatrix<R, JOINTS, JOINTS>,
    /// Lower triangle of its `L D L^T`: `L` below the diagonal, `1/D` on it.
    factor: SMatrix<R, JOINTS, JOINTS>,
    /// Links of the first part of a renewal, for the second.
    gathered: Composite<R>,
    /// Control periods since the renewal began.
    cycle: u8,
    ready: bool,
}

impl<R: Real> Mass<R> {
    /// Nothing is known yet: no torque accelerates anything.
    pub(crate) fn new() -> Self {
        Mass {
            matrix: SMatrix::zeros(),
            factor: SMatrix::zeros(),
            gathered: Composite::nothing(),
            cycle: 0,
            ready: false,
        }
    }

    /// The mass matrix (kg m^2), at most a renewal old.
    pub(crate) fn matrix(&self) -> &SMatrix<R, JOINTS, JOINTS> {
        &self.matrix
    }

    /// Does what this control period has to do for the renewal: all of it in the first one.
    pub(crate) fn renew(&mut self, model: &ArmModel<R>, frames: &Frames<R>) {
        if !self.ready {
            self.matrix = model.mass_matrix(frames);
            self.factorise();
            (self.ready, self.cycle) = (true, PARTS);
            return;
        }
        match self.cycle {
            0 => {
                self.gathered = Composite::nothing();
                model.gather(frames, &mut self.gathered, WRIST..JOINTS, &mut self.matrix);
            }
            1 => model.gather(frames, &mut self.gathered, 0..WRIST, &mut self.matrix),
            2 => self.factorise(),
            _ => {}
        }
        self.cycle = (self.cycle + 1) % RENEWAL;
    }

    /// The work for which this control period leaves time.
    pub(crate) fn leaves(&self) -> Leisure {
        match self.cycle {
            0 | 1 => Leisure::None,
            even if even % 2 == 0 => Leisure::Limits,
            _ => Leisure::Goal,
        }
    }

    /// This control period has a change of state to compute: the part that is due comes in the next one. Without this
    /// the longest cycle of a run depends on the moment at which a person begins it. What was gathered before is kept,
    /// so that orders in every other cycle do not hold the renewal up.
    pub(crate) fn postpone(&mut self) {
        if self.ready && self.cycle < PARTS {
            // No part now, and this one again in the next period.
            self.cycle += RENEWAL - 1;
        }
    }

    /// `L D L^T` of the mass matrix: `L` below the diagonal, `1/D` on it.
    #[inline(never)]
    fn factorise(&mut self) {
        let mut factor = self.matrix;
        for j in 0..JOINTS {
            for i in j..JOINTS {
                let mut sum = factor[(i, j)];
                for k in 0..j {
                    // Rows of `L` hold `L D` until their diagonal is reached.
                    sum -= factor[(i, k)] * factor[(j, k)] * self.factor[(k, k)];
                }
                factor[(i, j)] = sum;
            }
            self.factor[(j, j)] = R::constant(1.0) / factor[(j, j)];
        }
        for j in 0..JOINTS {
            let inverse = self.factor[(j, j)];
            for i in j + 1..JOINTS {
                self.factor[(i, j)] = factor[(i, j)] * inverse;
            }
        }
    }

    /// Acceleration of the joints by a torque (N m).
    #[inline(never)]
    pub(crate) fn accelerated(&self, torque: &Vector7<R>) -> Vector7<R> {
        let mut x = *torque;
        for j in 0..JOINTS {
            for i in j + 1..JOINTS {
                let part = self.factor[(i, j)] * x[j];
                x[i] -= part;
            }
        }
        for j in 0..JOINTS {
            x[j] *= self.factor[(j, j)];
        }
        for j in (0..JOINTS).rev() {
            for i in j + 1..JOINTS {
                let part = self.factor[(i, j)] * x[i];
                x[j] -= part;
            }
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::calibration::Payload;
    use crate::units::JointPositions;

    const POSTURE: [f64; JOINTS] = [-0.49, 1.56, 1.47, 1.85, -0.17, -0.58, 1.75];

    /// The change that makes it fail: a part of the renewal is left out, or comes before what it needs.
    #[test]
    fn a_torque_accelerates_the_arm_as_the_mass_matrix_says_in_every_cycle() {
        let model = ArmModel::<f64>::new(Payload::SensorAndHand);
        let frames = Frames::new(&model, &JointPositions::from_array(POSTURE));
        let wanted = Vector7::from([0.5, -1.0, 2.0, 0.3, -4.0, 5.0, 6.0]);
        let torque = model.mass_matrix(&frames) * wanted;
        let mut mass = Mass::new();
        for _ in 0..3 * RENEWAL {
            mass.renew(&model, &frames);
            let accelerated = mass.accelerated(&torque);
            assert!((accelerated - wanted).amax() < 1e-9, "{accelerated}");
        }
    }

    #[test]
    fn the_mass_matrix_follows_the_posture_within_two_renewals() {
        let model = ArmModel::<f64>::new(Payload::SensorAndHand);
        let [before, now] = [[0.0; JOINTS], POSTURE].map(|q| Frames::new(&model, &JointPositions::from_array(q)));
        let wanted = Vector7::from([0.5, -1.0, 2.0, 0.3, -4.0, 5.0, 6.0]);
        let torque = model.mass_matrix(&now) * wanted;
        let mut mass = Mass::new();
        mass.renew(&model, &before);
        assert!((mass.accelerated(&torque) - wanted).amax() > 0.1);
        for _ in 0..2 * RENEWAL {
            mass.renew(&model, &now);
        }
        assert!((mass.accelerated(&torque) - wanted).amax() < 1e-9);
        assert!((mass.matrix() - model.mass_matrix(&now)).amax() < 1e-12);
    }

    /// The change that makes it fail: `postpone` does nothing, or postpones for longer than a cycle.
    #[test]
    fn a_postponed_renewal_comes_in_the_cycle_after() {
        let model = ArmModel::<f64>::new(Payload::SensorAndHand);
        let now = Frames::new(&model, &JointPositions::from_array(POSTURE));
        for phase in 0..RENEWAL {
            let mut mass = Mass::new();
            let renew = |mass: &mut Mass<f64>, frames: &Frames<f64>| {
                let known = (mass.matrix, mass.factor);
                mass.renew(&model, frames);
                (mass.matrix, mass.factor) != known
            };
            // An arm on its way: each part changes something.
            for period in 0..2 * RENEWAL + (phase + RENEWAL - PARTS) % RENEWAL + 1 {
                let q = [0.01 * f64::from(period); JOINTS];
                renew(&mut mass, &Frames::new(&model, &JointPositions::from_array(q)));
            }
            assert_eq!(mass.cycle, phase);
            mass.postpone();
            assert!(!renew(&mut mass, &now), "renewed in phase {phase}");
            assert!(phase >= PARTS || renew(&mut mass, &now), "one that was due in phase {phase} is late");
            for _ in 0..RENEWAL + PARTS {
                renew(&mut mass, &now);
            }
            assert_eq!(mass.matrix, model.mass_matrix(&now), "phase {phase}");
        }
    }

    /// The change that makes it fail: a period that gathers the matrix leaves time for something else.
    #[test]
    fn what_can_wait_waits_while_the_matrix_is_gathered() {
        let model = ArmModel::<f64>::new(Payload::SensorAndHand);
        let mut mass = Mass::new();
        for cycle in 0..3 * usize::from(RENEWAL) {
            let q = [1.0 + 0.01 * cycle as f64; JOINTS];
            let frames = Frames::new(&model, &JointPositions::from_array(q));
            let (leisure, known) = (mass.leaves(), mass.matrix);
            mass.renew(&model, &frames);
            assert!(mass.matrix == known || leisure == Leisure::None, "cycle {cycle}");
        }
    }

    /// The change that makes it fail: a renewal that is postponed begins anew.
    #[test]
    fn orders_in_every_other_cycle_do_not_hold_up_the_renewal() {
        let model = ArmModel::<f64>::new(Payload::SensorAndHand);
        let [before, now] = [[0.0; JOINTS], POSTURE].map(|q| Frames::new(&model, &JointPositions::from_array(q)));
        for every in 2..=4 {
            let mut mass = Mass::new();
            mass.renew(&model, &before);
            for cycle in 0..6 * u32::from(RENEWAL) {
                if cycle % every == 0 {
                    mass.postpone();
                }
                mass.renew(&model, &now);
            }
            assert_eq!(mass.matrix, model.mass_matrix(&now), "an order every {every} cycles");
        }
    }

    #[test]
    fn a_postponement_before_the_first_mass_matrix_changes_nothing() {
        let model = ArmModel::<f64>::new(Payload::SensorAndHand);
        let frames = Frames::new(&model, &JointPositions::from_array(POSTURE));
        let mut mass = Mass::new();
        mass.postpone();
        mass.renew(&model, &frames);
        assert_eq!(mass.matrix, model.mass_matrix(&frames));
    }
}
