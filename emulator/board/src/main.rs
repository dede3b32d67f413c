//! The emulated board as a program.
use std::sync::Arc;
use emulated_board::{image::Image, run::{Setup, run}, world::{InProcess, Host}};
use sim::{FreeJoints, HOME, Plant, PlantConfig};
struct Nobody(u64);
impl Host for Nobody {
    fn talk(&mut self, _now: u64, _bytes: &[u8]) -> Vec<u8> { Vec::new() }
    fn see(&mut self, p: &sim::Passage) { self.0 += 1; if self.0 < 20 { eprintln!("{} {:?} {:?}", p.start/25, p.sender, p.frame); } }
}
fn main() {
    let image = Arc::new(Image::read(std::path::Path::new(&std::env::args().nth(1).unwrap())).unwrap_or_else(|e| panic!("{e}")));
    let plant = Plant::new(PlantConfig::default(), Box::new(FreeJoints::new(HOME)));
    let until: u64 = std::env::args().nth(2).unwrap().parse().unwrap();
    let setup = Setup { until: Some(until * 1000), strict: false, log: Some("/tmp/emu.log".into()), ..Setup::default() };
    let t = std::time::Instant::now();
    let out = run(&image, &setup, Box::new(InProcess::new(plant, Box::new(Nobody(0))))).unwrap();
    eprintln!("now {} instr {} resets {:?} log {} wall {:?}", out.now, out.instructions, out.resets, out.log.len(), t.elapsed());
    for f in out.findings.all() { eprintln!("{}", f.line()); }
}
