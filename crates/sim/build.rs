//! Tells this crate's own tests and examples where the MuJoCo library lies.
//!
//! `mujoco-rs` links the library but leaves no search path in the executable. `$ORIGIN` keeps the path relative to the
//! executable, so that the build folder can be moved: examples lie in `target/<profile>/examples`, test binaries in
//! `target/<profile>/deps`, and `cargo xtask setup` puts the library into `target/mujoco/lib`.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var_os("CARGO_FEATURE_MUJOCO").is_some() {
        println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/../../mujoco/lib");
    }
}
