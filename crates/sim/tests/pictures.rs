//! Pictures of the simulated world: they can be made without a display, and they show what they should.
#![cfg(feature = "render")]

use sim::HOME;
use sim::render::{RenderError, RenderOptions, Scene, Trail, render_png, render_strip};
use sim::teacher::TaughtMovement;
use sim::teacher::{DEMONSTRATION_GOAL, DEMONSTRATION_START, side_grasp_path};
use sim::world::mujoco::{self, MujocoOptions, MujocoWorld, ObjectKind, ObjectSpec};
use std::path::PathBuf;

/// Pictures of these tests go where cargo wants the output of tests.
fn file(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name)
}

fn scene(posture: [f64; 7]) -> Scene {
    Scene::set_up(&MujocoOptions { posture, ..MujocoOptions::default() }).expect("the scene loads")
}

/// The run of the demonstration as ghosts and a trail.
fn with_history() -> RenderOptions {
    let path = side_grasp_path();
    let points = (0..=60).map(|i| path.pose(path.duration() * f64::from(i) / 60.0).position).collect();
    let between = |share: f64| -> [f64; 7] {
        std::array::from_fn(|i| DEMONSTRATION_START[i] + share * (DEMONSTRATION_GOAL[i] - DEMONSTRATION_START[i]))
    };
    RenderOptions {
        trails: vec![Trail { points, colour: [0.85, 0.12, 0.15, 1.0], radius: 0.008 }],
        ghosts: vec![between(0.0), between(0.5)],
        ..RenderOptions::default()
    }
}

#[test]
fn a_picture_is_a_png_of_the_size_asked_for() {
    let path = file("grasp.png");
    render_png(&scene(DEMONSTRATION_GOAL), &path, &with_history()).expect("a picture without a display");
    let bytes = std::fs::read(&path).expect("the picture exists");
    assert_eq!(&bytes[..8], b"\x89PNG\r\n\x1a\n");
    assert_eq!(&bytes[16..24], &[0, 0, 5, 0, 0, 0, 3, 32], "1280 x 800");
    assert!(bytes.len() > 40_000, "{} bytes are an empty picture", bytes.len());
}

#[test]
fn another_posture_and_a_ghost_and_a_trail_each_change_the_picture() {
    let small = RenderOptions { width: 320, height: 200, ..RenderOptions::default() };
    let history = with_history();
    let take = |name: &str, posture, options: &RenderOptions| {
        render_png(&scene(posture), &file(name), options).expect("a picture without a display");
        std::fs::read(file(name)).expect("the picture exists")
    };
    let plain = take("plain.png", DEMONSTRATION_GOAL, &small);
    assert_eq!(plain, take("again.png", DEMONSTRATION_GOAL, &small), "the same scene, another picture");
    assert_ne!(plain, take("home.png", HOME, &small));
    let trails = RenderOptions { trails: history.trails, ..small.clone() };
    assert_ne!(plain, take("trail.png", DEMONSTRATION_GOAL, &trails));
    let ghosts = RenderOptions { ghosts: history.ghosts, ..small };
    assert_ne!(plain, take("ghost.png", DEMONSTRATION_GOAL, &ghosts));
}

#[test]
fn a_film_strip_has_a_panel_for_each_scene() {
    let path = file("strip.png");
    let options = RenderOptions { width: 1800, height: 480, ..RenderOptions::default() };
    let scenes = [HOME, DEMONSTRATION_START, DEMONSTRATION_GOAL].map(scene);
    render_strip(&scenes, &path, &options).expect("a picture without a display");
    assert_eq!(&std::fs::read(&path).expect("the picture exists")[16..24], &[0, 0, 7, 8, 0, 0, 1, 224]);
}

#[test]
fn every_object_has_its_own_picture_and_scenes_of_different_objects_share_a_strip() {
    let small = RenderOptions { width: 480, height: 300, ..RenderOptions::default() };
    let kinds =
        [ObjectKind::SmallTorch, ObjectKind::Flashlight, ObjectKind::Cup, ObjectKind::Bottle, ObjectKind::Weight];
    let settings =
        kinds.map(|kind| mujoco::Scene::with(ObjectSpec::new(kind))).into_iter().chain([mujoco::Scene::EMPTY]);
    let scenes: Vec<Scene> = settings
        .map(|scene| {
            let posture = if scene.object.is_some_and(|object| object.lies()) {
                TaughtMovement::Bottle
            } else {
                TaughtMovement::Flashlight
            };
            let posture = posture.start();
            Scene::set_up(&MujocoOptions { scene, posture, ..MujocoOptions::default() }).expect("the scene loads")
        })
        .collect();
    let pictures: Vec<Vec<u8>> = scenes
        .iter()
        .enumerate()
        .map(|(i, scene)| {
            let path = file(&format!("object {i}.png"));
            render_png(scene, &path, &small).expect("a picture without a display");
            std::fs::read(path).expect("the picture exists")
        })
        .collect();
    for (i, picture) in pictures.iter().enumerate() {
        assert!(pictures[..i].iter().all(|other| other != picture), "object {i} looks like another");
    }
    let wide = RenderOptions { width: 2400, height: 400, ..RenderOptions::default() };
    render_strip(&scenes, &file("objects.png"), &wide).expect("a strip of different objects");
}

#[test]
fn a_stored_configuration_gives_the_picture_of_the_world_it_came_from() {
    let small = RenderOptions { width: 320, height: 200, ..RenderOptions::default() };
    for scene in [mujoco::Scene::with(ObjectSpec::new(ObjectKind::Cup)), mujoco::Scene::EMPTY] {
        let posture = TaughtMovement::Cup.start();
        let world = MujocoWorld::new(&MujocoOptions { scene, posture, ..MujocoOptions::default() }).expect("it loads");
        let stored = Scene::stored(&scene, world.configuration()).expect("it fits");
        assert_eq!(stored, Scene::of(&world));
        assert_eq!(Scene::stored(&scene, &world.configuration()[1..]), None);
        // The arm is found behind the object, or first where there is none.
        assert_eq!(stored.clone().with_posture(&posture), stored);
        assert_ne!(stored.clone().with_posture(&HOME), stored);
        render_png(&stored.with_posture(&HOME), &file("stored.png"), &small).expect("a picture");
    }
}

#[test]
fn an_impossible_size_and_an_impossible_file_are_refused() {
    let options = |width| RenderOptions { width, ..RenderOptions::default() };
    let scene = scene(HOME);
    for width in [0, 2561] {
        assert!(matches!(render_png(&scene, &file("no.png"), &options(width)), Err(RenderError::Size { .. })));
    }
    assert!(matches!(render_strip(&[], &file("no.png"), &options(640)), Err(RenderError::Size { .. })));
    let nowhere = file("no such folder").join("no.png");
    assert!(matches!(render_png(&scene, &nowhere, &options(320)), Err(RenderError::File(_))));
}
