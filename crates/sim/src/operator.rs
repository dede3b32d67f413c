//! The operator at the pendant: releases the E-stop, presses Shift-Idle and Shift-Activate, or follows a script.
//!
//! Only a person can raise the arm's mode (docs/barrett-can.md), therefore a run without a person never moves. By
//! default this one brings the arm to IDLE after a moment and to ACTIVE once the arm is zeroed and positions have been
//! flowing for a while.

use crate::time::{TICKS_PER_MILLISECOND, Ticks};
use puck::SafetyMode;

/// An action of the operator at the pendant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PendantAction {
    /// Hits the E-stop button; it latches. Motor power is cut at once.
    #[serde(rename = "press-estop")]
    PressEStop,
    /// Turns the E-stop button until it pops out. The mode stays E-STOP until Shift-Idle.
    #[serde(rename = "release-estop")]
    ReleaseEStop,
    /// Shift and Idle: to IDLE, from E-STOP or ACTIVE; clears latched faults.
    ShiftIdle,
    /// Shift and Activate: from IDLE to ACTIVE, unless a fault is latched.
    ShiftActivate,
}

/// Behaviour of the operator.
#[derive(Clone, Debug, PartialEq)]
pub struct OperatorConfig {
    /// Time at which the E-stop is released and Shift-Idle pressed; `None`: only by the script.
    pub idle_at: Option<Ticks>,
    /// Time for which the arm must have been zeroed, and positions been flowing, before Shift-Activate is pressed;
    /// `None`: only by the script. This happens once after every release of the E-stop. After a fault or another
    /// Shift-Idle the script decides.
    pub activate_after: Option<Ticks>,
    /// He holds the arm at its first pose and lets go this long after it has become active for the first time; `None`:
    /// he does not touch it, and a sensor or hand at the wrist sinks before the arm is zeroed.
    pub holds_until_active_for: Option<Ticks>,
    /// Further actions at given times, in any order; equal times in the order given.
    pub script: Vec<(Ticks, PendantAction)>,
}

impl Default for OperatorConfig {
    /// IDLE at 50 ms, ACTIVE after 300 ms of position traffic on a zeroed arm, lets go 500 ms later, no script.
    fn default() -> Self {
        Self {
            idle_at: Some(50 * TICKS_PER_MILLISECOND),
            activate_after: Some(300 * TICKS_PER_MILLISECOND),
            holds_until_active_for: Some(500 * TICKS_PER_MILLISECOND),
            script: Vec::new(),
        }
    }
}

impl OperatorConfig {
    /// An operator before an arm that is up already: ACTIVE after 20 ms of position traffic, lets go 600 ms later, when
    /// a host that uploads first has let the arm hold itself.
    #[must_use]
    pub fn prompt() -> Self {
        Self {
            idle_at: None,
            activate_after: Some(20 * TICKS_PER_MILLISECOND),
            holds_until_active_for: Some(600 * TICKS_PER_MILLISECOND),
            script: Vec::new(),
        }
    }
}

/// The part of the arm's state that the operator can see on pendant and screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PendantView {
    /// Mode of the safety module.
    pub(crate) mode: SafetyMode,
    /// Since when the arm has been zeroed (ZERO = 1); `None` while it is not.
    pub(crate) zeroed_since: Option<Ticks>,
    /// Since when full sets of positions have been flowing without a gap; `None` while they are not.
    pub(crate) positions_since: Option<Ticks>,
}

/// The operator at the pendant.
#[derive(Clone, Debug)]
pub(crate) struct Operator {
    /// Pending actions in the order they will happen.
    script: Vec<(Ticks, PendantAction)>,
    activate_after: Option<Ticks>,
    /// The E-stop has been released and Shift-Activate not been pressed yet.
    means_to_activate: bool,
}

impl Operator {
    /// An operator who has done nothing yet.
    #[must_use]
    pub(crate) fn new(config: OperatorConfig) -> Self {
        let own = config
            .idle_at
            .into_iter()
            .flat_map(|at| [(at, PendantAction::ReleaseEStop), (at, PendantAction::ShiftIdle)]);
        let mut script: Vec<_> = own.chain(config.script).collect();
        script.sort_by_key(|(at, _)| *at); // stable: equal times keep their order
        Self { script, activate_after: config.activate_after, means_to_activate: false }
    }

    /// The E-stop was released and Shift-Idle pressed before time 0: Shift-Activate comes next.
    pub(crate) fn resume(&mut self) {
        self.means_to_activate = true;
    }

    /// Time of the next action, as far as it is known now.
    #[must_use]
    pub(crate) fn next_time(&self, view: &PendantView) -> Option<Ticks> {
        let scripted = self.script.first().map(|(at, _)| *at);
        [scripted, self.activation_time(view)].into_iter().flatten().min()
    }

    /// The action that is due at `now`, if any. Call again until there is none.
    pub(crate) fn act(&mut self, now: Ticks, view: &PendantView) -> Option<PendantAction> {
        let action = if self.script.first().is_some_and(|(at, _)| *at <= now) {
            self.script.remove(0).1
        } else if self.activation_time(view).is_some_and(|at| at <= now) {
            PendantAction::ShiftActivate
        } else {
            return None;
        };
        self.observe(action);
        Some(action)
    }

    /// An action that somebody else took at the same pendant.
    pub(crate) fn observe(&mut self, action: PendantAction) {
        self.means_to_activate = match action {
            PendantAction::ReleaseEStop => true,
            PendantAction::ShiftActivate | PendantAction::PressEStop => false,
            PendantAction::ShiftIdle => self.means_to_activate,
        };
    }

    fn activation_time(&self, view: &PendantView) -> Option<Ticks> {
        if !self.means_to_activate || view.mode != SafetyMode::Idle {
            return None;
        }
        Some(view.positions_since?.max(view.zeroed_since?) + self.activate_after?)
    }
}
