//! The hand image: a hand on a CAN bus of its own, in fixed point, for a Cortex-M3 (QEMU's mps2-an385).

#![cfg_attr(target_os = "none", no_std, no_main)]

/// The image is for a board; on the host there is nothing to run.
#[cfg(not(target_os = "none"))]
fn main() {}

/// The machine: peripherals and lines are those of `mps2-an500`, the processor is smaller.
#[cfg(target_os = "none")]
const BOARD_NAME: &str = "mps2-an385";

/// The flash of the part whose sizes the image keeps to (`memory/hand.x`).
#[cfg(target_os = "none")]
const IMAGE: link::metadata::MemoryRegion = link::metadata::MemoryRegion { start: 0, length: 256 * 1024 };

/// Who the image is, for those who have its file.
#[cfg(target_os = "none")]
#[used]
#[unsafe(link_section = ".tactus")]
static METADATA: [u8; link::metadata::METADATA_BYTES] = {
    use firmware::board::{Board, SelectedBoard};
    // No store: the library is in memory.
    firmware::metadata::block(BOARD_NAME, SelectedBoard::SIMULATED, IMAGE, None)
};

#[cfg(target_os = "none")]
#[rtic::app(device = firmware::board::device, peripherals = false, dispatchers = [DISPATCH_SESSION])]
mod app {
    use firmware::application::{ReceiveTask, SessionTask, SlotTask, StackUse, TransmitTask};
    use firmware::board::device::Interrupt;
    use firmware::board::{Board, SelectedBoard, stack};
    use firmware::hand::{self as application, Application, Memory};
    use firmware::metadata;
    use firmware::meters::Meters;
    use hand::{DeviceController, Session};

    use super::BOARD_NAME;

    static METERS: Meters = Meters::new();

    #[shared]
    struct Shared {
        core: &'static mut DeviceController,
        can: <SelectedBoard as Board>::Can,
    }

    #[local]
    struct Local {
        slot_task: SlotTask<SelectedBoard, DeviceController>,
        receive_task: ReceiveTask,
        transmit_task: TransmitTask,
        session_task: SessionTask<SelectedBoard, DeviceController>,
        session: &'static mut Session<'static>,
    }

    #[init(local = [memory: Memory = Memory::new()])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let board = SelectedBoard::start(cx.core);
        let version = metadata::FIRMWARE;
        defmt::info!("tactus hand {=str} on {=str}", version, BOARD_NAME);
        let serial = board.serial();
        let Application { core, session, can, slot_task, receive_task, transmit_task, session_task } =
            application::start(version, BOARD_NAME, serial, board.split(), cx.local.memory);
        (Shared { core, can }, Local { slot_task, receive_task, transmit_task, session_task, session })
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        loop {
            SelectedBoard::sleep();
        }
    }

    /// A slot begins.
    #[task(binds = SLOT_TIMER, priority = 12, shared = [core, can], local = [slot_task])]
    fn slot(cx: slot::Context) {
        cx.local.slot_task.run(cx.shared.core, cx.shared.can, &METERS);
        rtic::pend(Interrupt::CAN_TRANSMIT);
        // Fails while the session still works on the previous slot: it takes all there is when it comes to it.
        let _ = session::spawn();
    }

    /// The controller holds received frames.
    #[task(binds = CAN_RECEIVE, priority = 10, shared = [can], local = [receive_task])]
    fn can_receive(cx: can_receive::Context) {
        cx.local.receive_task.run(cx.shared.can, &METERS);
    }

    /// The controller has room, or there is a frame for it.
    #[task(binds = CAN_TRANSMIT, priority = 10, shared = [can], local = [transmit_task])]
    fn can_transmit(cx: can_transmit::Context) {
        cx.local.transmit_task.run(cx.shared.can);
    }

    /// Talks with the host; runs once per slot.
    #[task(priority = 2, shared = [core], local = [session_task, session])]
    async fn session(cx: session::Context) {
        cx.local.session_task.run(cx.local.session, cx.shared.core, &METERS, stack_use);
    }

    fn stack_use() -> StackUse {
        StackUse { free: stack::never_used(), size: stack::size() }
    }
}
