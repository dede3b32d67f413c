//! Mass matrix by composite rigid bodies: all links beyond a joint are one body, and one inward sweep gathers them.
//!
//! Less than half the price of a column of inverse dynamics per joint (method of Walker and Orin).

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::model::arm::{ArmModel, Body};
use crate::model::kinematics::Frames;
use crate::real::Real;
use crate::units::JOINTS;

/// Links beyond a joint, as one rigid body in the axes of some frame, about its origin.
struct Composite<R: Real> {
    mass: R,
    /// Mass times centre of mass (kg m).
    moment: Vector3<R>,
    /// Inertia about the origin (kg m^2).
    inertia: Matrix3<R>,
}

impl<R: Real> Composite<R> {
    fn nothing() -> Self {
        Self { mass: R::of(0.0), moment: Vector3::zeros(), inertia: Matrix3::zeros() }
    }

    /// With a link, whose frame this is in.
    fn add(&mut self, body: &Body<R>) {
        let moment = body.centre * body.mass;
        self.inertia += body.inertia + parallel_axes(&moment, &body.centre);
        self.moment += moment;
        self.mass += body.mass;
    }

    /// About a point that lies at `-arm`.
    fn shift(&mut self, arm: &Vector3<R>) {
        // I + m (r^2 1 - r r') about the new point, written with what is already known about the old one.
        let once = parallel_axes(&self.moment, arm);
        self.moment += arm * self.mass;
        self.inertia += once + parallel_axes(arm, &self.moment);
    }
}

/// `(a . b) 1 - b a'`: what a first moment `a` at the arm `b` adds to an inertia.
#[inline]
fn parallel_axes<R: Real>(a: &Vector3<R>, b: &Vector3<R>) -> Matrix3<R> {
    let dot = a.dot(b);
    let mut matrix = -b * a.transpose();
    matrix.m11 += dot;
    matrix.m22 += dot;
    matrix.m33 += dot;
    matrix
}

impl<R: Real> ArmModel<R> {
    /// Mass matrix of the links and the payload, without rotors (kg m^2).
    pub fn link_mass_matrix(&self, frames: &Frames<R>) -> SMatrix<R, JOINTS, JOINTS> {
        let mut matrix = SMatrix::<R, JOINTS, JOINTS>::zeros();
        let mut composite = Composite::nothing();
        for joint in (0..JOINTS).rev() {
            composite.add(&self.bodies[joint]);
            composite.shift(&self.link_vector(joint));
            composite.moment = self.inward(frames, joint, &composite.moment);
            composite.inertia = self.inward_inertia(frames, joint, &composite.inertia);

            // The joint turns it about z with 1 rad/s^2: force and moment that this takes, at the origin of frame j-1.
            let mut force = Vector3::new(-composite.moment.y, composite.moment.x, R::of(0.0));
            let mut moment: Vector3<R> = composite.inertia.column(2).into_owned();
            matrix[(joint, joint)] = moment.z;
            for before in (0..joint).rev() {
                moment += self.link_vector(before).cross(&force);
                force = self.inward(frames, before, &force);
                moment = self.inward(frames, before, &moment);
                matrix[(joint, before)] = moment.z;
                matrix[(before, joint)] = moment.z;
            }
        }
        matrix
    }

    /// Mass matrix as the motors feel it: links, payload and reflected rotors (kg m^2).
    pub fn mass_matrix(&self, frames: &Frames<R>) -> SMatrix<R, JOINTS, JOINTS> {
        let mut matrix = self.link_mass_matrix(frames);
        for (joint, inertia) in self.reflected_inertia.iter().enumerate() {
            matrix[(joint, joint)] += *inertia;
        }
        matrix[(4, 5)] += self.reflected_inertia_j5_j6;
        matrix[(5, 4)] += self.reflected_inertia_j5_j6;
        matrix
    }

    /// An inertia given in the axes of frame j, in those of frame j-1.
    fn inward_inertia(&self, frames: &Frames<R>, joint: usize, inertia: &Matrix3<R>) -> Matrix3<R> {
        let turn = |m: &Matrix3<R>| {
            let column = |i: usize| self.inward(frames, joint, &m.column(i).into_owned());
            Matrix3::from_columns(&[column(0), column(1), column(2)])
        };
        turn(&turn(inertia).transpose())
    }
}
