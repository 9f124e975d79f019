//! The card as the driver, the recorder and a download meet it.

mod campaign;
mod costs;
mod download;
mod driver;
mod foreign;
mod large;
mod mishap;
mod rig;
