//! The arm image: binds the tasks of the application to the interrupts of the board, and says what they share.

#![cfg_attr(target_os = "none", no_std, no_main)]

/// The image is for a board; on the host there is nothing to run.
#[cfg(not(target_os = "none"))]
fn main() {}

/// Who the image is, for those who have its file.
#[cfg(target_os = "none")]
#[used]
#[unsafe(link_section = ".tactus")]
static METADATA: [u8; link::metadata::METADATA_BYTES] = {
    use firmware::board::{Board, SelectedBoard, device};
    firmware::metadata::block(SelectedBoard::NAME, SelectedBoard::SIMULATED, device::IMAGE, device::STORE)
};

// RTIC gives the first line to the lowest priority among the software tasks, which is that of the log.
#[cfg(target_os = "none")]
#[rtic::app(device = firmware::board::device, peripherals = false, dispatchers = [DISPATCH_LOG, DISPATCH_SESSION])]
mod app {
    use device::{DeviceController, FaultMemory};
    use firmware::application::{
        self, Application, ArmSession, CorePlace, LogTask, Memory, ReceiveTask, SessionTask, SlotTask, StackUse,
        StorageScratch, TransmitTask,
    };
    use firmware::board::device::Interrupt;
    use firmware::board::{Board, SelectedBoard, stack};
    use firmware::defmt_log::DefmtLog;
    use firmware::metadata;
    use firmware::meters::Meters;

    static METERS: Meters = Meters::new();

    #[shared]
    struct Shared {
        core: &'static mut DeviceController,
        can: <SelectedBoard as Board>::Can,
        session: &'static mut ArmSession,
    }

    #[local]
    struct Local {
        slot_task: SlotTask<SelectedBoard, DeviceController>,
        receive_task: ReceiveTask,
        transmit_task: TransmitTask,
        session_task: SessionTask<SelectedBoard, DeviceController>,
        log_task: LogTask,
        flash: <SelectedBoard as Board>::Flash,
    }

    #[init(local = [
        memory: Memory = Memory::new(),
        // Beside what the tasks own, for which RTIC uses this section.
        #[unsafe(link_section = ".uninit.core")]
        core: CorePlace = CorePlace::uninit(),
        // Nobody clears it: it holds what it held before a restart.
        #[unsafe(link_section = ".uninit.fault_memory")]
        faults: FaultMemory = FaultMemory::BLANK,
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let board = SelectedBoard::start(cx.core);
        let version = metadata::FIRMWARE;
        defmt::info!("tactus arm {=str} on {=str}", version, SelectedBoard::NAME);
        let serial = board.serial();
        // The compiler would take it for blank.
        let faults = core::hint::black_box(cx.local.faults);
        let Application { core, can, session, slot_task, receive_task, transmit_task, session_task, log_task, flash } =
            application::start(version, serial, board.split(), cx.local.memory, cx.local.core, faults);
        (Shared { core, can, session }, Local { slot_task, receive_task, transmit_task, session_task, log_task, flash })
    }

    /// Keeps the library on the flash; sleeps otherwise.
    #[idle(shared = [session], local = [flash, room: StorageScratch = StorageScratch::new()])]
    fn idle(cx: idle::Context) -> ! {
        application::rest(
            application::keep_library(cx.local.flash, cx.local.room, cx.shared.session, DefmtLog),
            SelectedBoard::sleep,
        )
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
    #[task(priority = 2, shared = [core, session], local = [session_task])]
    async fn session(mut cx: session::Context) {
        let (task, core) = (cx.local.session_task, cx.shared.core);
        if cx.shared.session.lock(|session| task.run(session, core, &METERS, stack_use)) {
            // Fails while the log is being written: it takes all there is.
            let _ = log::spawn();
        }
    }

    /// Tells people what happened.
    #[task(priority = 1, local = [log_task])]
    async fn log(cx: log::Context) {
        cx.local.log_task.run(&METERS, &mut DefmtLog);
    }

    fn stack_use() -> StackUse {
        StackUse { free: stack::never_used(), size: stack::size() }
    }
}
