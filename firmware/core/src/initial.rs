//! The state before the first input, described with the fields that it is of.
#![expect(
    clippy::inline_always,
    reason = "a call that is not inlined returns a large structure over the stack"
)]

use crate::cause::Causes;
use crate::latest::Latest;
use crate::time::{Instant, Span, Stamp};

/// A value before the first input: nothing, none, zero.
pub(crate) trait Initial: Sized {
    /// It.
    const NEW: Self;

    /// The same, written field by field: a constant of a large structure would be a copy in flash.
    #[inline(always)]
    fn initial() -> Self {
        Self::NEW
    }
}

macro_rules! initial {
    ($($type:ty = $value:expr),* $(,)?) => {
        $(impl Initial for $type {
            const NEW: Self = $value;
        })*
    };
}

initial! {
    bool = false, u8 = 0, u16 = 0, u32 = 0, u64 = 0, f32 = 0.0, f64 = 0.0,
    Instant = Self::ZERO, Span = Self::ZERO, Stamp = Self::NONE, Causes = Self::NONE,
}

impl<T> Initial for Option<T> {
    const NEW: Self = None;
}

impl<T> Initial for Latest<T> {
    const NEW: Self = Self::nothing();
}

impl<T: Initial, const N: usize> Initial for [T; N] {
    const NEW: Self = [const { T::NEW }; N];

    #[inline(always)]
    fn initial() -> Self {
        core::array::from_fn(|_| T::initial())
    }
}

impl<T: Initial, U: Initial> Initial for (T, U) {
    const NEW: Self = (T::NEW, U::NEW);

    #[inline(always)]
    fn initial() -> Self {
        (T::initial(), U::initial())
    }
}

/// A structure whose fields begin with the initial state of their types, or with the value behind them.
macro_rules! state {
    (@new $type:ty) => { <$type as $crate::initial::Initial>::NEW };
    (@new $type:ty, $value:expr) => { $value };
    (@initial $type:ty) => { <$type as $crate::initial::Initial>::initial() };
    (@initial $type:ty, $value:expr) => { $value };
    ($(#[$meta:meta])* $vis:vis struct $name:ident {
        $($(#[$doc:meta])* $field_vis:vis $field:ident: $type:ty $(= $value:expr)?,)*
    }) => {
        $(#[$meta])*
        $vis struct $name {
            $($(#[$doc])* $field_vis $field: $type,)*
        }

        impl $crate::initial::Initial for $name {
            const NEW: Self = Self { $($field: state!(@new $type $(, $value)?),)* };

            #[inline(always)]
            fn initial() -> Self {
                Self { $($field: state!(@initial $type $(, $value)?),)* }
            }
        }

        impl Default for $name {
            #[inline(always)]
            fn default() -> Self {
                <Self as $crate::initial::Initial>::initial()
            }
        }
    };
}
