//! Mass matrix by composite rigid bodies: all links beyond a joint are one body, and one inward sweep gathers them.
//!
//! Less than half the price of a column of inverse dynamics per joint (method of Walker and Orin).

use core::ops::Range;

use nalgebra::{SMatrix, Vector3};

use crate::model::arm::{ArmModel, Body};
use crate::model::kinematics::Frames;
use crate::real::Real;
use crate::units::JOINTS;

/// The six numbers of a symmetric 3x3 matrix: an inertia (kg m^2).
#[derive(Clone, Debug)]
struct Inertia<R: Real> {
    xx: R,
    yy: R,
    zz: R,
    xy: R,
    xz: R,
    yz: R,
}

impl<R: Real> Inertia<R> {
    /// Adds what moves the reference point: `r` from the new point to the old one (m), `old` and `new` the first
    /// moment (kg m) about each, `new - old` along `r`.
    fn shift(&mut self, r: &Vector3<R>, old: &Vector3<R>, new: &Vector3<R>) {
        // m (r^2 1 - r r') about the centre and the mixed terms, written with both moments: no mass, no division.
        let (x, y, z) = (r.x * (old.x + new.x), r.y * (old.y + new.y), r.z * (old.z + new.z));
        self.xx += y + z;
        self.yy += x + z;
        self.zz += x + y;
        self.xy -= r.x * old.y + new.x * r.y;
        self.xz -= r.x * old.z + new.x * r.z;
        self.yz -= r.y * old.z + new.y * r.z;
    }

    /// In the axes of frame j-1, given in those of frame j.
    fn inward(&self, model: &ArmModel<R>, frames: &Frames<R>, joint: usize) -> Self {
        let (ts, tc) = (model.twist_sine[joint], model.twist_cosine[joint]);
        let (s, c) = (frames.sine[joint], frames.cosine[joint]);
        // About x by the twist, then about z by the joint.
        let (yy, zz, yz) = turned(self.yy, self.zz, self.yz, ts, tc);
        let (xy, xz) = (self.xy * tc - self.xz * ts, self.xy * ts + self.xz * tc);
        let (xx, yy, xy) = turned(self.xx, yy, xy, s, c);
        Inertia { xx, yy, zz, xy, xz: xz * c - yz * s, yz: xz * s + yz * c }
    }
}

/// The symmetric 2x2 block `a, b` with `ab` off its diagonal, in axes turned back by the angle of sine `s`, cosine `c`.
#[inline]
fn turned<R: Real>(a: R, b: R, ab: R, s: R, c: R) -> (R, R, R) {
    let across = s * (a - b) + c * (ab + ab);
    let first = a - s * across;
    (first, a + b - first, c * across - ab)
}

/// Links beyond a joint, as one rigid body in the axes of some frame, about its origin.
#[derive(Clone, Debug)]
pub(crate) struct Composite<R: Real> {
    mass: R,
    /// Mass times centre of mass (kg m).
    moment: Vector3<R>,
    inertia: Inertia<R>,
}

impl<R: Real> Composite<R> {
    pub(crate) fn nothing() -> Self {
        let zero = R::constant(0.0);
        let inertia = Inertia { xx: zero, yy: zero, zz: zero, xy: zero, xz: zero, yz: zero };
        Self { mass: zero, moment: Vector3::zeros(), inertia }
    }

    /// With a link, whose frame this is in.
    fn add(&mut self, body: &Body<R>) {
        let moment = body.centre * body.mass;
        let (sum, own) = (&mut self.inertia, &body.inertia);
        sum.xx += own.m11;
        sum.yy += own.m22;
        sum.zz += own.m33;
        sum.xy += own.m12;
        sum.xz += own.m13;
        sum.yz += own.m23;
        // About its own centre its first moment is nothing.
        sum.shift(&body.centre, &Vector3::zeros(), &moment);
        self.moment += moment;
        self.mass += body.mass;
    }

    /// About a point that lies at `-arm`.
    fn shift(&mut self, arm: &Vector3<R>) {
        let moment = self.moment + arm * self.mass;
        self.inertia.shift(arm, &self.moment, &moment);
        self.moment = moment;
    }
}

impl<R: Real> ArmModel<R> {
    /// Mass matrix of the links and the payload, without rotors (kg m^2).
    pub fn link_mass_matrix(&self, frames: &Frames<R>) -> SMatrix<R, JOINTS, JOINTS> {
        let mut matrix = SMatrix::<R, JOINTS, JOINTS>::zeros();
        self.sweep(frames, &mut Composite::nothing(), 0..JOINTS, &mut matrix);
        matrix
    }

    /// Mass matrix as the motors feel it: links, payload and reflected rotors (kg m^2).
    pub fn mass_matrix(&self, frames: &Frames<R>) -> SMatrix<R, JOINTS, JOINTS> {
        let mut matrix = SMatrix::<R, JOINTS, JOINTS>::zeros();
        self.gather(frames, &mut Composite::nothing(), 0..JOINTS, &mut matrix);
        matrix
    }

    /// The part of the mass matrix that these joints have with each other and with those before them; `composite` is
    /// what lies beyond them, and takes them in.
    #[inline(never)]
    pub(crate) fn gather(
        &self,
        frames: &Frames<R>,
        composite: &mut Composite<R>,
        joints: Range<usize>,
        matrix: &mut SMatrix<R, JOINTS, JOINTS>,
    ) {
        self.sweep(frames, composite, joints.clone(), matrix);
        if joints.contains(&5) {
            matrix[(4, 5)] += self.reflected_inertia_j5_j6;
            matrix[(5, 4)] += self.reflected_inertia_j5_j6;
        }
        for joint in joints {
            matrix[(joint, joint)] += self.reflected_inertia[joint];
        }
    }

    /// The same without rotors.
    fn sweep(
        &self,
        frames: &Frames<R>,
        composite: &mut Composite<R>,
        joints: Range<usize>,
        matrix: &mut SMatrix<R, JOINTS, JOINTS>,
    ) {
        for joint in joints.rev() {
            composite.add(&self.bodies[joint]);
            composite.shift(&self.link_vector(joint));
            composite.moment = self.inward(frames, joint, &composite.moment);
            composite.inertia = composite.inertia.inward(self, frames, joint);

            // The joint turns it about z with 1 rad/s^2: force and moment that this takes, at the origin of frame j-1.
            let mut force = Vector3::new(-composite.moment.y, composite.moment.x, R::constant(0.0));
            let Inertia { xz, yz, zz, .. } = composite.inertia;
            let mut moment = Vector3::new(xz, yz, zz);
            matrix[(joint, joint)] = moment.z;
            for before in (0..joint).rev() {
                moment += self.link_vector(before).cross(&force);
                force = self.inward(frames, before, &force);
                moment = self.inward(frames, before, &moment);
                matrix[(joint, before)] = moment.z;
                matrix[(before, joint)] = moment.z;
            }
        }
    }
}
