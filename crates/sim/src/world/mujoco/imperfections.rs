//! Differences between the simulated arm and the controller's model.

use super::error::WorldError;
use crate::Noise;
use crate::world::ARM_STREAM;
use mujoco_rs::prelude::{MjModel, MjtObjBase};

/// Deviations from the nominal arm; [`NONE`](Self::NONE) is the nominal arm itself, to the bit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Imperfections {
    /// Factors on mass and inertia of links 1 to 7; the centres of mass stay.
    pub links: [f64; 7],
    /// Factor on mass and inertia of the hand and its fingers, which anybody can put on scales.
    pub hand: f64,
    /// Factors on dry and viscous friction of the seven joints.
    pub friction: [f64; 7],
    /// Elastic cables between motors and joints; `None` for rigid ones.
    pub cables: Option<Cables>,
}

/// Elasticity of the cable drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cables {
    /// Stiffness between motor and joint 1 to 7, reflected to the joint, N m/rad.
    pub stiffness: [f64; 7],
    /// Share of critical damping of the motor's inertia on its cable while the joint stands still.
    pub damping_ratio: f64,
}

impl Cables {
    /// Assumed for a WAM; Barrett publishes no figures.
    ///
    /// Order of magnitude from the geometry: the 2.4 mm steel cables of joint 1 to 4 have some 0.4 MN over a free
    /// length of 0.3 to 0.5 m and act on pulleys of 60 to 90 mm (k = 2 E A r^2 / L); the wrist's are thinner on pulleys
    /// of 20 to 30 mm. It puts the first resonance of the stretched arm with locked motors near 7 Hz, and lets gravity
    /// bend the shoulder by 5 to 8 mrad. A few per cent of critical damping is what stranded steel has.
    pub const WAM: Self =
        Self { stiffness: [4000.0, 4000.0, 2500.0, 2000.0, 350.0, 350.0, 120.0], damping_ratio: 0.05 };
}

impl Imperfections {
    /// The nominal arm.
    pub const NONE: Self = Self { links: [1.0; 7], hand: 1.0, friction: [1.0; 7], cables: None };

    /// An arm as it might stand in a laboratory: link masses within 10 %, the hand's within 3 %, friction within 30 %,
    /// cables within 20 % of [`Cables::WAM`]. The same seed, the same arm.
    #[must_use]
    pub fn drawn(seed: u64) -> Self {
        let mut noise = Noise::new(seed, ARM_STREAM);
        let mut around = |share: f64| noise.uniform(1.0 - share, 1.0 + share);
        let links = std::array::from_fn(|_| around(0.1));
        let hand = around(0.03);
        let friction = std::array::from_fn(|_| around(0.3));
        let stiffness = Cables::WAM.stiffness.map(|k| k * around(0.2));
        Self { links, hand, friction, cables: Some(Cables { stiffness, ..Cables::WAM }) }
    }

    /// Refuses what cannot be simulated.
    pub(super) fn check(&self) -> Result<(), WorldError> {
        let factors = self.links.iter().chain(&self.friction).chain([&self.hand]);
        let cables = self.cables.iter();
        let stiffness = cables.clone().flat_map(|c| c.stiffness);
        let damping = cables.map(|c| c.damping_ratio);
        let checks = factors
            .map(|&x| ("a factor of an imperfection", x, 0.0..=10.0))
            // The fastest motor on its cable must turn by much less than a radian of its oscillation in a step.
            .chain(
                stiffness
                    .zip(1_u8..)
                    .map(|(k, joint)| ("the stiffness of a cable", k, 1.0..=if joint > 4 { 1e3 } else { 2e4 })),
            )
            .chain(damping.map(|x| ("the damping ratio of the cables", x, 0.0..=1.0)));
        for (what, value, range) in checks {
            if !range.contains(&value) {
                return Err(WorldError::OutOfRange { what, value });
            }
        }
        Ok(())
    }

    /// Makes links and hand heavier or lighter; says whether it changed anything. The caller then lets MuJoCo derive
    /// anew what follows from masses. Nothing, not even a rounding, changes where all factors are 1.
    pub(super) fn weigh(&self, model: &mut MjModel) -> Result<bool, WorldError> {
        if self.links == Self::NONE.links && self.hand == Self::NONE.hand {
            return Ok(false);
        }
        let find = |name: String| {
            model.name_to_id(MjtObjBase::mjOBJ_BODY, &name).ok_or(WorldError::Missing { kind: "body", name })
        };
        let mut scales = Vec::new();
        for (i, factor) in self.links.iter().enumerate() {
            scales.push((find(format!("link{}", i + 1))?, *factor));
        }
        // The sensor is a bought part of known mass: the hand begins at the palm.
        let palm = find("bh_palm".to_owned())?;
        // What the hand holds is what it is said to be.
        let held = model.name_to_id(MjtObjBase::mjOBJ_BODY, super::HELD);
        let parents = model.body_parentid();
        for body in palm..parents.len() {
            // Parents have smaller numbers than their children: the way up ends at the palm or passes it by.
            let mut above = body;
            while above > palm {
                above = parents[above] as usize;
            }
            if above == palm && Some(body) != held {
                scales.push((body, self.hand));
            }
        }
        for (body, factor) in scales {
            model.body_mass_mut()[body] *= factor;
            model.body_inertia_mut()[body] = model.body_inertia()[body].map(|x| x * factor);
        }
        Ok(true)
    }
}
