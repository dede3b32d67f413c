//! The start of the bus: from power-up to a cyclic loop, as a state machine that sends at most one frame per slot.
//!
//! Nothing here sends a torque other than zero, wakes or zeroes a puck while the safety module is ACTIVE, or goes on
//! after a device has said something unexpected. After a failure it rests for a second and begins anew.
//!
//! Zero torque and IDLE to everything come first. Then the order is that of Barrett's library and drivers: enumerate,
//! reload the limits of the safety module, wait for IDLE, enumerate again (the pucks have power only now), wake,
//! verify, read, zero, tare, one position read, then the cyclic loop. Each step sends through an outlet that may refuse
//! (a pause is not over); it then simply tries again in the next slot.

mod angles;
mod continuity;
mod hand;
mod home;
mod rest;
mod survey;
mod waking;
mod zeroing;

use control::{Calibration, Payload};
use puck::{Counts, Node, PropertyId, Reply, force_torque, set};

use crate::bus::{Answer, Exchange, Outlet};
use crate::command::Refusal;
use crate::stage::{Stage, StartupError};
use angles::MotorAngles;
use continuity::Continuity;
use hand::HandSurvey;
use rest::Rest;
pub(crate) use survey::SafetyProperties;
use survey::Survey;

/// Between two looks at the mode of the safety module while a person is awaited, us.
const POLL_US: u64 = 250_000;
/// Rest of a failed start-up before it is tried again, us.
const RETRY_US: u64 = 1_000_000;
/// Velocity faults the safety module shall ignore when positions are rewritten.
const IGNORED_AT_ZERO: i32 = 8;
/// Velocity faults it shall ignore when polling begins: the length of its history.
const IGNORED_AT_START: i32 = 5;
/// Time for which a start-up repeats its stop frames, us: the first ones may have been lost.
const STOPPING_US: u64 = 500_000;
/// Time for which they take every slot, us: an arm that neither pulls nor brakes reaches 0.25 m/s within 30 ms.
const STOPS_ONLY_US: u64 = 100_000;
/// Between two of these frames afterwards, us.
const STOP_PACE_US: u64 = 3_000;
/// Words that take its zero back from the safety module: it acknowledges none, one may be lost, and a device that is
/// started anew believes it.
const REVOCATIONS: u8 = 3;
/// Transitions within one slot; more would mean a loop.
const TRANSITIONS: usize = 8;
/// First and last node that an enumeration asks.
const ENUMERATED: core::ops::RangeInclusive<u8> = 1..=31;

/// Where the start-up stands.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    /// Take off what torque may still be applied: frames 0 and 1 zero torques, then MODE IDLE to the arm and to the
    /// hand.
    ZeroTorques { frame: u8 },
    /// Ask this node for its STAT.
    Enumerate { node: u8, powered: bool },
    /// Hear the last answers.
    Listen { until_us: u64, powered: bool },
    /// ROLE (0) and VERS (1) of the safety module.
    IdentifySafety { item: u8 },
    /// DEF (0), LOAD (1) and GET STAT (2) of a limit, then its value (3).
    LoadLimit { limit: u8, part: u8 },
    /// Ask for the safety module's mode from this time on.
    AwaitIdle { next_us: u64 },
    /// ROLE of each device of the arm.
    Identify { device: u8 },
    /// SET STAT to each sleeping device.
    Wake { device: u8, woken: bool },
    /// Send nothing.
    Silence { until_us: u64 },
    /// STAT (0) and VERS (1) of each device.
    Verify { device: u8, item: u8 },
    /// SET MODE IDLE to the arm, and to what there is of a hand.
    Brake { hand: bool },
    /// A property of a puck.
    Read { joint: u8, item: u8 },
    /// A property of a hand puck.
    ReadHand { digit: u8, item: u8 },
    /// Ask whether the arm is zeroed.
    AskZero,
    /// Wait for a person; look at the safety module or a puck, in turn, from this time on.
    AwaitZero { next_us: u64, look: u8 },
    /// Ask whether the arm is IDLE, until this time; before it is looked at, and again before its positions are
    /// rewritten.
    ConfirmIdle { until_us: Option<u64>, rests: bool },
    /// Look whether the arm stands still.
    AwaitRest(Rest),
    /// IFAULT before positions are rewritten, until this time.
    IgnoreFaults { until_us: u64 },
    /// SET P of a puck, until this time.
    WritePosition { joint: u8, until_us: u64 },
    /// Read the positions back; `until_us` once the request has left.
    CheckPositions { until_us: Option<u64> },
    /// SET ZERO.
    TellZero,
    /// GET ZERO.
    ConfirmZero,
    /// SET ZERO = 0: what the safety module believes is no longer so. This word of several.
    RevokeZero { word: u8 },
    /// Tare the force/torque sensor.
    Tare,
    /// IFAULT before polling begins.
    IgnoreFirstFaults,
    /// The positions before the angles are read.
    FirstPositions { until_us: Option<u64> },
    /// MECH of each motor that has an absolute angle.
    ReadAngle { joint: u8 },
    /// The positions after that.
    LastPositions { until_us: Option<u64> },
    /// Done: the cyclic loop has the bus.
    Done,
    /// Failed; rest, then begin anew.
    Blocked { until_us: u64 },
}

/// Stop frames that are repeated while the start-up goes on.
#[derive(Clone, Copy, Debug, Default)]
struct Stopping {
    /// Time of the first, us.
    since_us: Option<u64>,
    /// Earliest time of the next, us.
    next_us: u64,
    /// Which one is next.
    frame: u8,
}

/// Decision of a step.
enum Next {
    /// Wait for an answer, a pause or a person.
    Stay,
    /// Go on with this step.
    Go(Step),
}

/// The start-up.
#[derive(Clone, Debug)]
pub(crate) struct Startup {
    step: Step,
    /// The arm may have had torque a moment ago: in the cyclic loop, or from a board that has restarted.
    stopping: Option<Stopping>,
    /// Begun after the cyclic loop: counts that a person has zeroed are not to change unseen.
    continuity: Option<Continuity>,
    angles: MotorAngles,
    exchange: Exchange,
    survey: Survey,
    hand: HandSurvey,
    enumerations: u8,
    safety: Option<SafetyProperties>,
    calibration: Option<Calibration<f32>>,
    targets: [Counts; 7],
    /// The counts at the first look before a zeroing.
    first_look: [Option<Counts>; 7],
    positions: [Option<Counts>; 7],
    zeroed: bool,
    /// The sensor has been tared since it was woken. It is not tared again then: something may press on it.
    tared: bool,
    /// It has been tared, and nobody has asked for that yet.
    tared_anew: bool,
    /// Why the counts do not refer to the zero of the arm, whatever the safety module says, until a person zeroes.
    doubt: Option<StartupError>,
    /// Words with which the safety module is still to be told so.
    revocations: u8,
    /// The safety module's word about the zero before any puck was woken; none has been heard yet.
    zero_before: Option<bool>,
    /// Payload that a person has declared.
    declared: Option<Payload>,
    /// The posture that `targets` are the counts of (rad).
    home: [f32; 7],
    /// The same once the arm has been zeroed there, for as long as that zero is not lost.
    zeroed_at: Option<[f32; 7]>,
    zero_request: ZeroRequest,
    /// It was given in the cyclic loop, which goes on if it comes to nothing, zeroed or not.
    from_loop: bool,
    error: Option<StartupError>,
}

/// State of a person's command to zero the arm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum ZeroRequest {
    /// There is none, or its answer has been fetched.
    #[default]
    None,
    /// The safety module is being asked whether the arm is IDLE: what it said last may be 250 ms old.
    Pending,
    /// Accepted or refused.
    Answered(Result<(), Refusal>),
}

impl Startup {
    /// Begins at the beginning. The first frames take off what torque may still be applied: pucks keep the last torque
    /// they were sent, and a board that was reset does not know whether its arm is ACTIVE.
    pub(crate) fn new() -> Startup {
        Startup {
            step: Step::ZeroTorques { frame: 0 },
            stopping: Some(Stopping::default()),
            continuity: None,
            angles: MotorAngles::default(),
            exchange: Exchange::default(),
            survey: Survey::new(),
            hand: HandSurvey::default(),
            enumerations: 0,
            safety: None,
            calibration: None,
            targets: [Counts(0); 7],
            first_look: [None; 7],
            positions: [None; 7],
            zeroed: false,
            tared: false,
            tared_anew: false,
            doubt: None,
            revocations: 0,
            zero_before: None,
            declared: None,
            home: [0.0; 7],
            zeroed_at: None,
            zero_request: ZeroRequest::None,
            from_loop: false,
            error: None,
        }
    }

    /// Begins anew after the cyclic loop. A doubt about the zero stays. `last`: the counts of the motors as the loop
    /// knew them, and how many cycles ago.
    #[cold]
    #[inline(never)]
    pub(crate) fn restart(&mut self, now_us: u64, last: Option<[(Counts, u8); 7]>) {
        *self = Startup {
            doubt: self.doubt,
            revocations: self.revocations,
            tared: self.tared,
            tared_anew: self.tared_anew,
            angles: self.angles,
            declared: self.declared,
            zeroed_at: self.zeroed_at,
            // Given in this very slot, it is told behind it.
            zero_request: self.zero_request,
            hand: self.hand.after_loop(),
            stopping: Some(Stopping::default()),
            continuity: Some(Continuity::since(now_us, last)),
            ..Startup::new()
        };
    }

    /// The counts of a motor have jumped in the cyclic loop.
    #[cold]
    #[inline(never)]
    pub(crate) fn lose_zero(&mut self) {
        self.lose_zero_by(StartupError::CountsJumped);
    }

    /// A zero by which a joint stands where its stops do not let it go is none: counts may jump while nobody looks, by
    /// less than the arm could have turned. True if that has cost the zero now.
    pub(crate) fn doubts_posture(&mut self, counts: &[Counts; 7]) -> bool {
        let calibration = self.calibration.as_ref().filter(|_| self.zeroed);
        let beyond = calibration.and_then(|calibration| home::beyond_stops(calibration, counts));
        if let Some(joint) = beyond {
            self.lose_zero_by(StartupError::BeyondStops { joint });
        }
        beyond.is_some()
    }

    #[cold]
    fn lose_zero_by(&mut self, reason: StartupError) {
        if self.doubt.is_none() {
            self.revocations = REVOCATIONS;
        }
        let doubt = *self.doubt.get_or_insert(reason);
        if self.is_done() {
            self.error = Some(doubt);
        }
        self.zeroed = false;
        self.zeroed_at = None;
    }

    /// Tells the safety module that the zero is lost; true if a word has left.
    pub(crate) fn revoke_zero(&mut self, outlet: &mut impl Outlet) -> bool {
        let (Some(safety), Some(left)) = (self.safety, self.revocations.checked_sub(1)) else { return false };
        let sent = outlet.send(set(Node::SAFETY_MODULE, safety.zero, 0));
        if sent {
            self.revocations = left;
        }
        sent
    }

    /// True, once, if the sensor has been tared: what was its zero is none any more.
    pub(crate) fn take_tare(&mut self) -> bool {
        core::mem::take(&mut self.tared_anew)
    }

    /// Its stage.
    pub(crate) fn stage(&self) -> Stage {
        match self.step {
            Step::ZeroTorques { .. } | Step::Enumerate { .. } | Step::Listen { .. } => Stage::Enumerating,
            Step::IdentifySafety { .. } | Step::LoadLimit { .. } => Stage::LoadingLimits,
            Step::AwaitIdle { .. } => Stage::WaitingForIdle,
            Step::Identify { .. } | Step::Wake { .. } | Step::Silence { .. } => Stage::Waking,
            Step::Verify { .. } => Stage::Verifying,
            Step::Brake { .. } | Step::Read { .. } | Step::ReadHand { .. } | Step::AskZero => Stage::Reading,
            Step::AwaitZero { .. } | Step::ConfirmIdle { .. } | Step::AwaitRest(_) | Step::RevokeZero { .. } => {
                Stage::WaitingForZero
            }
            Step::IgnoreFaults { .. }
            | Step::WritePosition { .. }
            | Step::CheckPositions { .. }
            | Step::TellZero
            | Step::ConfirmZero => Stage::Zeroing,
            Step::Tare
            | Step::IgnoreFirstFaults
            | Step::FirstPositions { .. }
            | Step::ReadAngle { .. }
            | Step::LastPositions { .. } => Stage::Preparing,
            Step::Done if !self.zeroed => Stage::WaitingForZero,
            Step::Done => Stage::WaitingForActive,
            Step::Blocked { .. } => Stage::Blocked,
        }
    }

    /// True if the cyclic loop has the bus.
    pub(crate) fn is_done(&self) -> bool {
        self.step == Step::Done
    }

    /// Why it does not go on, if it does not. Survives the retries until it is done or waits for a person.
    pub(crate) fn error(&self) -> Option<StartupError> {
        self.error
    }

    /// True if the safety module says that positions count from a known pose.
    pub(crate) fn is_zeroed(&self) -> bool {
        self.zeroed
    }

    /// The posture (rad) at which it was zeroed; `None` if the device was not there.
    pub(crate) fn zeroed_at(&self) -> Option<[f32; 7]> {
        self.zeroed_at.filter(|_| self.zeroed)
    }

    /// The scales of this arm, once read.
    pub(crate) fn calibration(&self) -> Option<&Calibration<f32>> {
        self.calibration.as_ref()
    }

    /// The property numbers of the safety module, once known.
    pub(crate) fn safety_properties(&self) -> Option<&SafetyProperties> {
        self.safety.as_ref()
    }

    /// True if a force/torque sensor answered.
    pub(crate) fn has_sensor(&self) -> bool {
        self.survey.is_present(Node::FORCE_TORQUE)
    }

    /// Whom to ask because the start-up did not find them, or lost their answers: the sensor, and a puck of the hand.
    /// One puck of four tells nothing of what the arm carries, so the start-up is not begun anew for it unless the arm
    /// `rests`, IDLE.
    pub(crate) fn absent(&self, rests: bool) -> (bool, Option<Node>) {
        let digit = self.survey.missing_digit().or_else(|| self.hand.worth_another());
        (!self.has_sensor(), digit.filter(|_| rests || !self.survey.has_digits()))
    }

    /// The reason for which the start-up begins anew.
    pub(crate) fn note(&mut self, error: StartupError) {
        self.error = Some(error);
    }

    /// A person has declared what the arm carries, or takes that back.
    pub(crate) fn declare(&mut self, payload: Option<Payload>) {
        self.declared = payload;
    }

    /// The reason to stop where another payload is declared than was found.
    pub(crate) fn contradiction(&self) -> Option<StartupError> {
        let found = self.calibration.as_ref()?.payload();
        let declared = self.declared.filter(|declared| *declared != found)?;
        Some(StartupError::PayloadContradicted { hand: declared == Payload::SensorAndHand })
    }

    /// A reply has come in; whether it was expected.
    pub(crate) fn receive(&mut self, reply: &Reply) -> bool {
        match *reply {
            Reply::Property { node, property, value } => {
                let enumerating = matches!(self.step, Step::Enumerate { .. } | Step::Listen { .. });
                if enumerating && property == PropertyId::STAT {
                    self.survey.note_status(node, value);
                    return true;
                }
                self.exchange.receive(node, property, value)
            }
            Reply::Position { node, primary, .. } => {
                let asked = matches!(
                    self.step,
                    Step::AwaitRest(Rest { until_us: Some(_), .. })
                        | Step::CheckPositions { until_us: Some(_) }
                        | Step::FirstPositions { until_us: Some(_) }
                        | Step::LastPositions { until_us: Some(_) }
                );
                let Some(joint) = node.arm_index() else { return false };
                let continuity = self.continuity.as_mut();
                if continuity.is_some_and(|continuity| continuity.has_jumped(joint, primary)) {
                    self.lose_zero();
                }
                match self.positions.get_mut(joint) {
                    Some(place) if asked => {
                        *place = Some(primary);
                        true
                    }
                    _ => self.continuity.is_some(),
                }
            }
            _ => false,
        }
    }

    /// One slot. Returns whether the start-up has ended and the cyclic loop may take over.
    pub(crate) fn advance(&mut self, outlet: &mut impl Outlet) -> bool {
        if self.repeats_stop(outlet) || self.looks(outlet) {
            return false;
        }
        for _ in 0..TRANSITIONS {
            match self.perform(outlet) {
                Ok(Next::Stay) => break,
                Ok(Next::Go(step)) => self.step = step,
                Err(error) => {
                    self.exchange.abandon();
                    self.error = Some(error);
                    if self.is_zero_pending() {
                        self.zero_request = ZeroRequest::Answered(Err(Refusal::NotReady(Stage::Blocked)));
                    }
                    self.step = Step::Blocked { until_us: outlet.now_us() + RETRY_US };
                    break;
                }
            }
            if self.is_done() {
                // A jump in the last step has cost the zero.
                self.error = self.doubt.filter(|_| !self.zeroed);
                return true;
            }
        }
        false
    }

    /// Looks at the counts if it is time to and the bus need not be quiet; true if the slot is used.
    fn looks(&mut self, outlet: &mut impl Outlet) -> bool {
        match self.step {
            Step::ZeroTorques { .. } | Step::Wake { .. } | Step::Silence { .. } => false,
            Step::AwaitRest(_)
            | Step::CheckPositions { .. }
            | Step::FirstPositions { .. }
            | Step::LastPositions { .. } => false,
            Step::WritePosition { .. } => {
                // From here on the counts are those that a person says.
                self.continuity = None;
                self.angles.forget();
                false
            }
            step => {
                let is_idle = !matches!(
                    step,
                    Step::Enumerate { powered: false, .. }
                        | Step::Listen { powered: false, .. }
                        | Step::IdentifySafety { .. }
                        | Step::LoadLimit { .. }
                        | Step::AwaitIdle { .. }
                );
                self.continuity.as_mut().is_some_and(|continuity| continuity.look(is_idle, outlet))
            }
        }
    }

    /// Does what the present step asks.
    fn perform(&mut self, outlet: &mut impl Outlet) -> Result<Next, StartupError> {
        match self.step {
            Step::ZeroTorques { frame } => Ok(self.take_torque_off(frame, outlet)),
            Step::Enumerate { node, powered } => Ok(self.enumerate(node, powered, outlet)),
            Step::Listen { until_us, powered } if outlet.now_us() < until_us => Ok(self.listen(powered, outlet)),
            Step::Listen { powered: false, .. } => {
                if !self.survey.is_present(Node::SAFETY_MODULE) {
                    return Err(StartupError::NoSafetyModule);
                }
                Ok(Next::Go(Step::IdentifySafety { item: 0 }))
            }
            Step::Listen { powered: true, .. } => self.count_pucks(),
            Step::IdentifySafety { item } => self.identify_safety(item, outlet),
            Step::LoadLimit { limit, part } => self.load_limit(limit, part, outlet),
            Step::AwaitIdle { next_us } => self.await_idle(next_us, outlet),
            Step::Identify { device } => self.identify(device, outlet),
            Step::Wake { device, woken } => Ok(self.wake(device, woken, outlet)),
            Step::Silence { until_us } if outlet.now_us() < until_us => Ok(Next::Stay),
            Step::Silence { .. } => Ok(Next::Go(Step::Verify { device: 0, item: 0 })),
            Step::Verify { device, item } => self.verify(device, item, outlet),
            Step::Brake { hand } => Ok(self.brake(hand, outlet)),
            Step::Read { joint, item } => self.read(joint, item, outlet),
            Step::ReadHand { digit, item } => Ok(self.read_digit(digit, item, outlet)),
            Step::AskZero => self.ask_zero(outlet),
            Step::RevokeZero { word: REVOCATIONS.. } => Ok(self.await_next_zero(outlet)),
            Step::RevokeZero { word } => {
                let frame = set(Node::SAFETY_MODULE, self.safety()?.zero, 0);
                Ok(after(outlet.send(frame), Step::RevokeZero { word: word + 1 }))
            }
            Step::AwaitZero { next_us, look } => self.await_zero(next_us, look, outlet),
            Step::ConfirmIdle { until_us, rests } => self.confirm_idle(until_us, rests, outlet),
            Step::AwaitRest(rest) => self.await_rest(rest, outlet),
            Step::IgnoreFaults { until_us } | Step::WritePosition { until_us, .. } if outlet.now_us() >= until_us => {
                Err(StartupError::ZeroUnfinished)
            }
            Step::IgnoreFaults { until_us } => {
                let frame = set(Node::SAFETY_MODULE, self.safety()?.ignore_faults, IGNORED_AT_ZERO);
                Ok(after(outlet.send(frame), Step::WritePosition { joint: 0, until_us }))
            }
            Step::WritePosition { joint, until_us } => Ok(self.write_position(joint, until_us, outlet)),
            Step::CheckPositions { until_us } => self.check_positions(until_us, outlet),
            Step::TellZero => {
                let frame = set(Node::SAFETY_MODULE, self.safety()?.zero, 1);
                Ok(after(outlet.send(frame), Step::ConfirmZero))
            }
            Step::ConfirmZero => self.confirm_zero(outlet),
            Step::Tare if !self.has_sensor() || self.tared => Ok(Next::Go(Step::IgnoreFirstFaults)),
            Step::Tare => {
                self.tared = outlet.send(force_torque::tare());
                self.tared_anew |= self.tared;
                Ok(after(self.tared, Step::IgnoreFirstFaults))
            }
            Step::IgnoreFirstFaults => {
                let frame = set(Node::SAFETY_MODULE, self.safety()?.ignore_faults, IGNORED_AT_START);
                Ok(after(outlet.send(frame), Step::FirstPositions { until_us: None }))
            }
            Step::FirstPositions { until_us } => {
                let next = Step::ReadAngle { joint: 0 };
                self.read_positions(until_us, next, outlet, |until_us| Step::FirstPositions { until_us })
            }
            Step::ReadAngle { joint } => self.read_angle(joint, outlet),
            Step::LastPositions { until_us } => {
                let next =
                    self.read_positions(until_us, Step::Done, outlet, |until_us| Step::LastPositions { until_us })?;
                Ok(if matches!(next, Next::Go(Step::Done)) { self.compare_angles() } else { next })
            }
            Step::Done => Ok(Next::Stay),
            Step::Blocked { until_us } if outlet.now_us() < until_us => Ok(Next::Stay),
            Step::Blocked { .. } => {
                self.try_again();
                Ok(Next::Stay)
            }
        }
    }

    /// A start-up that has failed has rested.
    fn try_again(&mut self) {
        let (error, doubt, hand) = (self.error, self.doubt, self.hand.again());
        let (continuity, tared, angles, declared) = (self.continuity, self.tared, self.angles, self.declared);
        // The answer to a person who wanted to zero in this very slot is told behind it.
        let (tared_anew, stopping, zero_request) = (self.tared_anew, self.stopping, self.zero_request);
        let (zeroed_at, revocations) = (self.zeroed_at, self.revocations);
        *self = Startup { error, doubt, hand, continuity, tared, angles, declared, zeroed_at, ..Startup::new() };
        self.revocations = revocations;
        (self.tared_anew, self.stopping, self.zero_request) = (tared_anew, stopping, zero_request);
    }

    fn safety(&self) -> Result<&SafetyProperties, StartupError> {
        self.safety.as_ref().ok_or(StartupError::NoSafetyModule)
    }

    /// Asks a node; `None` while no answer has come.
    fn ask(&mut self, node: Node, property: PropertyId, outlet: &mut impl Outlet) -> Result<Option<i32>, StartupError> {
        match self.exchange.ask(node, property, outlet) {
            Answer::Pending => Ok(None),
            Answer::Value(value) => Ok(Some(value)),
            Answer::Silent => Err(StartupError::NoAnswer(node)),
        }
    }

    fn ask_safety(&mut self, property: PropertyId, outlet: &mut impl Outlet) -> Result<Option<i32>, StartupError> {
        self.ask(Node::SAFETY_MODULE, property, outlet)
    }
}

/// Go on once something has happened.
fn after(happened: bool, step: Step) -> Next {
    if happened { Next::Go(step) } else { Next::Stay }
}
