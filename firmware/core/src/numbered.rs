//! Names with numbers that are stored in logs: each stands once.

/// An enumeration by number, with the name of each: from 0 on, or from the number that the first one has. A number and a name never change
/// their meaning.
macro_rules! numbered {
    ($(#[$meta:meta])* $vis:vis enum $type:ident { $($(#[$doc:meta])* $variant:ident $(= $number:literal)? $name:literal,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        $vis enum $type {
            $($(#[$doc])* $variant $(= $number)?,)*
        }

        impl $type {
            /// All of them, by number.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$variant),*];

            /// How many there are.
            pub const COUNT: usize = Self::ALL.len();

            /// The name that logs, JSON and reports use.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)*
                }
            }

            /// That of a stored number; `None` for one that this version does not know.
            pub fn from_number(number: u8) -> Option<Self> {
                Self::ALL.into_iter().find(|one| *one as u8 == number)
            }
        }
    };
}
