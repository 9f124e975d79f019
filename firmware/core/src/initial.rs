//! The state before the first input, described with the fields that it is of.

/// Structures that are copied, and whose fields begin with the default of their types, or with the value behind them.
/// They are written field by field: a constant of a large structure would be a copy in flash.
macro_rules! state {
    (@initial $type:ty) => { <$type as Default>::default() };
    (@initial $type:ty, $value:expr) => { $value };
    ($($(#[$meta:meta])* $vis:vis struct $name:ident {
        $($(#[$doc:meta])* $field_vis:vis $field:ident: $type:ty $(= $value:expr)?,)*
    })*) => {$(
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        $vis struct $name {
            $($(#[$doc])* $field_vis $field: $type,)*
        }
        impl Default for $name {
            // A call that is not inlined returns a large structure over the stack.
            #[inline(always)]
            fn default() -> Self {
                Self { $($field: state!(@initial $type $(, $value)?),)* }
            }
        }
    )*};
}
