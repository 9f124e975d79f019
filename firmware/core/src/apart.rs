//! Construction of large values in place, part by part. A whole value would fill a board's stack, and as a constant
//! it would be a copy in flash, nearly all zeros.

#[inline(never)]
pub(crate) fn apart(act: impl FnOnce()) {
    act();
}

/// A structure that is made in a place ([`core::mem::MaybeUninit`]), one field after the other: each begins with the
/// default of its type, or with the value behind it, which may use the argument.
macro_rules! made_in_place {
    ($(#[$meta:meta])* $vis:vis struct $name:ident($argument:ident: $of:ty) {
        $($(#[$doc:meta])* $field:ident: $type:ty $(= $value:expr)?,)*
    }) => {
        $(#[$meta])*
        $vis struct $name {
            $($(#[$doc])* $field: $type,)*
        }

        impl $name {
            /// Before the first input, built in place: never whole on the stack.
            $vis fn begin<'a>(place: &'a mut core::mem::MaybeUninit<Self>, $argument: $of) -> &'a mut Self {
                let whole = place.as_mut_ptr();
                $($crate::apart::apart(|| {
                    let part = state!(@initial $type $(, $value)?);
                    // SAFETY: the place is ours alone and large enough; a field of it is written, nothing is read.
                    unsafe { (&raw mut (*whole).$field).write(part) }
                });)*
                // SAFETY: each field was written.
                unsafe { place.assume_init_mut() }
            }
        }
    };
}

pub(crate) use made_in_place;
