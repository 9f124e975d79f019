//! Logs for a debugger, with the feature `log` only: they are no part of a release.

/// Logs at a level of `defmt`; without the feature nothing but the arguments' types is looked at.
macro_rules! log {
    ($level:ident, $text:literal $(, $argument:expr)* $(,)?) => {{
        #[cfg(feature = "log")]
        defmt::$level!($text $(, $argument)*);
        #[cfg(not(feature = "log"))]
        let _ = ($(&$argument,)*);
    }};
}
pub(crate) use log;
