//! The arm image: joins the application (`device`) to the board.
//!
//! ```text
//! SLOT_TIMER 900 Hz ─> slot (12): Core ─commands<─┐      ┌─ session (2): Session <─> link port
//!                        │  ^           ─records>──┼──────┤
//!              frames out│  │frames in  ─events>───┘      └─ log (1): defmt
//!                        v  │
//! CAN_TRANSMIT ─> can_transmit (10)   can_receive (10) <─ CAN_RECEIVE
//! ```
//!
//! Numbers are priorities. The halves share nothing but queues, except where the session reads the core's health or
//! loads a primitive: then the slot waits for at most one copy.

#![no_std]
#![no_main]

#[rtic::app(device = firmware::board::device, peripherals = false, dispatchers = [DISPATCH_SESSION, DISPATCH_LOG])]
mod app {
    use control::arm::ArmModel;
    use control::{CycleRecord, LoadRefusal, Payload};
    use device::{
        Command, Core, CoreIo, Event, Health, Identity, QueueFull, RamStore, Session, SessionPort, Slot,
        StoredPrimitive, TimedRecord, Timing,
    };
    use embedded_can::nb::Can as _;
    use embedded_hal::digital::{OutputPin, PinState};
    use firmware::board::device::Interrupt;
    use firmware::board::{Board, CanStatus, Clock, Edge, LinkPort, Parts, SlotTimer, stack};
    use firmware::meters::Meters;
    use heapless::spsc::{Consumer, Producer, Queue};
    use link::image::IMAGE_BYTES_LIMIT;
    use puck::CanFrame;

    /// Frames on their way to the controller. A cycle sends at most 8, of these 5 in its control slot (torques of arm, wrist
    /// and hand, two questions to the hand); 16 hold two cycles of a dead bus.
    const OUTGOING: usize = 16;
    /// Frames on their way to the core. The bus carries at most 24 of the shortest in a slot, and each slot drains them.
    const INCOMING: usize = 32;
    /// Commands on their way to the core, which takes one per control cycle; a host waits for each answer.
    const COMMANDS: usize = 8;
    /// Cycle records on their way to the session: 50 ms, longer than it ever works in one go (checking an image).
    const RECORDS: usize = 16;
    /// Events on their way to the session: a start-up tells about 10 of them, each in a slot of its own.
    const EVENTS: usize = 16;
    /// Primitives kept, beside the one being uploaded.
    const PRIMITIVES: usize = 4;
    /// Bytes taken from the line at a time; the rest waits in the port.
    const LINK_CHUNK: usize = 128;

    type Store = RamStore<PRIMITIVES, IMAGE_BYTES_LIMIT>;

    static METERS: Meters = Meters::new();

    #[shared]
    struct Shared {
        core: Core,
        can: <Board as Edge>::Can,
    }

    #[local]
    struct Local {
        clock: <Board as Edge>::Clock,
        slot_timer: <Board as Edge>::SlotTimer,
        light: <Board as Edge>::StatusLight,
        slot: Slot,
        queues: SlotQueues,
        lost_frames: u32,
        outgoing: Consumer<'static, CanFrame>,
        incoming: Producer<'static, CanFrame>,
        session: Session<&'static mut Store>,
        session_queues: SessionQueues,
        session_clock: <Board as Edge>::Clock,
        to_tell: Consumer<'static, Event>,
        told_dropped: u32,
    }

    #[init(local = [
        outgoing_queue: Queue<CanFrame, { OUTGOING + 1 }> = Queue::new(),
        incoming_queue: Queue<CanFrame, { INCOMING + 1 }> = Queue::new(),
        commands_queue: Queue<Command, { COMMANDS + 1 }> = Queue::new(),
        records_queue: Queue<TimedRecord, { RECORDS + 1 }> = Queue::new(),
        events_queue: Queue<Event, { EVENTS + 1 }> = Queue::new(),
        log_queue: Queue<Event, { EVENTS + 1 }> = Queue::new(),
        store: Store = Store::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let board = Board::start(cx.core);
        let identity = Identity {
            firmware: concat!(env!("CARGO_PKG_VERSION"), " (", env!("TACTUS_REVISION"), ")"),
            board: Board::NAME,
            serial: board.serial(),
            simulated: Board::SIMULATED,
            ticks_per_second: <Board as Edge>::Clock::HZ,
        };
        let Parts { clock, mut slot_timer, can, link: port, light } = board.split();
        let (to_bus, outgoing) = cx.local.outgoing_queue.split();
        let (incoming, from_bus) = cx.local.incoming_queue.split();
        let (to_core, commands) = cx.local.commands_queue.split();
        let (records, from_core) = cx.local.records_queue.split();
        let (events, news) = cx.local.events_queue.split();
        let (to_log, to_tell) = cx.local.log_queue.split();
        defmt::info!("tactus arm {=str} on {=str}", identity.firmware, identity.board);
        slot_timer.start();
        (
            Shared { core: Core::new(), can },
            Local {
                clock,
                slot_timer,
                light,
                slot: Slot::Request,
                queues: SlotQueues { from_bus, to_bus, commands, records, events },
                lost_frames: 0,
                outgoing,
                incoming,
                session: Session::new(identity, ArmModel::new(Payload::SensorAndHand), cx.local.store),
                session_queues: SessionQueues { port, to_core, from_core, news, to_log },
                session_clock: clock,
                to_tell,
                told_dropped: 0,
            },
        )
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        loop {
            #[cfg(feature = "wfi")]
            cortex_m::asm::wfi();
            #[cfg(not(feature = "wfi"))]
            cortex_m::asm::nop();
        }
    }

    /// The slot task's ends of the queues.
    pub struct SlotQueues {
        from_bus: Consumer<'static, CanFrame>,
        to_bus: Producer<'static, CanFrame>,
        commands: Consumer<'static, Command>,
        records: Producer<'static, TimedRecord>,
        events: Producer<'static, Event>,
    }

    /// The world of the core during one slot.
    struct SlotIo<'a> {
        queues: &'a mut SlotQueues,
        /// The record of this slot; its cost is known only when the slot is over.
        record: Option<CycleRecord>,
    }

    impl CoreIo for SlotIo<'_> {
        fn receive(&mut self) -> Option<CanFrame> {
            self.queues.from_bus.dequeue()
        }

        fn transmit(&mut self, frame: CanFrame) -> bool {
            self.queues.to_bus.enqueue(frame).is_ok()
        }

        fn command(&mut self) -> Option<Command> {
            self.queues.commands.dequeue()
        }

        fn record(&mut self, record: CycleRecord) {
            self.record = Some(record);
        }

        fn event(&mut self, event: Event) {
            if self.queues.events.enqueue(event).is_err() {
                METERS.event_dropped();
            }
        }
    }

    /// A slot begins.
    #[task(
        binds = SLOT_TIMER,
        priority = 12,
        shared = [core, can],
        local = [clock, slot_timer, light, slot, queues, lost_frames]
    )]
    fn slot(mut cx: slot::Context) {
        let slot::LocalResources { clock, slot_timer, light, slot, queues, lost_frames, .. } = cx.local;
        METERS.slot(slot_timer.acknowledge());
        let begin = clock.short_ticks();
        let now = clock.now_us();
        let (mut late, mut lost) = (false, false);
        if *slot == Slot::Slow {
            // The torques of the control slot must have left before another frame is queued behind them.
            let (waiting, overruns) = cx.shared.can.lock(|can| (can.waiting(), can.overruns()));
            late = waiting > 0 || !queues.to_bus.is_empty();
            lost = overruns != *lost_frames;
            *lost_frames = overruns;
        }
        let mut io = SlotIo { queues, record: None };
        cx.shared.core.lock(|core| {
            if late {
                core.note_overrun();
            }
            if lost {
                core.note_bus_error(false);
            }
            core.slot(*slot, now, &mut io);
        });
        let record = io.record;
        let cost_ticks = clock.short_ticks().wrapping_sub(begin);
        if let Some(record) = record {
            METERS.control(cost_ticks);
            // A light that cannot be switched must not stop the arm.
            let _ = light.set_state(PinState::from(record.state.has_torque()));
            // A session that lags 50 ms behind loses telemetry, which its host sees by the cycle numbers.
            let _ = queues.records.enqueue(TimedRecord { record, cost_ticks });
        }
        rtic::pend(Interrupt::CAN_TRANSMIT);
        // Fails while the session still works on the previous slot: it takes all there is when it comes to it.
        let _ = session::spawn();
        *slot = slot.next();
        if slot_timer.is_due() {
            cx.shared.core.lock(Core::note_overrun);
        }
    }

    /// The controller holds received frames.
    #[task(binds = CAN_RECEIVE, priority = 10, shared = [can], local = [incoming])]
    fn can_receive(mut cx: can_receive::Context) {
        while let Ok(frame) = cx.shared.can.lock(|can| can.receive()) {
            if cx.local.incoming.enqueue(frame).is_err() {
                METERS.frame_dropped();
            }
        }
    }

    /// The controller has room, or there is a frame for it.
    #[task(binds = CAN_TRANSMIT, priority = 10, shared = [can], local = [outgoing])]
    fn can_transmit(mut cx: can_transmit::Context) {
        while let Some(frame) = cx.local.outgoing.peek() {
            if cx.shared.can.lock(|can| can.transmit(frame)).is_err() {
                // It interrupts again when a mailbox is free.
                break;
            }
            cx.local.outgoing.dequeue();
        }
    }

    /// The session's ends of the queues, and its line.
    pub struct SessionQueues {
        port: <Board as Edge>::LinkPort,
        to_core: Producer<'static, Command>,
        from_core: Consumer<'static, TimedRecord>,
        news: Consumer<'static, Event>,
        to_log: Producer<'static, Event>,
    }

    /// The world of the session during one poll.
    struct SessionEdge<'a, C> {
        queues: &'a mut SessionQueues,
        core: C,
    }

    impl<C: rtic::Mutex<T = Core>> SessionPort for SessionEdge<'_, C> {
        fn send(&mut self, bytes: &[u8]) {
            self.queues.port.write(bytes);
        }

        fn room(&self) -> usize {
            self.queues.port.room()
        }

        fn command(&mut self, command: Command) -> Result<(), QueueFull> {
            self.queues.to_core.enqueue(command).map_err(|_| QueueFull)
        }

        fn load(&mut self, primitive: &StoredPrimitive) -> Result<(), LoadRefusal> {
            self.core.lock(|core| core.load(primitive))
        }

        fn record(&mut self) -> Option<TimedRecord> {
            self.queues.from_core.dequeue()
        }

        fn event(&mut self) -> Option<Event> {
            let event = self.queues.news.dequeue()?;
            // The log is for people; if it lags, the link still has every event.
            let _ = self.queues.to_log.enqueue(event);
            Some(event)
        }

        fn health(&mut self) -> Health {
            self.core.lock(|core| core.health())
        }

        fn timing(&mut self) -> Timing {
            Timing {
                cost_worst_ticks: METERS.cost_worst(),
                cost_mean_ticks: METERS.cost_mean(),
                latency_worst_ticks: METERS.latency_worst(),
                stack_free: stack::never_used(),
                stack_size: stack::size(),
            }
        }
    }

    /// Talks with the host; runs once per slot.
    #[task(priority = 2, shared = [core], local = [session, session_queues, session_clock])]
    async fn session(cx: session::Context) {
        let session::LocalResources { session, session_queues: queues, session_clock, .. } = cx.local;
        let mut bytes = [0; LINK_CHUNK];
        loop {
            let count = queues.port.read(&mut bytes);
            session.receive(bytes.get(..count).unwrap_or(&[]));
            if count < LINK_CHUNK {
                break;
            }
        }
        let mut edge = SessionEdge { queues, core: cx.shared.core };
        session.poll(session_clock.now_us(), &mut edge);
        if !edge.queues.to_log.is_empty() {
            // Fails while the log is being written: it takes all there is.
            let _ = log::spawn();
        }
    }

    /// Tells people what happened.
    #[task(priority = 1, local = [to_tell, told_dropped])]
    async fn log(cx: log::Context) {
        while let Some(event) = cx.local.to_tell.dequeue() {
            defmt::info!("cycle {=u64}: {}", event.cycle, defmt::Debug2Format(&event.kind));
        }
        let dropped = METERS.dropped();
        if dropped != *cx.local.told_dropped {
            *cx.local.told_dropped = dropped;
            defmt::warn!("{=u32} frames or events lost between the tasks", dropped);
        }
    }
}
