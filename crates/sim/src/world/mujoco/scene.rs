//! The arm's surroundings: table and object, and the text of the model that goes with them.

use super::error::WorldError;
use super::object::ObjectSpec;
use crate::world::ObjectKind;

/// The model of arm and table, read at compile time: the simulator needs no file at run time.
const MODEL: &str = include_str!("../../../model/wam7_bh280.xml");

/// The line of the model in whose place the object goes.
const OBJECT_LINE: &str = "<!-- object -->";

/// The lines of the model between which the table stands.
const TABLE_LINES: [&str; 2] = ["<!-- table:", "<!-- end of table -->"];

/// The table's top, world x and y, m: centre and half extents.
const TABLE_CENTRE: [f64; 2] = [0.75, 0.0];
const TABLE_HALF_EXTENT: [f64; 2] = [0.35, 0.55];

/// Table and object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scene {
    /// The object; `None` leaves the table empty.
    pub object: Option<ObjectSpec>,
    /// True if arm and hand collide with the table. An object has its own ground in either case.
    pub table: bool,
}

impl Default for Scene {
    /// The small torch on the table.
    fn default() -> Self {
        Self::with(ObjectSpec::new(ObjectKind::SmallTorch))
    }
}

impl Scene {
    /// The table without an object.
    pub const EMPTY: Self = Self { object: None, table: true };

    /// Neither table nor object.
    pub const NOTHING: Self = Self { object: None, table: false };

    /// An object on the table.
    #[must_use]
    pub const fn with(object: ObjectSpec) -> Self {
        Self { object: Some(object), table: true }
    }

    /// Refuses what cannot be simulated.
    pub(super) fn check(&self) -> Result<(), WorldError> {
        let Some(object) = &self.object else {
            return Ok(());
        };
        let [x, y] = object.position;
        let on_table = (0..2).all(|i| (object.position[i] - TABLE_CENTRE[i]).abs() <= TABLE_HALF_EXTENT[i]);
        if !on_table {
            return Err(WorldError::OffTable { x, y });
        }
        object.check()
    }

    /// The whole model in MuJoCo's language, with or without the geoms that are only looked at: they would cost an
    /// eighth of the time of a step.
    pub(crate) fn model(&self, looks: bool) -> String {
        let mut text = String::with_capacity(MODEL.len() + 4096);
        let mut in_table = false;
        let mut add = |line: &str| {
            if looks || !line.trim_start().starts_with(r#"<geom class="look""#) {
                text.push_str(line);
                text.push('\n');
            }
        };
        for line in MODEL.lines() {
            match line.trim_start() {
                mark if mark.starts_with(TABLE_LINES[0]) => in_table = true,
                mark if mark.starts_with(TABLE_LINES[1]) => in_table = false,
                mark if mark == OBJECT_LINE => {
                    self.object.iter().for_each(|object| object.xml().lines().for_each(&mut add));
                }
                _ if in_table && !self.table => {}
                _ => add(line),
            }
        }
        text
    }
}
