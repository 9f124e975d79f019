//! From card to answer, checked by foreign readers.

mod damaged;
mod dataflash;
mod exports;
mod fleet;
mod readback;
mod ulog;
