//! From card to answer, checked by foreign readers.

#[cfg(feature = "oracle")]
mod damaged;
#[cfg(feature = "oracle")]
mod dataflash;
#[cfg(feature = "oracle")]
mod exports;
#[cfg(feature = "oracle")]
mod fleet;
#[cfg(feature = "oracle")]
mod readback;
#[cfg(feature = "oracle")]
mod ulog;
