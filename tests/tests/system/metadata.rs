//! Metadata of an image in its file, and in its hello when it runs.

use lab::image_file::ImageFile;
use lab::simulation::{IMAGE_VARIABLE, built_image};
use system_tests::connect;

#[test]
fn the_running_image_says_the_same_as_its_file() {
    let named = std::env::var_os(IMAGE_VARIABLE).map(std::path::PathBuf::from);
    let path = named.or_else(|| built_image("arm.elf")).expect("`cargo xtask build` leaves the image");
    let image = ImageFile::read(&path).unwrap_or_else(|error| panic!("{error}"));
    let arm = connect("sim:world=simple,seed=31");
    let (file, device) = (&image.description, arm.hello());
    assert_eq!(device.firmware.as_str(), file.firmware);
    assert_eq!(device.board.as_str(), file.board);
    assert_eq!(device.link_version, file.link_version);
    assert_eq!(device.schema_hash, file.schema_hash);
    assert_eq!(device.model_hash, file.model_hash);
    assert_eq!(device.simulated, file.simulated);
    assert!(image.chip().is_err(), "an image for the emulator must never be flashed");
    assert!(image.writes.iter().all(|write| file.image.contains(write.start, write.length)), "{image:?}");
}
