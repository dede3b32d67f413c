//! Tells the executables of this package where the MuJoCo library lies; harmless where they do not use it.
//!
//! `mujoco-rs` links the library but leaves no search path in the executable. `$ORIGIN` keeps the path relative to the
//! executable, so that the build folder can be moved: programs lie in `target/<profile>`, test binaries and examples
//! one folder deeper, and `cargo xtask setup` puts the library into `target/mujoco/lib`. Not tied to a feature of this
//! package: cargo may switch the MuJoCo world of `sim` on for a neighbour, and then these executables need it too.
//!
//! Other packages use this script too, and `experiment` repeats its line: a path relative to one of them is missing in
//! the others, and cargo would build them anew in every call.

fn main() {
    let package = std::env::var("CARGO_PKG_NAME").unwrap_or_default();
    let script = if package == "tactus" { "build.rs" } else { "../../host/build.rs" };
    println!("cargo::rerun-if-changed={script}");
    println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/../mujoco/lib:$ORIGIN/../../mujoco/lib");
}
