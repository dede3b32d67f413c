//! The host's end of the emulated board's second CAN: the bus itself is inside the emulator.
//!
//! Frames pass the lock step as records of 11 bytes: identifier u16 little-endian, length u8, 8 data bytes of which
//! the unused ones are 0. When they travel on the wire the emulator decides.

use std::collections::VecDeque;
use std::time::Duration;

use embedded_can::Frame;
use puck::{CanFrame, CanId};

use super::Simulation;
use crate::transport::TransportError;
use crate::transport::can::CanPort;

/// Bytes of a frame in the lock step.
pub(crate) const RECORD_BYTES: usize = 11;

/// Something that is no frame came out of the emulator.
#[derive(Debug, thiserror::Error)]
#[error("the emulated board sent a record that is no CAN frame: {0:02x?}")]
struct NoFrame([u8; RECORD_BYTES]);

/// An emulated board behind its own bus.
pub struct BoardCan {
    simulation: Simulation,
    arrived: VecDeque<u8>,
}

impl BoardCan {
    /// Takes over the line of a board that was switched on with a host line of CAN.
    #[must_use]
    pub fn new(simulation: Simulation) -> Self {
        Self { simulation, arrived: VecDeque::new() }
    }

    /// The simulation.
    pub fn simulation(&mut self) -> &mut Simulation {
        &mut self.simulation
    }
}

fn encode(frame: &CanFrame) -> [u8; RECORD_BYTES] {
    let mut record = [0; RECORD_BYTES];
    let payload = frame.payload();
    record[..2].copy_from_slice(&frame.can_id().raw().to_le_bytes());
    record[2] = payload.len() as u8;
    record[3..3 + payload.len()].copy_from_slice(payload);
    record
}

fn decode(record: [u8; RECORD_BYTES]) -> Result<CanFrame, NoFrame> {
    let [low, high, length, data @ ..] = record;
    let payload = data.get(..usize::from(length));
    let id = CanId::new(u16::from_le_bytes([low, high]));
    payload.and_then(|payload| CanFrame::new(id?, payload)).ok_or(NoFrame(record))
}

impl CanPort for BoardCan {
    fn send(&mut self, frame: CanFrame) -> Result<(), TransportError> {
        self.simulation.plant().link_to_device(&encode(&frame));
        Ok(())
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, TransportError> {
        let arrived = &mut self.arrived;
        self.simulation.advance_plant_until(timeout, |plant, _| {
            arrived.extend(plant.take_from_device());
            arrived.len() >= RECORD_BYTES
        })?;
        self.simulation.log_buses(&[])?;
        let mut record = [0; RECORD_BYTES];
        if self.arrived.len() < RECORD_BYTES {
            return Ok(None);
        }
        for (byte, arrived) in record.iter_mut().zip(self.arrived.drain(..RECORD_BYTES)) {
            *byte = arrived;
        }
        decode(record).map(Some).map_err(TransportError::other)
    }

    fn now(&self) -> Duration {
        self.simulation.elapsed()
    }

    fn is_virtual(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_the_frame_it_was_made_of() {
        for payload in [&[][..], &[1, 2, 3], &[9; 8]] {
            let frame = CanFrame::new(CanId::new(0x7FE).unwrap(), payload).unwrap();
            assert_eq!(decode(encode(&frame)).unwrap(), frame);
        }
        let record = encode(&CanFrame::new(CanId::new(0x123).unwrap(), &[0xAB]).unwrap());
        assert_eq!(record, [0x23, 0x01, 1, 0xAB, 0, 0, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn what_no_controller_could_send_is_refused() {
        assert!(decode([0, 0, 9, 0, 0, 0, 0, 0, 0, 0, 0]).is_err(), "nine data bytes");
        assert!(decode([0, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0]).is_err(), "an identifier of twelve bits");
    }
}
