//! The wire to the simulator: one request and one reply per exchange, on QEMU's standard output and input.
//!
//! Byte layout: `docs/lockstep.md`. A semihosting call blocks the processor and virtual time, so the simulator may
//! take any time to answer.

use core::sync::atomic::{AtomicBool, Ordering};

use puck::{CanFrame, CanId};
use semihosting::fd::{AsFd, OwnedFd};
use semihosting::sys;
use semihosting::sys::arm_compat::{OpenMode, sys_open};

/// QEMU's own standard streams: mode write is its output, mode read its input.
const STANDARD_STREAM: &core::ffi::CStr = c":tt";

/// Most link bytes in one reply.
pub(super) const LINK_BYTES: usize = 64;

const REQUEST_BYTES: usize = 24;
const REPLY_BYTES: usize = 32;

/// Set while an exchange is under way. A failure in the middle leaves the streams out of step for good.
static BROKEN: AtomicBool = AtomicBool::new(false);

/// A message of the image to the simulator.
pub(super) enum Request<'a> {
    /// A frame for the bus.
    Send(&'a CanFrame),
    /// The time named by the last reply has come.
    Event,
    /// The image ends.
    Bye,
    /// Bytes for the host, at most 255.
    Link(&'a [u8]),
    /// Something the flash does; a read's bytes come with the reply.
    Flash(FlashRequest<'a>),
}

/// An operation of the simulated flash, and where: address from the beginning of the region.
#[derive(Clone, Copy)]
pub(super) enum FlashRequest<'a> {
    /// Hand over this many bytes from there.
    Read(u32, u32),
    /// Program this word, 32 bytes, which must be blank.
    Write(u32, &'a [u8]),
    /// Erase the sector that begins there.
    Erase(u32),
}

/// The flash's answer beside bytes.
#[derive(Clone, Copy)]
pub(super) struct FlashReply {
    /// Tick at which the operation is over.
    pub(super) ready: u64,
    /// 0: done or under way; else the number of the error.
    pub(super) status: u8,
}

/// The simulator's answer.
pub(super) struct Reply {
    /// A frame arrived.
    pub(super) received: Option<CanFrame>,
    /// A frame of ours has been on the wire.
    pub(super) transmitted: bool,
    /// Tick of the next event; `u64::MAX` for none.
    pub(super) next: u64,
    /// Only in the reply to a request for the flash.
    pub(super) flash: FlashReply,
    link: [u8; LINK_BYTES],
    link_length: usize,
}

impl Reply {
    /// Bytes from the host.
    pub(super) fn link(&self) -> &[u8] {
        self.link.get(..self.link_length).unwrap_or(&[])
    }
}

/// The simulator is gone, or does not keep to the protocol.
pub(super) struct Gone;

/// Both directions of the wire.
pub(super) struct Wire {
    out: OwnedFd,
    back: OwnedFd,
}

impl Wire {
    /// Opens the streams.
    pub(super) fn open() -> Result<Self, Gone> {
        Ok(Self {
            out: sys_open(STANDARD_STREAM, OpenMode::WRONLY_TRUNC_BINARY).map_err(|_| Gone)?,
            back: sys_open(STANDARD_STREAM, OpenMode::RDONLY_BINARY).map_err(|_| Gone)?,
        })
    }

    /// Tells the simulator something that happens at `time` (ticks) and waits for its answer.
    pub(super) fn exchange(&mut self, time: u64, request: &Request<'_>) -> Result<Reply, Gone> {
        self.exchange_into(time, request, &mut [])
    }

    /// As [`Self::exchange`]; bytes read from the flash fill `sink`, as many as were asked for.
    pub(super) fn exchange_into(&mut self, time: u64, request: &Request<'_>, sink: &mut [u8]) -> Result<Reply, Gone> {
        if BROKEN.swap(true, Ordering::Relaxed) {
            return Err(Gone);
        }
        self.write(&header(time, request))?;
        if let Request::Link(bytes) | Request::Flash(FlashRequest::Write(_, bytes)) = request {
            self.write(bytes)?;
        }
        let mut answer = [0; REPLY_BYTES];
        self.read(&mut answer)?;
        let [flags, dlc, id_low, id_high, link_length, _, _, _, rest @ ..] = answer;
        let (next, rest) = rest.split_first_chunk().ok_or(Gone)?;
        let (data, rest) = rest.split_first_chunk::<8>().ok_or(Gone)?;
        let (flash_length, rest) = rest.split_first_chunk().ok_or(Gone)?;
        let status = *rest.first().ok_or(Gone)?;
        let mut reply = Reply {
            received: None,
            transmitted: flags & 2 != 0,
            next: u64::from_le_bytes(*next),
            flash: FlashReply { ready: u64::from_le_bytes(*data), status },
            link: [0; LINK_BYTES],
            link_length: usize::from(link_length),
        };
        if flags & 1 != 0 {
            let id = CanId::new(u16::from_le_bytes([id_low, id_high])).ok_or(Gone)?;
            let payload = data.get(..usize::from(dlc)).ok_or(Gone)?;
            reply.received = CanFrame::from_slice(id, payload);
        }
        let link = reply.link.get_mut(..reply.link_length).ok_or(Gone)?;
        self.read(link)?;
        let count = usize::try_from(u32::from_le_bytes(*flash_length)).map_err(|_| Gone)?;
        self.read(sink.get_mut(..count).ok_or(Gone)?)?;
        BROKEN.store(false, Ordering::Relaxed);
        Ok(reply)
    }

    fn write(&self, mut bytes: &[u8]) -> Result<(), Gone> {
        while !bytes.is_empty() {
            let count = sys::write(self.out.as_fd(), bytes).map_err(|_| Gone)?;
            bytes = bytes.get(count..).filter(|_| count > 0).ok_or(Gone)?;
        }
        Ok(())
    }

    /// Fills `bytes`; the end of the stream means that the simulator has gone.
    fn read(&self, mut bytes: &mut [u8]) -> Result<(), Gone> {
        while !bytes.is_empty() {
            let count = sys::read(self.back.as_fd(), bytes).map_err(|_| Gone)?;
            if count == 0 {
                return Err(Gone);
            }
            bytes = bytes.get_mut(count..).ok_or(Gone)?;
        }
        Ok(())
    }
}

fn header(time: u64, request: &Request<'_>) -> [u8; REQUEST_BYTES] {
    let mut bytes = [0; REQUEST_BYTES];
    let (kind, length, frame) = match request {
        Request::Send(frame) => (1, frame.payload().len(), Some(*frame)),
        Request::Event => (2, 0, None),
        Request::Bye => (3, 0, None),
        Request::Link(bytes) => (4, bytes.len(), None),
        Request::Flash(FlashRequest::Write(_, word)) => (5, word.len(), None),
        Request::Flash(_) => (5, 0, None),
    };
    bytes[0] = kind;
    bytes[1] = length as u8;
    if let Request::Flash(request) = request {
        let (operation, address, count) = match request {
            FlashRequest::Read(address, count) => (0_u16, address, *count),
            FlashRequest::Write(address, word) => (1, address, word.len() as u32),
            FlashRequest::Erase(address) => (2, address, 0),
        };
        bytes[2..4].copy_from_slice(&operation.to_le_bytes());
        bytes[16..20].copy_from_slice(&address.to_le_bytes());
        bytes[20..24].copy_from_slice(&count.to_le_bytes());
    }
    bytes[8..16].copy_from_slice(&time.to_le_bytes());
    if let Some(frame) = frame {
        bytes[2..4].copy_from_slice(&frame.can_id().raw().to_le_bytes());
        for (to, from) in bytes[16..].iter_mut().zip(frame.payload()) {
            *to = *from;
        }
    }
    bytes
}
