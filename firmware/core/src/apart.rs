//! Construction of large values in place, part by part. A whole value would fill a board's stack, and as a constant
//! it would be a copy in flash, nearly all zeros.

#[inline(never)]
pub(crate) fn apart(act: impl FnOnce()) {
    act();
}

/// Makes a structure in a place ([`core::mem::MaybeUninit`]) out of all its fields, one after the other; gives the
/// reference to it.
macro_rules! place {
    ($place:expr, $Whole:ident { $($part:ident: $value:expr),* $(,)? }) => {{
        let place: &mut core::mem::MaybeUninit<$Whole> = $place;
        let whole = place.as_mut_ptr();
        $($crate::apart::apart(|| {
            let part = $value;
            // SAFETY: the place is ours alone and large enough; a field of it is written, nothing is read.
            unsafe { (&raw mut (*whole).$part).write(part) }
        });)*
        let _all = |$($part),*| $Whole { $($part),* };
        // SAFETY: `_all` names each field there is, and each of these was written.
        unsafe { place.assume_init_mut() }
    }};
}

pub(crate) use place;
