//! The runs in a recording: from where to where a plan was played.

use std::ops::Range;

use control::State;

use super::recording::Recording;

/// A phase that is larger than the one before it by this factor is that of a movement begun anew: within one it only
/// falls.
const ANEW: f64 = 1.1;

impl Recording {
    /// The samples of each run, in their order; all of them if nothing was recorded of states.
    ///
    /// A run is played in state `run`, and lost answers of motors put it into `coast` for a moment. They do that to an
    /// arm that holds or goes to the start as well: what only coasts is no run.
    #[must_use]
    pub fn runs(&self) -> Vec<Range<usize>> {
        let Some(states) = &self.state else {
            return std::iter::once(0..self.len()).collect();
        };
        let is = |sample: usize, state: State| states[sample] == state.name();
        let mut stretches: Vec<Range<usize>> = Vec::new();
        for sample in (0..self.len()).filter(|&sample| is(sample, State::Run) || is(sample, State::Coast)) {
            match stretches.last_mut() {
                Some(stretch) if stretch.end == sample && !self.begins_anew(sample) => stretch.end += 1,
                _ => stretches.push(sample..sample + 1),
            }
        }
        let played = |stretch: &Range<usize>| Some(stretch.clone().find(|&at| is(at, State::Run))?..stretch.end);
        stretches.iter().filter_map(played).collect()
    }

    /// The last run, as a recording of its own; the whole recording if it has no states.
    ///
    /// A run is recorded from before the arm moves until it holds at the goal: comparing it with its plan needs the
    /// part in between. Two of them, recorded by a program that looks on, are not one: the arm went back in between.
    #[must_use]
    pub fn running(&self) -> Recording {
        let last = self.runs().pop().unwrap_or_default();
        self.select(&last.collect::<Vec<_>>())
    }

    fn begins_anew(&self, sample: usize) -> bool {
        let phase = |at: usize| self.phase.as_ref().and_then(|all| all.get(at)).copied().unwrap_or(0.0);
        phase(sample - 1) > 0.0 && phase(sample) > ANEW * phase(sample - 1)
    }
}
