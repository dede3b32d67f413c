//! The model against the manual, one behaviour a test; `README.md` names for each test the change that makes it fail.

mod bench;
mod cancellation;
mod disturbed;
mod errors;
mod filters;
mod frames;
mod image;
mod memory;
mod receive;
mod registers;
mod restricted;
mod transmit;
