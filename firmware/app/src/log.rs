//! Debugger logs, only with the feature `log`, which releases do not have.

/// Logs at a level of `defmt`; without the feature only the arguments' types are checked.
macro_rules! log {
    ($level:ident, $text:literal $(, $argument:expr)* $(,)?) => {{
        #[cfg(feature = "log")]
        defmt::$level!($text $(, $argument)*);
        #[cfg(not(feature = "log"))]
        let _ = ($(&$argument,)*);
    }};
}
pub(crate) use log;
