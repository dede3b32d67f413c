//! Pictures of the MuJoCo world, off screen: one scene, ghosts of earlier postures, trails of the grasp point, film
//! strips.
//!
//! Needs EGL (Debian: `libegl1 libegl-mesa0 libgl1-mesa-dri`), no display and no GPU. Ghosts and trails are geoms added
//! to a copy of the model that exists only for the picture, so physics never sees them.

use crate::Pose;
use crate::world::mujoco::{self, MujocoOptions, MujocoWorld, WorldError};
use mujoco_rs::prelude::{MjData, MjModel, MjtObjBase, MjvCamera};
use mujoco_rs::renderer::{MjRenderer, RendererError, png};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;

/// Group of the geoms that are looked at (class "look" of the model); the shapes that collide are in hidden groups.
const LOOK_GROUP: i32 = 1;

/// Red, green, blue towards which the colours of ghosts are drawn.
const GHOST_TINT: [f32; 3] = [0.55, 0.72, 0.95];

/// Generalized positions of seven arm joints and eight joints of the hand.
const ARM_AND_HAND: usize = 15;

/// Width over height of a picture for which the camera's distance is meant; narrower ones step back to show as much.
const FULL_ASPECT: f64 = 1.25;

/// Where the picture is taken from: a camera that circles a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Point in the middle of the picture, world, m.
    pub look_at: [f64; 3],
    /// Distance from it, m.
    pub distance: f64,
    /// Direction of view about the vertical, degrees: 0 looks along +x, 90 along +y.
    pub azimuth: f64,
    /// Direction of view above the horizontal, degrees: negative looks down.
    pub elevation: f64,
}

impl Default for Camera {
    /// From the front left: the whole arm from the side, the way of the hand to the object unobstructed.
    fn default() -> Self {
        Self { look_at: [0.44, 0.0, 0.02], distance: 2.4, azimuth: -138.0, elevation: -20.0 }
    }
}

impl Camera {
    /// Near the table, from the front left: hand and object of a grasp.
    pub const GRASP: Self = Self { look_at: [0.66, 0.10, -0.03], distance: 1.25, azimuth: -150.0, elevation: -18.0 };
}

/// A dotted line in space, such as the way of the grasp point.
#[derive(Clone, Debug, PartialEq)]
pub struct Trail {
    /// Points, world, m.
    pub points: Vec<[f64; 3]>,
    /// Red, green, blue, opacity; 0 to 1.
    pub colour: [f32; 4],
    /// Radius of the dots, m.
    pub radius: f64,
}

/// Settings of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Width, pixels; at most 2560.
    pub width: u32,
    /// Height, pixels; at most 1600.
    pub height: u32,
    /// Where it is taken from.
    pub camera: Camera,
    /// Dotted lines drawn into it.
    pub trails: Vec<Trail>,
    /// Arm postures (rad) drawn as ghosts, the faintest first.
    pub ghosts: Vec<[f64; 7]>,
}

impl Default for RenderOptions {
    /// 1280 x 800 pixels from the default camera, without additions.
    fn default() -> Self {
        Self { width: 1280, height: 800, camera: Camera::default(), trails: Vec::new(), ghosts: Vec::new() }
    }
}

/// The state that a picture shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    setting: mujoco::Scene,
    configuration: Vec<f64>,
}

impl Scene {
    /// The world as it is now.
    #[must_use]
    pub fn of(world: &MujocoWorld) -> Self {
        Self { setting: *world.scene(), configuration: world.configuration().to_vec() }
    }

    /// A world as it once was: what [`MujocoWorld::configuration`] gave in a world of this setting, kept since then.
    /// `None` if the configuration has not as many numbers as such a world.
    #[must_use]
    pub fn stored(setting: &mujoco::Scene, configuration: &[f64]) -> Option<Self> {
        let fits = configuration.len() == Self::first_joint(setting) + ARM_AND_HAND;
        fits.then(|| Self { setting: *setting, configuration: configuration.to_vec() })
    }

    /// Where joint 1 is in the configuration: the seven numbers of the object come first, if there is one.
    fn first_joint(setting: &mujoco::Scene) -> usize {
        if setting.object.is_some() { 7 } else { 0 }
    }

    /// The world as it is set up by `options`.
    ///
    /// # Errors
    /// [`WorldError`] if an option is out of range.
    pub fn set_up(options: &MujocoOptions) -> Result<Self, WorldError> {
        MujocoWorld::new(options).map(|world| Self::of(&world))
    }

    /// The same scene with the arm in the posture `q`, rad.
    #[must_use]
    pub fn with_posture(mut self, q: &[f64; 7]) -> Self {
        self.configuration[Self::first_joint(&self.setting)..][..7].copy_from_slice(q);
        self
    }

    /// The same scene with the object elsewhere; nothing changes without an object.
    #[must_use]
    pub fn with_object(mut self, pose: &Pose) -> Self {
        if self.setting.object.is_some() {
            self.configuration[..3].copy_from_slice(&pose.position);
            self.configuration[3..7].copy_from_slice(&pose.quaternion);
        }
        self
    }
}

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The model with the additions does not load.
    #[error("the picture's model does not load: {0}")]
    Model(String),
    /// No off-screen graphics.
    #[error("no off-screen graphics ({0}); on Debian: apt install libegl1 libegl-mesa0 libgl1-mesa-dri")]
    Graphics(#[from] RendererError),
    /// The file cannot be written.
    #[error("cannot write the picture: {0}")]
    File(#[from] io::Error),
    /// A picture needs at least one pixel and one scene, and the model allows 2560 x 1600 pixels.
    #[error("a picture of {width} x {height} pixels and {scenes} scenes cannot be made")]
    Size {
        /// Width asked for, pixels.
        width: u32,
        /// Height asked for, pixels.
        height: u32,
        /// Number of scenes.
        scenes: usize,
    },
}

/// Makes a PNG picture of a scene.
///
/// # Errors
/// [`RenderError`] if there is no EGL, the size is not possible, or the file cannot be written.
pub fn render_png(scene: &Scene, path: &Path, options: &RenderOptions) -> Result<(), RenderError> {
    render_strip(std::slice::from_ref(scene), path, options)
}

/// Makes a PNG film strip: the scenes side by side, each `width / scenes` pixels wide.
///
/// # Errors
/// [`RenderError`] if there is no EGL, the size is not possible, or the file cannot be written.
pub fn render_strip(scenes: &[Scene], path: &Path, options: &RenderOptions) -> Result<(), RenderError> {
    let (width, height) = (options.width, options.height);
    let impossible = RenderError::Size { width, height, scenes: scenes.len() };
    let panel = u32::try_from(scenes.len()).ok().and_then(|n| width.checked_div(n)).unwrap_or(0);
    if panel == 0 || height == 0 || width > 2560 || height > 1600 {
        return Err(impossible);
    }
    let mut picture = Picture::new(panel * scenes.len() as u32, height);
    let mut left = 0;
    // Scenes of one setting share a model.
    for alike in scenes.chunk_by(|a, b| a.setting == b.setting) {
        let model = picture_model(alike, options)?;
        let mut data = MjData::new(&model);
        let mut camera = MjvCamera::new_free(&model);
        let c = &options.camera;
        let distance = c.distance * (FULL_ASPECT * f64::from(height) / f64::from(panel)).max(1.0);
        (camera.lookat, camera.distance, camera.azimuth, camera.elevation) =
            (c.look_at, distance, c.azimuth, c.elevation);
        let mut renderer = MjRenderer::builder().width(panel).height(height).camera(camera).build(&model)?;
        for scene in alike {
            data.qpos_mut().copy_from_slice(&scene.configuration);
            data.forward();
            renderer.sync_data(&mut data)?;
            renderer.render()?;
            picture.put(left, panel, renderer.rgb_flat().ok_or(RendererError::RgbDisabled)?);
            left += panel;
        }
    }
    picture.save(path)?;
    Ok(())
}

/// The model with ghosts and trails as geoms that touch nothing.
fn picture_model(scenes: &[Scene], options: &RenderOptions) -> Result<MjModel, RenderError> {
    let load = |text: &str| MjModel::from_xml_string(text).map_err(|e| RenderError::Model(e.to_string()));
    let mut additions = String::new();
    let text = scenes.first().map(|scene| scene.setting).unwrap_or_default().model(true);
    if let Some(scene) = scenes.first().filter(|_| !options.ghosts.is_empty()) {
        let plain = load(&text)?;
        for (i, posture) in options.ghosts.iter().enumerate() {
            let opacity = 0.08 + 0.22 * (i + 1) as f64 / options.ghosts.len() as f64;
            ghost(&plain, &scene.clone().with_posture(posture), opacity, &mut additions);
        }
    }
    for trail in &options.trails {
        let [r, g, b, a] = trail.colour;
        for [x, y, z] in &trail.points {
            // Writing into a String cannot fail.
            let _ = writeln!(
                additions,
                r#"<geom class="look" type="sphere" size="{}" pos="{x} {y} {z}" rgba="{r} {g} {b} {a}"/>"#,
                trail.radius
            );
        }
    }
    match text.split_once("</worldbody>") {
        Some((before, after)) => load(&format!("{before}{additions}</worldbody>{after}")),
        None => Err(RenderError::Model("it has no worldbody".to_owned())),
    }
}

/// Writes the looks of the arm in another posture as fixed, transparent geoms.
fn ghost(model: &MjModel, scene: &Scene, opacity: f64, text: &mut String) {
    const SHAPES: [&str; 7] = ["plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box"];
    let mut data = MjData::new(model);
    data.qpos_mut().copy_from_slice(&scene.configuration);
    data.kinematics();
    // The pedestal and the base joint's drum look the same in every posture; drawn twice they would flicker.
    let unmoved = ["object", "base", "link1"].map(|name| model.name_to_id(MjtObjBase::mjOBJ_BODY, name));
    for (i, &group) in model.geom_group().iter().enumerate() {
        let body = model.geom_bodyid()[i] as usize;
        // Body 0 is the world: table and floor have no ghosts.
        if group != LOOK_GROUP || body == 0 || unmoved.contains(&Some(body)) {
            continue;
        }
        let Some(shape) = SHAPES.get(model.geom_type()[i] as usize) else {
            continue;
        };
        let colour = usize::try_from(model.geom_matid()[i]).map_or(model.geom_rgba()[i], |m| model.mat_rgba()[m]);
        // Paler and bluer than the arm itself: a dark, half transparent part would look like a stain.
        let colour = [0, 1, 2].map(|k| 0.45 * colour[k] + 0.55 * GHOST_TINT[k]);
        let [x, y, z] = data.geom_xpos()[i];
        let [a, b, c] = model.geom_size()[i];
        let m = data.geom_xmat()[i];
        let _ = writeln!(
            text,
            r#"<geom class="look" type="{shape}" size="{a} {b} {c}" pos="{x} {y} {z}" xyaxes="{} {} {} {} {} {}" rgba="{} {} {} {opacity}"/>"#,
            m[0], m[3], m[6], m[1], m[4], m[7], colour[0], colour[1], colour[2],
        );
    }
}

/// Pixels of three bytes.
struct Picture {
    width: u32,
    height: u32,
    pixels: Vec<u8>,
}

impl Picture {
    fn new(width: u32, height: u32) -> Self {
        Self { width, height, pixels: vec![255; 3 * width as usize * height as usize] }
    }

    /// Copies a panel of full height to the column `left`.
    fn put(&mut self, left: u32, width: u32, panel: &[u8]) {
        let rows = self.pixels.chunks_exact_mut(3 * self.width as usize);
        for (row, source) in rows.zip(panel.chunks_exact(3 * width as usize)) {
            row[3 * left as usize..][..source.len()].copy_from_slice(source);
        }
    }

    fn save(&self, path: &Path) -> io::Result<()> {
        let mut encoder = png::Encoder::new(BufWriter::new(File::create(path)?), self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Balanced);
        let mut writer = encoder.write_header().map_err(io::Error::other)?;
        writer.write_image_data(&self.pixels).map_err(io::Error::other)
    }
}
