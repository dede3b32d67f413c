//! The whole control cycle against a simulated arm.

mod adaptation;
mod arriving;
mod at_once;
mod authority;
mod caution;
mod contact;
mod disagreement;
mod drawn;
mod goals;
mod hand;
mod hand_plant;
mod losses;
mod lowering;
mod postures;
mod primitives;
mod rig;
mod settling;
mod shoves;
mod tare;
mod tracking;
mod unseen;
mod weight;
