//! Departures of a recording from the successful runs: the watch of the device, gone over it once more.

use control::guard::Watch;
use control::plan::primitive::STATISTICS_CHANNELS;

use crate::demonstration::Recording;
use crate::primitive_file::PrimitiveFile;
use crate::procedure::CHANNELS;

/// A channel that left its band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Departure {
    /// Sample of the running part.
    pub(super) sample: usize,
    /// The channel, as a word.
    pub(super) channel: &'static str,
}

impl Departure {
    /// One sentence without full stop.
    pub(super) fn words(self) -> String {
        let what = match self.channel {
            "finger F1" | "finger F2" | "finger F3" => "closed farther than in the successful runs: nothing stopped it",
            _ => "was unlike the successful runs",
        };
        format!("{} {what}", self.channel)
    }
}

/// The channels that leave their band, in their order. None where the primitive has no statistics, or the recording
/// lacks what is compared.
pub(super) fn departures(running: &Recording, progress: &[f64], primitive: &PrimitiveFile) -> Vec<Departure> {
    let known = primitive.to_primitive().ok();
    let Some(known) = known.as_ref().and_then(|primitive| primitive.statistics()) else { return Vec::new() };
    let (Some(wrench), Some(gauges), Some(hand)) = (&running.wrench, &running.gauges, &running.hand) else {
        return Vec::new();
    };
    let mut watch = Watch::new();
    let mut departures = Vec::new();
    for (sample, (((wrench, gauges), hand), progress)) in wrench.iter().zip(gauges).zip(hand).zip(progress).enumerate()
    {
        let mut values = [0.0; STATISTICS_CHANNELS];
        let all = wrench.iter().chain(gauges).chain(hand.iter().skip(1));
        values.iter_mut().zip(all).for_each(|(value, measured)| *value = *measured);
        if let Some(surprise) = watch.step(known, *progress, &values, true) {
            let channel = CHANNELS.get(usize::from(surprise.channel)).copied().unwrap_or("unknown channel");
            departures.push(Departure { sample, channel });
        }
    }
    departures
}
