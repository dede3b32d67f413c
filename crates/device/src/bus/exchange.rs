//! One question and its answer: GET a property, wait, ask again, give up.

use puck::{Node, PropertyId, get};

use crate::bus::Outlet;

/// Longest wait for an answer, us. A puck in wake-up needs up to 50 ms; all others answer within 1 ms.
const TIMEOUT_US: u64 = 50_000;
/// Times that a question is put before the node counts as silent. A lost frame must not fail a start-up.
const ATTEMPTS: u8 = 3;

/// State of a question.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Not yet.
    Pending,
    /// The value of the property.
    Value(i32),
    /// No answer, and no more attempts.
    Silent,
}

#[derive(Clone, Copy, Debug)]
struct Question {
    node: Node,
    property: PropertyId,
    deadline_us: u64,
    attempts: u8,
    value: Option<i32>,
}

/// The question under way, if there is one.
#[derive(Clone, Copy, Debug, Default)]
pub struct Exchange {
    question: Option<Question>,
}

impl Exchange {
    /// Puts the question, or looks how it stands. To be called with the same arguments until it is no longer pending.
    pub fn ask(&mut self, node: Node, property: PropertyId, outlet: &mut impl Outlet) -> Answer {
        let deadline_us = outlet.now_us() + TIMEOUT_US;
        match &mut self.question {
            Some(question) if question.node == node && question.property == property => {
                if let Some(value) = question.value {
                    self.question = None;
                    return Answer::Value(value);
                }
                if outlet.now_us() < question.deadline_us {
                    return Answer::Pending;
                }
                if question.attempts >= ATTEMPTS {
                    self.question = None;
                    return Answer::Silent;
                }
                if outlet.send(get(node, property)) {
                    question.attempts += 1;
                    question.deadline_us = deadline_us;
                }
            }
            // No question, or one that its asker has abandoned.
            _ => {
                if outlet.send(get(node, property)) {
                    self.question = Some(Question { node, property, deadline_us, attempts: 1, value: None });
                }
            }
        }
        Answer::Pending
    }

    /// A property reply has come; whether it was asked for.
    pub fn receive(&mut self, node: Node, property: PropertyId, value: i32) -> bool {
        match &mut self.question {
            Some(question) if question.node == node && question.property == property => {
                question.value = Some(value);
                true
            }
            _ => false,
        }
    }

    /// Forgets the question: what still comes is nobody's answer.
    pub fn abandon(&mut self) {
        self.question = None;
    }
}
