//! The lab tool without its command line: connect to a device, teach, learn, upload, run, record,
//! simulate.

pub mod arm;
pub mod boxed;
pub mod client;
pub mod demonstration;
pub mod device;
pub mod difference;
pub mod error;
pub mod error_code;
pub mod export;
pub mod failure;
pub mod fault_guide;
pub mod friction;
pub mod image_file;
pub mod input_file;
pub mod learn;
pub mod line_health;
pub mod load;
pub mod outcome;
pub mod output_file;
pub mod plan;
pub mod plot;
pub mod primitive_file;
pub mod procedure;
pub mod replay;
pub mod report;
pub mod secret_file;
pub mod settings;
pub mod simulation;
pub mod startup_guide;
pub mod table;
pub mod tracking;
pub mod transport;
pub mod unfinished;
pub mod visible;
pub mod weigh;
