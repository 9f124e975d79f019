//! What the fuzz targets check of any bytes. The crates' own tests include these files, so that the same checks run
//! on a few thousand made-up inputs with every test.

pub mod decoder;
pub mod framer;
pub mod reader;
pub mod round_trip;
